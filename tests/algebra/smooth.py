"""Equations that have slopes, and a point, for the tests of those."""

from starhold.algebra.quaternion import multiply, normalise, to_body
from starhold.algebra.scalar import absolute, clip, divide, maximum, sqrt
from starhold.algebra.vector import clip_norm, solve

POINT = (0.9, -0.2, 0.3, 0.1, 0.5, -1.5, 2.0)
EQUATIONS = {
    "turned": lambda x: to_body(normalise(tuple(x[:4])), tuple(x[4:])),
    "product": lambda x: multiply(tuple(x[:4]), (x[4], 2.0, x[5], 1.0 - x[6])),
    "limited": lambda x: clip_norm(tuple(x[4:]), x[0]),
    "solved": lambda x: solve(((x[6], x[1], x[2]), (x[1], 3.0, x[3]), (x[2], x[3], 4.0)), tuple(x[3:6])),
    "scalars": lambda x: (sqrt(x[0]) / x[5], divide(2.0, x[6]), -absolute(x[5]), maximum(x[1], x[2]), 3.0 - clip(x[6], 1.0)),
}
