"""Scalars, 3-vectors, quaternions and direction cosines are written once here, for every kind of number.

Start with `scalar`: it says what an equation may use. The other modules are plain functions over tuples.
"""
