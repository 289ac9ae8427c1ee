"""Terms that claims about station-keeping loops have in common."""

from __future__ import annotations

from typing import Any

from starhold.algebra.polynomial import Polynomial
from starhold.certification.subject import direction
from starhold.laws.point import PointMeasurement
from starhold.loop.closed_loop import ClosedLoop

COMMON = (
    "circular motion of the two bodies",
    "position and velocity exactly known",
    "control applied continuously, without lag",
)
LINEAR, FULL = "linear motion near the point", "motion exactly as modelled"
UNLIMITED = "control not limited"


def assumed(loop: ClosedLoop, *more: str) -> tuple[str, ...]:
    """The assumptions of a claim about a loop."""
    return (LINEAR if model_of(loop) == "linear" else FULL, *COMMON, *more)


def mismatch(loop: ClosedLoop) -> str:
    """The fault of a law that undoes another model than the one that is flown; empty where it undoes that."""
    if model_of(loop) == ("nonlinear" if loop.gains.model else "linear"):
        return ""
    if loop.gains.model:
        return "the law undoes what the linear model does not have"
    return "the law undoes the linear model, and the full problem is flown"


def point_measurement() -> PointMeasurement:
    """The law's measurement in variables x1..x3 and v1..v3."""
    zero: Any = Polynomial.constant(0)
    return PointMeasurement(direction("x"), direction("v"), zero, zero)


def model_of(loop: ClosedLoop) -> str:
    """The field that the motion is in: "linear" or "nonlinear"."""
    return "linear" if loop.has("linear-gravity") else "nonlinear"


def lag_of(loop: ClosedLoop) -> float:
    """The time constant of the control surfaces (scaled), 0 for none."""
    found = loop.find("lag")
    return 0.0 if found is None else found.params.lag
