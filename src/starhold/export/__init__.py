"""Exports laws for flight: C99 with evidence of its correctness, and shells around it. A shell is a file in `templates` and
an entry of `shells.SHELLS`."""
