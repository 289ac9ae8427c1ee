"""Each claim leaves out by name the parts of its loop that it is not about: the list is computed from what the loop has."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from math import ceil, isfinite
from typing import Any, NamedTuple

from starhold.algebra.quaternion import NO_TURN
from starhold.algebra.structure import leaves
from starhold.algebra.vector import Vector, apply, scale
from starhold.certification.assumptions import WITHOUT
from starhold.certification.certificate import Claim
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.contract import NO_ERRORS, Errors, Noise, Recursion
from starhold.parts.orbit import body_of, lowest, period_of
from starhold.parts.part import Fitted, Part

READ = {
    "environment": ("two-body", "gravity-gradient", "linear-gravity", "three-body-gravity"),
    "effector": ("wheels",),
    "target": ("inertial", "orbital", "history"),
}
"""The parts that theorems take in, by role; what a claim takes of their torques and motions its other assumptions say."""
BOUNDED = ("pointing",)
"""Kinds of claims that take in torques from outside and errors by their bounds."""
SPAN = 3600.0
"""Of how much time (s) a claim has a share without an orbit."""


class Pushes(NamedTuple):
    """Bounds of what acts on a loop and is told to no law: the torque from outside (N m), and errors of the attitude (rad)
    and the rate (rad/s) that the law is told, and of the command (N m)."""

    outside: float
    attitude: float = 0.0
    rate: float = 0.0
    command: float = 0.0


class Driven(NamedTuple):
    """Errors that noise drives, and the parts whose noise it is, and whose errors."""

    recursion: Recursion
    parts: tuple[Fitted, ...]


def pushes(loop: ClosedLoop) -> Pushes:
    """Bounds of what the parts of a loop that say theirs do together."""
    torques, errors = list[float](), [NO_ERRORS]
    for fitted in loop.parts:
        if (torque := _torque(loop, fitted)) is not None:
            torques.append(torque)
        if (error := _errors(loop, fitted)) is not None:
            errors.append(error)
    # A little more, for floats are added.
    return Pushes(*(sum(own) * (1.0 + 1e-12) for own in (torques, *zip(*errors, strict=True))))


def driven_errors(loop: ClosedLoop) -> Driven | None:
    """The errors that noise drives, of an estimate, or of readings that the law is told as they are; None without noise,
    where parts do not say all about it, and where the target depends on the law's mode."""
    estimators = loop.used("estimator")
    wanted = {name for f in estimators for name in f.part.needs} or {"attitude", "rate"}
    sensors = tuple(f for f in loop.used("sensor") if wanted & _shown(f))
    told = all(f.part.hook("noise") is not None and _bounded(f) is not None for f in sensors)
    if not sensors or not told or loop.target.part.flag("BY_MODE"):
        return None
    noise = Noise()
    for f in sensors:
        own = _noise(f, loop.period)
        noise = noise._replace(attitude=own.attitude, every=own.every) if "attitude" in _shown(f) else noise
        noise = noise._replace(rate=own.rate, walk=own.walk) if "rate" in _shown(f) else noise
    if estimators:
        tell: Any = estimators[0].part.hook("recursion")
        recursion = None if tell is None else tell(estimators[0].params, noise, loop.period, _rate(loop))
    else:
        recursion = _as_read(noise) if _is_random(noise) else None
    return None if recursion is None else Driven(recursion, (*sensors, *estimators))


def samples_of(loop: ClosedLoop) -> int:
    """Control steps of an orbit, or of an hour where there is none."""
    start = loop.start
    orbit = period_of(start.position, start.velocity, loop.craft.gravity) if loop.has("two-body") else SPAN
    # A little more, for floats tell the period.
    return ceil((orbit if isfinite(orbit) else SPAN) / loop.period * (1.0 + 1e-9))


def assumed_away(loop: ClosedLoop) -> list[str]:
    """The parts of a loop that no claim but those of the kinds `BOUNDED` is about, as role and name."""
    return [_called(f) for f in loop.parts if not _is_read(f)]


def named(claims: list[Claim], loop: ClosedLoop) -> tuple[Claim, ...]:
    """The claims with an assumption for each part that they are not about."""
    away, driven = assumed_away(loop), driven_errors(loop)

    def more(claim: Claim) -> tuple[str, ...]:
        if claim.kind not in BOUNDED or claim.outcome != "proved":
            return tuple(f"{WITHOUT}{name}" for name in away)
        noisy = driven.parts if driven is not None and claim.numbers["share"] else ()
        return tuple(f"{WITHOUT}{_called(f)}" for f in loop.parts if not (_is_read(f) or _says(loop, f, noisy)))

    return tuple(replace(claim, assumptions=(*claim.assumptions, *more(claim))) for claim in claims)


def _called(fitted: Fitted) -> str:
    return f"{fitted.part.role} {fitted.called}"


def _is_read(fitted: Fitted) -> bool:
    return fitted.part.name in READ.get(fitted.part.role, ()) and fitted.part.file is None


def _says(loop: ClosedLoop, fitted: Fitted, noisy: Collection[Fitted]) -> bool:
    """Whether all that a part does to a loop has a bound. noisy: parts whose noise is taken in."""
    if fitted in noisy or _is_idle(loop, fitted) or _torque(loop, fitted) is not None:
        return True
    return _errors(loop, fitted) is not None and not _is_random(_noise(fitted, loop.period))


def _torque(loop: ClosedLoop, fitted: Fitted) -> float | None:
    """The largest torque (N m) of a part, where it says one that holds."""
    tell: Any = fitted.part.hook("bound")
    acts = fitted.part.hook("torque" if fitted.part.role == "environment" else "reaction") is not None
    return float(tell(fitted.params)) if tell is not None and acts and _holds(loop, fitted.part) else None


def _errors(loop: ClosedLoop, fitted: Fitted) -> Errors | None:
    """The largest errors of a part beside its noise, where it says them and they are finite; those of a sensor do not count
    where an estimator takes them out."""
    if loop.used("estimator") and (driven := driven_errors(loop)) is not None and fitted in driven.parts:
        return None
    return _bounded(fitted)


def _bounded(fitted: Fitted) -> Errors | None:
    tell: Any = fitted.part.hook("error")
    found = NO_ERRORS if tell is None else tell(fitted.params)
    return None if tell is None or not all(map(isfinite, found)) else found


def _noise(fitted: Fitted, period: float) -> Noise:
    """The noise of a part; one that does not tell any has none."""
    tell: Any = fitted.part.hook("noise")
    return Noise() if tell is None else tell(fitted.params, period)


def _is_random(noise: Noise) -> bool:
    """Whether a reading is not what it is at that time but for what is bounded."""
    return any(leaves(noise._replace(every=noise.every - 1)))


def _as_read(noise: Noise) -> Recursion | None:
    """Errors of readings that the law is told as they are; a bias that walks, and an attitude that is held, go anywhere."""
    if noise.walk or noise.every > 1:
        return None

    def read(errors: tuple[Vector, ...], random: tuple[Vector, ...]) -> tuple[tuple[Vector, ...], Vector, Vector]:
        told = apply(noise.attitude, random[2]), scale(noise.rate, random[0])
        return told, *told

    return Recursion(read, read, 1, 2)


def _rate(loop: ClosedLoop) -> Vector:
    """The rate (rad/s) at which a body turns on target as the loop starts, to six digits, which all machines agree on."""
    target = loop.target
    rate: Any = target.part.module.goal(target.prepared(loop.period), loop.start, 0, NO_TURN).rate
    x, y, z = (float(f"{part:.6g}") for part in rate)
    return x, y, z


def _shown(sensor: Fitted) -> set[str]:
    """The names of what a sensor shows."""
    return set(sensor.part.module.Reading._fields)


def _is_idle(loop: ClosedLoop, fitted: Fitted) -> bool:
    """Whether a sensor shows nothing but what is read by parts whose torque has a bound, whatever they are shown."""
    if fitted.part.role != "sensor" or _shown(fitted) & {*loop.start._fields, *loop.law.reads}:
        return False
    readers = [f for f in loop.parts if _shown(fitted) & {*f.part.reads, *f.part.needs}]
    return all(f.part.role == "effector" and _torque(loop, f) is not None for f in readers)


def _holds(loop: ClosedLoop, part: Part) -> bool:
    """Whether all of the orbit lies where the part's bound holds."""
    if part.about and body_of(loop.craft.gravity) != part.about:
        return False
    if not part.bound_from:
        return True
    # A little more, for floats tell how low the orbit comes.
    return lowest(loop.start.position, loop.start.velocity, loop.craft.gravity) >= part.bound_from * (1.0 + 1e-9)
