"""A quaternion stated by a user: accepted with a length near 1, and normalised."""

from __future__ import annotations

import math
from typing import Any

from starhold.algebra.quantity import Quantity
from starhold.algebra.quaternion import Quaternion, stretch
from starhold.algebra.vector import most
from starhold.parts.contract import Parameter

SHORTEST, LONGEST = 0.5, 2.0
"""Lengths between which four numbers are accepted as a quaternion to be normalised, such as [0, 1, 1, 1]."""
ALLOWED = f"a quaternion of length 1, or between {SHORTEST:g} and {LONGEST:g} to be normalised"
START = Parameter("1", shape=(4,), spread=False, text="assumed initial attitude: quaternion, inertial to body, scalar first")
"""The declaration of the initial estimate, common to all estimators."""
VALID = Quantity("1", "1 if the estimated attitude is based on a measured one, else 0")
"""The quantity that states whether an estimate can be relied on."""


def unit_quaternion(stated: Quaternion) -> Quaternion:
    """Return the unit quaternion in the direction of four numbers. Raise ValueError if their length is far from 1."""
    length = math.hypot(*stated)
    try:
        check_attitude(stated)
    except ValueError:
        raise ValueError(f"must be {ALLOWED}, not of length {length:g}") from None
    return stretch(1.0 / length, stated)


def check_attitude(stated: Any) -> None:
    """Raise ValueError if four numbers, recorded ones too, are no attitude."""
    if most(stated) == 0.0:
        raise ValueError("a quaternion that is not zero")
    if not SHORTEST * SHORTEST <= sum(x * x for x in stated) <= LONGEST * LONGEST:
        raise ValueError(ALLOWED)
