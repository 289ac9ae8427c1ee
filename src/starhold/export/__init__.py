"""Exports laws for flight: C99 with the evidence that it can be trusted, and shells over it. A shell is a file in
`templates` and a line of `shells.SHELLS`."""
