"""Scalars, 3-vectors, quaternions and direction cosines, each defined once for every kind of number.

Start with `scalar`: it lists what an equation may use. The other modules are plain functions of tuples.
"""
