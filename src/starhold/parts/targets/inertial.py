"""A constant attitude in the inertial frame."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from starhold.algebra.quaternion import NO_TURN, Quaternion
from starhold.algebra.vector import ZERO
from starhold.parts.contract import AT_REST, Card, Motion, Orbit, Parameter
from starhold.parts.roles import Goal

CARD = Card(title="Inertial attitude", summary="q_RN = constant", sources=("definition",), assumptions=())
ROLE = "target"
TABLE = "target"
STILL = True


class Params(NamedTuple):
    """The attitude of the target."""

    attitude: Annotated[Quaternion, Parameter("1", shape=(4,), spread=False, text="unit quaternion, scalar first")] = NO_TURN


def goal(params: Params, state: Any, step: int, before: Any) -> Goal:
    """Return the attitude, at rest."""
    return Goal(params.attitude, ZERO, ZERO)


def motion(params: Params, orbit: Orbit) -> Motion:
    """None."""
    return AT_REST


def examples() -> list[Params]:
    """Return the inertial axes, and other axes."""
    return [Params(), Params((0.6, 0.0, 0.8, 0.0))]
