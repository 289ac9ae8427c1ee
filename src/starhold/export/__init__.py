"""Laws as they leave for flight: C99 with what it takes to trust it, and shells over it.

A shell is a file in `templates` and a line of `shells.SHELLS`.
"""
