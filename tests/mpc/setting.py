"""What the tests of the predictive law share: crafts, published weights, and what the law sees of a target at rest."""

from typing import Any

from starhold.algebra.quaternion import normalise
from starhold.algebra.vector import ZERO
from starhold.laws import mpc
from starhold.laws.interface import Measurement
from starhold.parts.craft import make_craft

CRAFTS = {
    "principal": make_craft([2.0, 3.0, 4.0], 0.01),
    "full": make_craft([[12.0, 1.0, -0.5], [1.0, 15.0, 0.7], [-0.5, 0.7, 9.0]], 0.05),
}
WEIGHTS = ((0.2, 0.2, 0.2), (0.2, 0.2, 0.2), (50.0, 50.0, 50.0))
POSITION = (4.1e6, -3.3e6, 5.2e6)


def seen_at(attitude: Any, rate: Any, position: Any = ZERO, period: float = 0.1) -> Measurement:
    """What the law sees of a target at rest."""
    return Measurement(normalise(attitude), rate, rate, ZERO, ZERO, ZERO, position, period)


def fresh(gains: mpc.Gains, craft: Any = CRAFTS["principal"], period: float = 0.1) -> mpc.Memory:
    """A new memory."""
    return mpc.remember(gains, craft, period)
