"""The parts of a loop, one file each, in a folder for each role. `contract` and `roles` say what they contain, `catalogue`
finds them; the craft, random numbers, the Earth and the Sun, which parts share, have modules here."""
