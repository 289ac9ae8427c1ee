"""Each claim leaves out by name the parts of its loop that it is not about: the list is computed from what the loop has."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from starhold.certification.assumptions import WITHOUT
from starhold.certification.certificate import Claim
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.orbit import body_of, lowest
from starhold.parts.part import Fitted, Part

READ = {
    "environment": ("two-body", "gravity-gradient", "linear-gravity", "three-body-gravity"),
    "effector": ("wheels",),
    "target": ("inertial", "orbital", "history"),
}
"""The parts that theorems take in, by role; what a claim takes of their torques and motions its other assumptions say."""
BOUNDED = ("disturbance",)
"""Kinds of claims that take in torques from outside by their bounds."""


def bounded_torque(loop: ClosedLoop) -> float:
    """The norm (N m) that the torques from outside which declare a bound have together. They enter claims against
    disturbances, which only laws that declare a V have."""
    return sum((_bound(f) for f in loop.parts if _enters(loop, f)), 0.0)


def assumed_away(loop: ClosedLoop) -> list[str]:
    """The parts of a loop that no claim is about, as role and name."""
    return [_called(f) for f in loop.parts if not (_is_read(f) or _enters(loop, f))]


def bounded_away(loop: ClosedLoop) -> list[str]:
    """The torques that only claims of the kinds `BOUNDED` take in, as role and name."""
    return [_called(f) for f in loop.parts if _enters(loop, f)]


def named(claims: list[Claim], loop: ClosedLoop) -> tuple[Claim, ...]:
    """The claims with an assumption for each part that they are not about."""
    always, unless_bounded = assumed_away(loop), bounded_away(loop)

    def more(kind: str) -> tuple[str, ...]:
        absent = always if kind in BOUNDED else [*always, *unless_bounded]
        return tuple(f"{WITHOUT}{name}" for name in absent)

    return tuple(replace(claim, assumptions=(*claim.assumptions, *more(claim.kind))) for claim in claims)


def _called(fitted: Fitted) -> str:
    return f"{fitted.part.role} {fitted.called}"


def _is_read(fitted: Fitted) -> bool:
    return fitted.part.name in READ.get(fitted.part.role, ()) and fitted.part.file is None


def _enters(loop: ClosedLoop, fitted: Fitted) -> bool:
    part = fitted.part
    bounded = part.role == "environment" and part.hook("bound") is not None and part.hook("torque") is not None
    return bounded and loop.law.lyapunov is not None and _holds(loop, part)


def _holds(loop: ClosedLoop, part: Part) -> bool:
    """Whether all of the orbit lies where the part's bound holds."""
    if part.about and body_of(loop.craft.gravity) != part.about:
        return False
    if not part.bound_from:
        return True
    # A little more, for floats tell how low the orbit comes.
    return lowest(loop.start.position, loop.start.velocity, loop.craft.gravity) >= part.bound_from * (1.0 + 1e-9)


def _bound(fitted: Fitted) -> float:
    bound: Any = fitted.part.hook("bound")
    return float(bound(fitted.params))
