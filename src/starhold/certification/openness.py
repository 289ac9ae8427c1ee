"""Each claim leaves out by name the parts of its loop that it is not about: the list is computed from what the loop has."""

from __future__ import annotations

from dataclasses import replace
from math import isfinite
from typing import Any, NamedTuple

import numpy as np

from starhold.algebra.vector import norm
from starhold.certification.assumptions import WITHOUT
from starhold.certification.certificate import Claim
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.contract import NO_ERRORS, Envelope, Errors, Push
from starhold.parts.craft import tensor
from starhold.parts.orbit import highest_speed, lowest
from starhold.parts.part import Fitted

READ = {
    "environment": ("two-body", "gravity-gradient", "linear-gravity", "three-body-gravity"),
    "effector": ("wheels",),
    "target": ("inertial", "orbital", "history"),
}
"""The parts that theorems take in, by role; what a claim takes of their torques and motions its other assumptions say."""
BOUNDED = ("pointing",)
"""Kinds of claims that take in torques from outside and errors by their bounds."""
TELLING, COMMANDED = ("sensor", "estimator"), ("actuator", "effector")
"""Roles whose `error` is of what the law is told, and of its command."""
MORE = 1.0 + 1e-12
"""A little more, for floats are added."""


class Pushes(NamedTuple):
    """Bounds of what acts on a loop and is told to no law: the torque from outside (N m, and N m s times the body's rate),
    errors of the attitude (rad) and the rate (rad/s) that the law is told, and of the command (as the torque)."""

    outside: float
    outside_per_rate: float = 0.0
    attitude: float = 0.0
    rate: float = 0.0
    command: float = 0.0
    command_per_rate: float = 0.0

    @property
    def numbers(self) -> dict[str, float]:
        """The numbers of a claim that they are."""
        names = ("outside", "outside.per.rate", "error.attitude", "error.rate", "error", "error.per.rate")
        return dict(zip(names, self, strict=True))


def envelope_of(loop: ClosedLoop, momentum: float) -> Envelope:
    """Tell what the motions of a loop do not leave while its momentum (N m s) is no more than told, and no part that is left
    out by name moves the orbit. A little more, for floats tell how low the orbit comes."""
    begun, gravity = (loop.start.position, loop.start.velocity), loop.craft.gravity
    low, fast = (find(*begun, gravity) for find in (lowest, highest_speed)) if loop.has("two-body") else map(norm, begun)
    moment = float(np.linalg.eigvalsh(tensor(loop.craft.inertia))[-1])
    found = [error.field for fitted in loop.used("sensor") if (error := _errors(fitted)) is not None]
    return Envelope(low * (1.0 - 1e-9), fast * (1.0 + 1e-9), momentum, moment * MORE, sum(found))


def pushes(loop: ClosedLoop, envelope: Envelope) -> Pushes:
    """Add up the bounds of what the parts of a loop that say theirs do."""
    torques, errors = [Push(0.0)], [Push(0.0)]
    for fitted in loop.parts:
        for told, found in zip((torques, errors), _pushes(fitted, envelope), strict=True):
            told += [] if found is None else [found]
    told = [NO_ERRORS, *(found for fitted in loop.parts if (found := _errors(fitted)) is not None)]
    attitude, rate, _ = (sum(own) for own in zip(*told, strict=True))
    (torque, per_rate), (command, command_per_rate) = ([sum(x) for x in zip(*own, strict=True)] for own in (torques, errors))
    return Pushes(*(x * MORE for x in (torque, per_rate, attitude, rate, command, command_per_rate)))


def assumed_away(loop: ClosedLoop) -> list[str]:
    """The parts of a loop that no claim but those of the kinds `BOUNDED` is about, as role and name."""
    return [_called(f) for f in loop.parts if not _is_read(f)]


def named(claims: list[Claim], loop: ClosedLoop, envelope: Envelope | None = None) -> tuple[Claim, ...]:
    """The claims with an assumption for each part that they are not about."""
    away = assumed_away(loop)
    unbounded = [_called(f) for f in loop.parts if not (_is_read(f) or (envelope is not None and _says(f, envelope)))]

    def more(claim: Claim) -> tuple[str, ...]:
        taken_in = claim.kind in BOUNDED and claim.outcome == "proved"
        return tuple(f"{WITHOUT}{name}" for name in (unbounded if taken_in else away))

    return tuple(replace(claim, assumptions=(*claim.assumptions, *more(claim))) for claim in claims)


def _called(fitted: Fitted) -> str:
    return f"{fitted.part.role} {fitted.called}"


def _is_read(fitted: Fitted) -> bool:
    return fitted.part.name in READ.get(fitted.part.role, ()) and fitted.part.file is None


def _says(fitted: Fitted, envelope: Envelope) -> bool:
    """Whether all that a part does to a loop has a bound."""
    return any(found is not None for found in (*_pushes(fitted, envelope), _errors(fitted)))


def _pushes(fitted: Fitted, envelope: Envelope) -> tuple[Push | None, Push | None]:
    """Read bounds of a part's torque and of its error of the command, where it says them; of one that could be left out
    by name only finite ones."""
    part = fitted.part
    acts = part.hook("torque" if part.role == "environment" else "reaction") is not None
    tells: list[Any] = [part.hook("bound") if acts else None, part.hook("error") if part.role in COMMANDED else None]
    found = [None if tell is None else tell(fitted.params, envelope) for tell in tells]
    torque, error = (push if push is None or _is_read(fitted) or all(map(isfinite, push)) else None for push in found)
    return torque, error


def _errors(fitted: Fitted) -> Errors | None:
    """The largest errors of what a part tells the law, where it says them and they are finite."""
    tell: Any = fitted.part.hook("error") if fitted.part.role in TELLING else None
    found = None if tell is None else tell(fitted.params)
    return None if found is None or not all(map(isfinite, found)) else found
