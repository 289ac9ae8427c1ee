"""Control laws stand here, one file each.

A module here with a `CARD` is a law; `catalogue` finds them, `interface` says what one holds.
"""
