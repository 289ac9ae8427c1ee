"""Control laws, one file each. A module here with a `CARD` is a law; `catalogue` finds them, `interface` defines what they
contain."""
