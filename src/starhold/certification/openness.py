"""The parts of a loop that no claim is about: claims assume them away by name, or take their torque in by its bound."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from starhold.certification.certificate import Claim
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.part import Fitted

READ = {
    "environment": ("two-body", "gravity-gradient", "linear-gravity", "three-body-gravity"),
    "effector": ("wheels",),
    "target": ("inertial", "orbital", "history"),
}
"""Parts that claims are about, by role. What other assumptions speak of already is in TOLD."""
TOLD = ("random-torque", "gaussian", "lag", "rate-limit")
WITHOUT = "without the "
"""Begins the assumption that a part is not there."""


def bounded_torque(loop: ClosedLoop) -> float:
    """The norm (N m) that the torques from outside which declare a bound have together. They enter claims against
    disturbances, which only laws that declare a V have."""
    return sum((_bound(f) for f in loop.used("environment") if _enters(loop, f)), 0.0)


def assumed_away(loop: ClosedLoop) -> list[str]:
    """The parts of a loop that no claim is about, as role and name."""
    found: list[str] = []
    for fitted in loop.parts:
        part = fitted.part
        if part.name in (*READ.get(part.role, ()), *TOLD) and part.file is None:
            continue
        if part.role != "environment" or not _enters(loop, fitted):
            found.append(f"{part.role} {fitted.called}")
    return found


def named(claims: list[Claim], loop: ClosedLoop) -> tuple[Claim, ...]:
    """The claims with an assumption for each part that they are not about."""
    more = tuple(f"{WITHOUT}{name}" for name in assumed_away(loop))
    return tuple(replace(claim, assumptions=(*claim.assumptions, *more)) for claim in claims)


def _enters(loop: ClosedLoop, fitted: Fitted) -> bool:
    part = fitted.part
    return part.hook("bound") is not None and part.hook("torque") is not None and loop.law.lyapunov is not None


def _bound(fitted: Fitted) -> float:
    bound: Any = fitted.part.hook("bound")
    return float(bound(fitted.params))
