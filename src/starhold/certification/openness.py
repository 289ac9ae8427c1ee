"""Each claim leaves out by name the parts of its loop that it is not about: the list is computed from what the loop has."""

from __future__ import annotations

from dataclasses import replace
from math import isfinite
from typing import Any, NamedTuple

from starhold.certification.assumptions import WITHOUT
from starhold.certification.certificate import Claim
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.contract import NO_ERRORS, Errors
from starhold.parts.orbit import body_of, lowest
from starhold.parts.part import Fitted, Part

READ = {
    "environment": ("two-body", "gravity-gradient", "linear-gravity", "three-body-gravity"),
    "effector": ("wheels",),
    "target": ("inertial", "orbital", "history"),
}
"""The parts that theorems take in, by role; what a claim takes of their torques and motions its other assumptions say."""
BOUNDED = ("pointing",)
"""Kinds of claims that take in torques from outside and errors by their bounds."""


class Pushes(NamedTuple):
    """Bounds of what acts on a loop and is told to no law: the torque from outside (N m), and errors of the attitude (rad)
    and the rate (rad/s) that the law is told, and of the command (N m)."""

    outside: float
    attitude: float = 0.0
    rate: float = 0.0
    command: float = 0.0


def pushes(loop: ClosedLoop) -> Pushes:
    """Bounds of what the parts of a loop that say theirs do together."""
    torques, errors = list[float](), [NO_ERRORS]
    for fitted in loop.parts:
        if (torque := _torque(loop, fitted)) is not None:
            torques.append(torque)
        if (error := _errors(fitted)) is not None:
            errors.append(error)
    # A little more, for floats are added.
    return Pushes(*(sum(own) * (1.0 + 1e-12) for own in (torques, *zip(*errors, strict=True))))


def assumed_away(loop: ClosedLoop) -> list[str]:
    """The parts of a loop that no claim but those of the kinds `BOUNDED` is about, as role and name."""
    return [_called(f) for f in loop.parts if not _is_read(f)]


def named(claims: list[Claim], loop: ClosedLoop) -> tuple[Claim, ...]:
    """The claims with an assumption for each part that they are not about."""
    away = assumed_away(loop)
    unbounded = [_called(f) for f in loop.parts if not (_is_read(f) or _says(loop, f))]

    def more(claim: Claim) -> tuple[str, ...]:
        taken_in = claim.kind in BOUNDED and claim.outcome == "proved"
        return tuple(f"{WITHOUT}{name}" for name in (unbounded if taken_in else away))

    return tuple(replace(claim, assumptions=(*claim.assumptions, *more(claim))) for claim in claims)


def _called(fitted: Fitted) -> str:
    return f"{fitted.part.role} {fitted.called}"


def _is_read(fitted: Fitted) -> bool:
    return fitted.part.name in READ.get(fitted.part.role, ()) and fitted.part.file is None


def _says(loop: ClosedLoop, fitted: Fitted) -> bool:
    """Whether all that a part does to a loop has a bound."""
    return _torque(loop, fitted) is not None or _errors(fitted) is not None


def _torque(loop: ClosedLoop, fitted: Fitted) -> float | None:
    """The largest torque (N m) of a part, where it says one that holds."""
    tell: Any = fitted.part.hook("bound")
    acts = fitted.part.hook("torque" if fitted.part.role == "environment" else "reaction") is not None
    return float(tell(fitted.params)) if tell is not None and acts and _holds(loop, fitted.part) else None


def _errors(fitted: Fitted) -> Errors | None:
    """The largest errors of a part, where it says them and they are finite."""
    tell: Any = fitted.part.hook("error")
    found = None if tell is None else tell(fitted.params)
    return None if found is None or not all(map(isfinite, found)) else found


def _holds(loop: ClosedLoop, part: Part) -> bool:
    """Whether all of the orbit lies where the part's bound holds."""
    if part.about and body_of(loop.craft.gravity) != part.about:
        return False
    if not part.bound_from:
        return True
    # A little more, for floats tell how low the orbit comes.
    return lowest(loop.start.position, loop.start.velocity, loop.craft.gravity) >= part.bound_from * (1.0 + 1e-9)
