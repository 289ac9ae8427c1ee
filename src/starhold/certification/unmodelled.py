"""Computes, from the parts of a loop, the unmodelled ones that each claim leaves out by name, and bounds of the others."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from math import ceil, hypot, inf, isfinite
from typing import Any, NamedTuple

import numpy as np

from starhold.algebra.quaternion import NO_TURN
from starhold.algebra.structure import leaves
from starhold.algebra.vector import Vector, apply, norm, scale
from starhold.certification.appendages import appendages
from starhold.certification.certificate import LATE, ORBIT, STEADY, UNTIL, WITHOUT, Claim
from starhold.certification.orbit_band import band_of, extremes, movers
from starhold.certification.target_motion import motion_of
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.contract import AT_REST, DEVIATIONS, NO_ERRORS, Envelope, Errors, Late, Noise, Push, Recursion
from starhold.parts.craft import tensor
from starhold.parts.orbit import period_of
from starhold.parts.part import Fitted, Part
from starhold.parts.pushes import moves

READ = {
    "environment": ("two-body", "gravity-gradient", "linear-gravity", "three-body-gravity"),
    "effector": ("wheels",),
    "target": ("history",),
}
"""The parts that theorems model, by role, beside targets that bound their motion; a claim's other assumptions describe their
torques and motions."""
BOUNDED = ("pointing", "appendages")
"""Kinds of claims that include external torques and errors by their bounds."""
DETUMBLING = "detumbling"
"""The kind of claims about a law that opposes the change of the magnetic field."""
SPAN = 3600.0
"""The time (s) covered by a claim with a share where there is no orbit."""
TELLING, COMMANDED = ("sensor", "estimator"), ("actuator", "effector")
"""Roles whose `error` affects the law's measurements, and its command."""
MORE, LARGER = 1.0 + 1e-12, 1.0 + 1e-6
"""A margin for the floating-point sum, and one for how a flight follows a lag in steps of at most a tenth of it."""


class Pushes(NamedTuple):
    """Bounds of what acts on a loop and is told to no law: the torque from outside (N m, and N m s times the body's rate),
    errors of the attitude (rad) and the rate (rad/s) that the law is told, of the command (as the torque), and of the
    target's rate (rad/s) and acceleration (rad/s2)."""

    outside: float
    outside_per_rate: float = 0.0
    attitude: float = 0.0
    rate: float = 0.0
    command: float = 0.0
    command_per_rate: float = 0.0
    target_rate: float = 0.0
    target_acceleration: float = 0.0

    @property
    def numbers(self) -> dict[str, float]:
        """The numbers of a claim that they are."""
        names = ("outside", "outside.per.rate", "error.attitude", "error.rate", "error", "error.per.rate")
        return dict(zip((*names, "error.target.rate", "error.target.acceleration"), self, strict=True))


class Driven(NamedTuple):
    """Noise-driven errors, the parts with the noise, and the parts with the errors; the deviation of a random torque about
    each axis (N m)."""

    recursion: Recursion
    parts: tuple[Fitted, ...]
    torque: float = 0.0


def envelope_of(loop: ClosedLoop, momentum: float, noisy: bool) -> Envelope:
    """Tell what the motions of a loop do not leave while its momentum (N m s) is no more than told, its orbit stays in its
    band, and no part that is left out by name moves it. A little more, for floats tell how low the orbit comes. noisy: but
    for a share of times."""
    start, share = loop.start, band_of(loop).share
    low, _, fast = extremes(loop) if loop.has("two-body") else (norm(start.position), inf, norm(start.velocity))
    moment = float(np.linalg.eigvalsh(tensor(loop.craft.inertia))[-1])
    field = sum(_field_error(fitted, loop.period, noisy) for fitted in loop.used("sensor"))
    low, fast = low * (1.0 - share) * (1.0 - 1e-9), fast * (1.0 + share) * (1.0 + 1e-9)
    return Envelope(low, fast, momentum, moment * MORE, field)


def pushes(loop: ClosedLoop, envelope: Envelope) -> Pushes:
    """Add up the bounds of the parts of a loop that declare them."""
    torques, errors = [Push(0.0)], [Push(0.0)]
    for fitted in _acting(loop):
        for pushed, push in zip((torques, errors), _pushes(fitted, envelope), strict=True):
            pushed += [] if push is None else [push]
    driven = driven_errors(loop)
    estimated = _estimated(loop, driven)

    def counts(fitted: Fitted) -> bool:
        # A part that is left out for its noise is left out with its other errors.
        noisy = driven is not None and fitted in driven.parts
        return fitted not in estimated and (noisy or not _is_random(_noise(fitted, loop.period)))

    bounds = [NO_ERRORS, *(bound for f in _acting(loop) if (bound := _bounded(f)) is not None and counts(f))]
    attitude, rate, *_ = (sum(sizes) for sizes in zip(*bounds, strict=True))
    (torque, per_rate), (command, command_per_rate) = (
        [sum(x) for x in zip(*pushed, strict=True)] for pushed in (torques, errors)
    )
    motion = motion_of(loop) or AT_REST
    off = motion.off_rate, motion.off_acceleration
    return Pushes(*(x * MORE for x in (torque, per_rate, attitude, rate, command, command_per_rate, *off)))


def late_torque(loop: ClosedLoop) -> Late | None:
    """Return how late the torque is, with a margin for rounding; None where no actuator tells, or more than one is late."""
    actuators = _moving(loop)
    tell: Any = actuators[0].part.hook("late") if len(actuators) == 1 else None
    if tell is None:
        return None
    late: Late = tell(actuators[0].params, loop.period)
    moment = None if late.moment is None else late.moment * LARGER
    return Late(late.kept * LARGER, late.mean * LARGER, late.most / LARGER, moment)


def _moving(loop: ClosedLoop) -> list[Fitted]:
    """Return the actuators whose output moves between control instants."""
    return [fitted for fitted in loop.used("actuator") if fitted.part.hook("rates") is not None]


def environment_torques(loop: ClosedLoop, envelope: Envelope) -> tuple[Push, float]:
    """Add up the declared bounds of the environments' torques that no law is told: of those in any direction, and of those
    at right angles to the magnetic field (N m)."""
    torques = [(f, push) for f in loop.used("environment") if (push := _pushes(f, envelope)[0]) is not None]
    across = [push.torque for f, push in torques if f.part.flag("ACROSS_FIELD")]
    others = [Push(0.0), *(push for f, push in torques if not f.part.flag("ACROSS_FIELD"))]
    return Push(*(sum(x) * MORE for x in zip(*others, strict=True))), sum(across) * MORE


def change_of_modelled(loop: ClosedLoop, envelope: Envelope) -> Push:
    """Add up how fast the torques change at most that laws are told as they are at the attitude that these are told: `inf`
    for a part that does not say, or if a position is told that could be off."""
    parts = [f for f in loop.used("environment") if f.part.flag("MODELLED")]
    tells: list[Any] = [f.part.hook("torque_change") for f in parts]
    telling = [*(_shown(f) for f in loop.used("sensor")), *(f.part.module.Estimate._fields for f in loop.used("estimator"))]
    if None in tells or any("position" in names for names in telling):
        return Push(inf, inf)
    declared = [Push(0.0), *(tell(f.params, loop.craft, envelope) for tell, f in zip(tells, parts, strict=True))]
    return Push(*(sum(x) * MORE for x in zip(*declared, strict=True)))


def driven_errors(loop: ClosedLoop) -> Driven | None:
    """Return what noise drives in a loop: errors of what its law is told, which are none where its parts do not say them,
    and random torques from outside. None without either, and where the target depends on the law's mode."""
    if loop.target.part.flag("BY_MODE"):
        return None
    driven = _told_errors(loop)
    torques = [fitted for fitted in loop.used("environment") if _noise(fitted, loop.period).torque]
    if driven is None and torques:
        driven = Driven(_as_read(Noise()), ())
    if driven is None:
        return None
    return driven._replace(
        parts=(*driven.parts, *torques), torque=hypot(*(_noise(fitted, loop.period).torque for fitted in torques))
    )


def _told_errors(loop: ClosedLoop) -> Driven | None:
    """Return the noise-driven errors of an estimate, or of readings that the law uses directly; None without noise, where
    parts do not fully declare it, where an estimator leaves other errors in, and where sensors of one quantity are not read
    together.
    """
    estimators = loop.used("estimator")
    wanted = {name for f in estimators for name in f.needs} or {"attitude", "rate"}
    sensors = tuple(f for f in loop.used("sensor") if wanted & _shown(f))
    declared = all(f.part.hook("noise") is not None and _is_removed(_bounded(f), bool(estimators)) for f in sensors)
    if not sensors or not declared:
        return None
    noise = Noise()
    several = getattr(estimators[0].part.module, "SEVERAL", ()) if estimators else ()
    attitudes, rates = ([_noise(f, loop.period) for f in sensors if name in _shown(f)] for name in ("attitude", "rate"))
    if len(rates) > 1 or (
        len(attitudes) > 1 and ("attitude" not in several or len({reading.every for reading in attitudes}) > 1)
    ):
        return None
    for reading in attitudes[:1]:
        noise = noise._replace(
            attitude=reading.attitude, every=reading.every, more=tuple(other.attitude for other in attitudes[1:])
        )
    for reading in rates:
        noise = noise._replace(rate=reading.rate, walk=reading.walk)
    if estimators:
        tell: Any = estimators[0].part.hook("recursion")
        recursion = None if tell is None else tell(estimators[0].params, noise, loop.period, _rate(loop))
    else:
        as_it_is = noise.walk or noise.every > 1 or not _is_random(noise)
        recursion = None if as_it_is else _as_read(noise)
    return None if recursion is None else Driven(recursion, (*sensors, *estimators))


def samples_of(loop: ClosedLoop) -> int:
    """Return the control steps of an orbit, or of an hour where there is none."""
    start = loop.start
    orbit = period_of(start.position, start.velocity, loop.craft.gravity) if loop.has("two-body") else SPAN
    # A little more, for floats tell the period; it goes with the power 3/2 of the distance.
    return ceil((orbit if isfinite(orbit) else SPAN) / loop.period * (1.0 + 1e-9) * (1.0 + 3.0 * band_of(loop).share))


def assumed_away(loop: ClosedLoop) -> list[str]:
    """Return the parts of a loop that only claims of the kinds `BOUNDED` include, as role and name."""
    return [_called(f) for f in _acting(loop) if not is_read(loop, f)]


def named(claims: list[Claim], loop: ClosedLoop, momentum: float = inf) -> tuple[Claim, ...]:
    """Return the claims with an assumption for each part that they leave out."""
    away, driven = assumed_away(loop), driven_errors(loop)
    estimated = _estimated(loop, driven)

    def more(claim: Claim) -> tuple[str, ...]:
        if claim.kind == DETUMBLING and claim.outcome == "proved":
            envelope = envelope_of(loop, momentum, False)
            return tuple(f"{WITHOUT}{_called(f)}" for f in _acting(loop) if not _is_in_detumbling(f, envelope, loop.period))
        if claim.kind not in BOUNDED or claim.outcome != "proved":
            return tuple(f"{WITHOUT}{name}" for name in away)
        noisy = driven.parts if driven is not None and claim.numbers["share"] else ()
        envelope = envelope_of(loop, momentum, bool(noisy))
        moved = appendages(loop) if claim.kind == "appendages" else ()
        there = (*noisy, *moved, *(_moving(loop) if claim.numbers.get("late_torque") else ()))
        absent = [
            f for f in _acting(loop) if not (is_read(loop, f) or f in there or _says(loop, f, envelope, f in estimated))
        ]
        share = band_of(loop).share
        behind = [f"{LATE}{claim.numbers['late_torque']!r}"] if claim.numbers.get("late_torque") else []
        return (*(f"{WITHOUT}{_called(f)}" for f in absent), *([f"{ORBIT}{share:.3g}"] if share else []), *behind)

    target = motion_of(loop) or AT_REST
    moved = [STEADY] * target.jumps + [f"{UNTIL}{target.until:.6g}"] * isfinite(target.until)

    def all_of(claim: Claim) -> tuple[str, ...]:
        return (*claim.assumptions, *more(claim), *(moved if claim.kind != DETUMBLING else ()))

    return tuple(replace(claim, assumptions=all_of(claim)) for claim in claims)


def _acting(loop: ClosedLoop) -> tuple[Fitted, ...]:
    """Return the parts of a loop without the estimators that only watch, and without the sensors that these alone read."""
    parts = loop.as_commanded().parts
    watched = {name for f in loop.parts if f not in parts for name in f.needs}
    read = {*loop.law.reads, *(name for f in parts for name in (*f.part.reads, *f.needs))}
    # Without an estimator what sensors tell of the state takes its place.
    read |= set() if loop.used("estimator") else {*loop.start._fields}
    return tuple(f for f in parts if f.part.role != "sensor" or _shown(f) & read or not _shown(f) & watched)


def _called(fitted: Fitted) -> str:
    return f"{fitted.part.role} {fitted.called}"


def is_read(loop: ClosedLoop, fitted: Fitted) -> bool:
    """Whether theorems model a part of a loop: by its name, or its target by bounds of its motion."""
    part = fitted.part
    if part.role == "target" and part.hook("motion") is not None:
        return motion_of(loop) is not None
    return _is_modelled(part)


def _is_modelled(part: Part) -> bool:
    return part.name in READ.get(part.role, ()) and part.file is None


def _says(loop: ClosedLoop, fitted: Fitted, envelope: Envelope, estimated: bool) -> bool:
    """Whether all that a part does to a loop has a bound. estimated: an estimator takes its errors out."""
    part, banded = fitted.part, fitted in movers(loop) and bool(band_of(loop).share)
    always = part.hook("acceleration") is not None and not hasattr(fitted.params, "moves_orbit")
    if moves(fitted.params) or (always and not banded):
        # No claim follows an orbit that such a force changes.
        return False
    if banded and not part.hook("torque"):
        return True
    torque, error = (push is not None for push in _pushes(fitted, envelope))
    if part.role == "effector":
        # Beside the command an effector reacts as its momentum turns with the body.
        return torque and (error or not part.flag("ACTS"))
    if _is_idle(loop, fitted, envelope) or torque or error:
        return True
    return not estimated and _bounded(fitted) is not None and not _is_random(_noise(fitted, loop.period))


def _is_in_detumbling(fitted: Fitted, envelope: Envelope, period: float) -> bool:
    """Whether a claim about detumbling includes a part: what it is about, environments with a bound, and all that the law
    does not look at."""
    part = fitted.part
    if part.role == "sensor" and "magnetic_field" in _shown(fitted):
        return _bounded(fitted) == NO_ERRORS and not _is_random(_noise(fitted, period))
    if part.role == "environment":
        return _is_modelled(part) or (_pushes(fitted, envelope)[0] is not None and not moves(fitted.params))
    return part.role in ("sensor", "estimator", "target") or part.name in ("magnetorquers", "inactive-wheels")


def _pushes(fitted: Fitted, envelope: Envelope) -> tuple[Push | None, Push | None]:
    """Read the declared bounds of a part's torque and of its error of the command; for a part that could be left out only
    finite ones.
    """
    part = fitted.part
    acts = part.hook("torque" if part.role == "environment" else "reaction") is not None
    # A torque that laws are told is bounded by the claim's numbers, which are about the gravity gradient alone.
    acts = acts and (_is_modelled(part) or not part.flag("MODELLED"))
    tells: list[Any] = [part.hook("bound") if acts else None, part.hook("error") if part.role in COMMANDED else None]
    declared = [None if tell is None else tell(fitted.params, envelope) for tell in tells]
    torque, error = (push if push is None or _is_modelled(part) or all(map(isfinite, push)) else None for push in declared)
    return torque, error


def _estimated(loop: ClosedLoop, driven: Driven | None) -> Collection[Fitted]:
    """Return the parts whose errors other than noise do not count, because an estimator removes them."""
    return driven.parts if driven is not None and loop.used("estimator") else ()


def _bounded(fitted: Fitted) -> Errors | None:
    """Read the declared largest errors of a part besides its noise, where they are finite."""
    tell: Any = fitted.part.hook("error") if fitted.part.role in TELLING else None
    largest = NO_ERRORS if tell is None else tell(fitted.params)
    return None if tell is None or not all(map(isfinite, largest)) else largest


def _is_removed(errors: Errors | None, estimated: bool) -> bool:
    """Return whether bounded errors besides noise do not reach the law: an estimator removes a bias of the rate alone. What
    it makes of a tracker that is mounted askew, or of a reading in steps, no part states."""
    return errors is not None and (not estimated or (errors.attitude == 0.0 and errors.rate == errors.bias))


def _field_error(fitted: Fitted, period: float, noisy: bool) -> float:
    """Return the largest error (T) of a measured magnetic field; its noise is bounded except for a share of times."""
    if "magnetic_field" not in _shown(fitted):
        return 0.0
    error, deviation = _bounded(fitted), _noise(fitted, period).field
    return inf if error is None or (deviation and not noisy) else error.field + DEVIATIONS * deviation


def noisy_fields(loop: ClosedLoop) -> int:
    """Return how many sensors measure the magnetic field with noise."""
    return sum(bool(_noise(fitted, loop.period).field) for fitted in loop.used("sensor"))


def _noise(fitted: Fitted, period: float) -> Noise:
    """Return the noise of a part, by default none."""
    tell: Any = fitted.part.hook("noise")
    return Noise() if tell is None else tell(fitted.params, period)


def _is_random(noise: Noise) -> bool:
    """Return whether a reading differs from the present value by an unbounded error."""
    return any(leaves(noise._replace(every=noise.every - 1)))


def _as_read(noise: Noise) -> Recursion:
    """Return the errors of readings that the law uses directly, without a random-walk bias and held attitudes, which are
    unbounded."""

    def read(errors: tuple[Vector, ...], random: tuple[Vector, ...]) -> tuple[tuple[Vector, ...], Vector, Vector]:
        misread = apply(noise.attitude, random[2]), scale(noise.rate, random[0])
        return misread, *misread

    return Recursion(read, read, 1, 2)


def _rate(loop: ClosedLoop) -> Vector:
    """Return the rate (rad/s) of a body on target as the loop starts, to six digits, on which all machines agree."""
    target = loop.target
    rate: Any = target.part.module.goal(target.prepared(loop.period), loop.start, 0, NO_TURN).rate
    x, y, z = (float(f"{part:.6g}") for part in rate)
    return x, y, z


def _shown(sensor: Fitted) -> set[str]:
    """Return the names of a sensor's readings."""
    return set(sensor.part.module.Reading._fields)


def _is_idle(loop: ClosedLoop, fitted: Fitted, envelope: Envelope) -> bool:
    """Return whether all readers of a sensor are parts whose torque is bounded for any reading."""
    if fitted.part.role != "sensor" or _shown(fitted) & {*loop.start._fields, *loop.law.reads}:
        return False
    readers = [f for f in _acting(loop) if _shown(fitted) & {*f.part.reads, *f.needs}]
    return all(f.part.role == "effector" and _pushes(f, envelope)[0] is not None for f in readers)
