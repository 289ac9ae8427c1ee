"""Computes, from the parts of a loop, the unmodelled ones that each claim leaves out by name, and bounds of the others."""

from __future__ import annotations

from dataclasses import replace
from functools import reduce
from math import ceil, inf, isfinite
from typing import Any, NamedTuple

import numpy as np

from starhold.algebra.vector import norm
from starhold.certification.appendages import appendages, tells_momentum
from starhold.certification.certificate import LATE, ORBIT, STEADY, UNTIL, WITHOUT, Claim
from starhold.certification.directions import freshness, shown
from starhold.certification.mean_rates import evenness
from starhold.certification.measured import (
    Told,
    as_read,
    bounded,
    driven_errors,
    is_random,
    measured,
    noise_of,
    tells_place,
)
from starhold.certification.orbit_band import band_of, extremes, movers
from starhold.certification.target_motion import motion_of
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.contract import AT_REST, DEVIATIONS, NO_ERRORS, Envelope, Late, Push
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
COMMANDED = ("actuator", "effector")
"""Roles whose `error` affects the law's command."""
GROWING = (
    "error.attitude.per.rate",
    "error.attitude.per.acceleration",
    "error.rate.per.rate",
    "error.rate.per.acceleration",
    "error.ago",
    "error.kept",
)
"""The numbers of a claim about measurement errors that grow as the body moves."""
SETTLED = ("linear-estimate", "settled-estimate")
"""Assumptions of claims about an estimate."""
MORE, LARGER = 1.0 + 1e-12, 1.0 + 1e-6
"""A margin for the floating-point sum, and one for numbers that other machines may round otherwise."""


class Pushes(NamedTuple):
    """Bounds of the disturbances on a loop that its law does not know: the external torque (N m, and N m s times the body's
    rate), errors of the measured attitude (rad) and rate (rad/s), of the command (as the torque), and of the target's rate
    (rad/s) and acceleration (rad/s2); and the growth of measurement errors as the body moves, as in `Told`."""

    outside: float
    outside_per_rate: float = 0.0
    attitude: float = 0.0
    rate: float = 0.0
    command: float = 0.0
    command_per_rate: float = 0.0
    target_rate: float = 0.0
    target_acceleration: float = 0.0
    more: tuple[float, ...] = (0.0,) * len(GROWING)

    @property
    def numbers(self) -> dict[str, float]:
        """The numbers of a claim that state these bounds."""
        names = ("outside", "outside.per.rate", "error.attitude", "error.rate", "error", "error.per.rate")
        names = (*names, "error.target.rate", "error.target.acceleration", *GROWING)
        return dict(zip(names, (*self[:-1], *self.more), strict=True))

    @property
    def steady(self) -> Pushes:
        """The bounds without what grows as the body moves."""
        return self._replace(more=Pushes(0.0).more)


def envelope_of(loop: ClosedLoop, momentum: float, noisy: bool) -> Envelope:
    """Return a set that the motions of a loop do not leave while its momentum (N m s) is within a bound, which counts with
    wheels only, its orbit stays in its band, and no part that is left out by name moves it; with a margin, because the
    lowest point of the orbit is computed in floats. noisy: except for a share of the time."""
    start, share = loop.start, band_of(loop).share
    low, _, fast = extremes(loop) if loop.has("two-body") else (norm(start.position), inf, norm(start.velocity))
    moment = float(np.linalg.eigvalsh(tensor(loop.craft.inertia))[-1])
    field = sum(_field_error(fitted, loop.period, noisy) for fitted in loop.used("sensor"))
    low, fast = low * (1.0 - share) * (1.0 - 1e-9), fast * (1.0 + share) * (1.0 + 1e-9)
    return Envelope(low, fast, inf if loop.wheels is None else momentum, moment * MORE, field)


def pushes(loop: ClosedLoop, envelope: Envelope) -> Pushes:
    """Add up the bounds of the parts of a loop that declare them."""
    torques, errors = [Push(0.0)], [Push(0.0)]
    for fitted in _acting(loop):
        for pushed, push in zip((torques, errors), _pushes(fitted, envelope), strict=True):
            pushed += [] if push is None else [push]
    attitude, rate, *more = reduce(Told.__add__, [errors for _, errors in _told(loop)], Told())
    (torque, per_rate), (command, command_per_rate) = (
        [sum(x) for x in zip(*pushed, strict=True)] for pushed in (torques, errors)
    )
    motion = motion_of(loop) or AT_REST
    off = motion.off_rate, motion.off_acceleration
    sizes = (x * MORE for x in (torque, per_rate, attitude, rate, command, command_per_rate, *off))
    return Pushes(*sizes, more=tuple(x * MORE for x in more))


def _told(loop: ClosedLoop) -> list[tuple[tuple[Fitted, ...], Told]]:
    """Return the measurement errors besides noise, with the parts that they come from."""
    result = measured(loop)
    together = () if result is None else result.parts
    misread = [] if result is None else [(together, result.amiss)]
    for f in _acting(loop):
        # A part that is left out for its noise is left out with its other errors.
        errors = None if f in together else bounded(f, loop.period)
        misread += [] if errors is None or is_random(noise_of(f, loop.period), errors) else [((f,), as_read(errors))]
    return misread


def grows(loop: ClosedLoop) -> bool:
    """Whether measurement errors grow as the body moves."""
    return any(errors.grows for _, errors in _told(loop))


def late_torque(loop: ClosedLoop) -> Late | None:
    """Return how late the torque is, exactly and as flights integrate a lag, with a margin for rounding; None where no
    actuator declares it, or more than one lags."""
    actuators = _moving(loop)
    tell: Any = actuators[0].part.hook("late") if len(actuators) == 1 else None
    if tell is None:
        return None
    late: Late = tell(actuators[0].params, loop.period)
    most = late.most / LARGER
    if late.moment is None:
        return Late(late.kept * LARGER, late.mean * LARGER, most)
    exact = late.kept, late.mean, late.moment
    pairs = [*zip(exact, _in_steps(actuators[0].fastest, loop) or exact, strict=True)]
    kept, mean, moment = (max(pair) * LARGER for pair in pairs)
    return Late(kept, mean, most, moment, tuple(min(pair) / LARGER for pair in pairs))


def _in_steps(fastest: float, loop: ClosedLoop) -> tuple[float, ...]:
    """Return the effect of integrating a lag in steps of the fourth-order method: the share of an initial error that is left
    at the end of a period, in its mean, and in the mean weighted by the remaining time; empty without a rate at which it
    settles."""
    step, kept, mean, moment = 1.0 / loop.substeps, 1.0, 0.0, 0.0
    x = fastest * loop.period * step
    for _ in range(loop.substeps):
        moment += step * (mean + step * kept * (0.5 - x / 6.0 + x * x / 24.0))
        mean += step * kept * (1.0 - x / 2.0 + x * x / 6.0 - x**3 / 24.0)
        kept *= 1.0 - x + x * x / 2.0 - x**3 / 6.0 + x**4 / 24.0
    return (kept, mean, moment) if x else ()


def _moving(loop: ClosedLoop) -> list[Fitted]:
    """Return the actuators whose output moves between control instants."""
    return [fitted for fitted in loop.used("actuator") if fitted.part.hook("rates") is not None]


def environment_torques(loop: ClosedLoop, envelope: Envelope) -> tuple[Push, float]:
    """Add up the declared bounds of the environments' torques that laws do not know: of those in any direction, and of those
    at right angles to the magnetic field (N m)."""
    torques = [(f, push) for f in loop.used("environment") if (push := _pushes(f, envelope)[0]) is not None]
    across = [push.torque for f, push in torques if f.part.flag("ACROSS_FIELD")]
    others = [Push(0.0), *(push for f, push in torques if not f.part.flag("ACROSS_FIELD"))]
    return Push(*(sum(x) * MORE for x in zip(*others, strict=True))), sum(across) * MORE


def change_of_modelled(loop: ClosedLoop, envelope: Envelope) -> Push:
    """Add up the largest rates of change of the torques that laws know at their measured attitude: `inf` for a part that
    does not declare it, or if a measured position could be in error."""
    parts = [f for f in loop.used("environment") if f.part.flag("MODELLED")]
    tells: list[Any] = [f.part.hook("torque_change") for f in parts]
    telling = (*loop.used("sensor"), *loop.used("estimator"))
    if None in tells or any(tells_place(f) for f in telling):
        return Push(inf, inf)
    declared = [Push(0.0), *(tell(f.params, loop.craft, envelope) for tell, f in zip(tells, parts, strict=True))]
    return Push(*(sum(x) * MORE for x in zip(*declared, strict=True)))


def samples_of(loop: ClosedLoop) -> int:
    """Return the control steps of an orbit, or of an hour where there is none."""
    start = loop.start
    orbit = period_of(start.position, start.velocity, loop.craft.gravity) if loop.has("two-body") else SPAN
    # With a margin, because the period is computed in floats; it grows with the power 3/2 of the distance.
    return ceil((orbit if isfinite(orbit) else SPAN) / loop.period * (1.0 + 1e-9) * (1.0 + 3.0 * band_of(loop).share))


def assumed_away(loop: ClosedLoop) -> list[str]:
    """Return the parts of a loop that only claims of the kinds `BOUNDED` include, as role and name."""
    return [_called(f) for f in _acting(loop) if not is_read(loop, f)]


def named(claims: list[Claim], loop: ClosedLoop, momentum: float = inf) -> tuple[Claim, ...]:
    """Return the claims with an assumption for each part that they leave out."""
    away, driven, misread = assumed_away(loop), driven_errors(loop), _told(loop)

    def more(claim: Claim) -> tuple[str, ...]:
        if claim.kind == DETUMBLING and claim.outcome == "proved":
            envelope = envelope_of(loop, momentum, False)
            return tuple(f"{WITHOUT}{_called(f)}" for f in _acting(loop) if not _is_in_detumbling(f, envelope, loop.period))
        if claim.kind not in BOUNDED or claim.outcome != "proved":
            return tuple(f"{WITHOUT}{name}" for name in away)
        noisy = driven.parts if driven is not None and claim.numbers["share"] else ()
        envelope = envelope_of(loop, momentum, bool(noisy))
        moved = appendages(loop) if claim.kind == "appendages" else ()
        # Noise may not be all that an environment does.
        shaking = [f for f in noisy if f.part.role != "environment" or _says(loop, f, envelope, noisy=True)]
        there = (*shaking, *moved, *(_moving(loop) if claim.numbers.get("late_torque") else ()))
        grown = "told_growth" in claim.numbers
        # Parts whose errors grow are left out unless the claim includes the growth, and noisy ones unless it includes noise.
        left = [f for parts, one in misread if one.grows and not grown for f in parts]
        left += [] if driven is None or noisy else driven.parts
        telling = [f for parts, _ in misread for f in parts if f not in left]
        there = [f for f in (*there, *telling) if f not in left]
        others = [f for f in _acting(loop) if not (is_read(loop, f) or f in there)]
        absent = [f for f in others if not (_says(loop, f, envelope) and _gives(loop, f, envelope, claim))]
        estimated = any(f in telling for f in loop.used("estimator"))
        settled = [name for name in SETTLED if estimated and name not in claim.assumptions]
        settled += (freshness(loop) + evenness(loop, claim.numbers.get("angle"))) if estimated else []
        share = band_of(loop).share
        behind = [f"{LATE}{claim.numbers['late_torque']!r}"] if claim.numbers.get("late_torque") else []
        names = (f"{WITHOUT}{_called(f)}" for f in absent)
        return (*names, *([f"{ORBIT}{share:.3g}"] if share else []), *behind, *settled)

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
    # Without an estimator, the sensors' readings of the state take its place.
    read |= set() if loop.used("estimator") else {*loop.start._fields}
    return tuple(f for f in parts if f.part.role != "sensor" or shown(f) & read or not shown(f) & watched)


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


def _says(loop: ClosedLoop, fitted: Fitted, envelope: Envelope, noisy: bool = False) -> bool:
    """Whether everything that a part does to a loop, besides what the law measures, has a bound. noisy: the claim includes
    its noise, which is all that it does if it declares no bound."""
    part, banded = fitted.part, fitted in movers(loop) and bool(band_of(loop).share)
    if moves(fitted.params) or (_always_moves(fitted) and not banded):
        # No claim follows an orbit that such a force changes.
        return False
    if banded and not part.hook("torque"):
        return True
    torque, error = (push is not None for push in _pushes(fitted, envelope))
    if part.role == "effector":
        # Besides its command, an effector reacts as its momentum turns with the body. No bound covers its inertia, or the
        # use that a law makes of its momentum.
        sized = torque and part.hook("inertia") is None
        return sized and (not part.flag("ACTS") or (error and not tells_momentum(loop, fitted)))
    return _is_idle(loop, fitted, envelope) or torque or error or (noisy and part.hook("bound") is None)


def _gives(loop: ClosedLoop, fitted: Fitted, envelope: Envelope, claim: Claim) -> bool:
    """Whether a part surely gives every torque that its loop asks it for under a claim."""
    tell: Any = fitted.part.hook("sure_torque")
    if tell is None:
        return True
    kept = claim.proof is not None and not {"limit", "limit.norm"}.isdisjoint(claim.proof.claim["numbers"])
    largest = loop.craft.torque_limit if kept else inf
    for f in loop.used("actuator"):
        # What an actuator adds to the command counts, too.
        added = _pushes(f, envelope)[1] or Push(0.0)
        largest += inf if added.per_rate else added.torque
    return tell(fitted.prepared(loop.period), "norm" if loop.limit == "norm" else "axis") >= largest


def _always_moves(fitted: Fitted) -> bool:
    """Return whether a part moves the orbit, whatever its parameters are."""
    return fitted.part.hook("acceleration") is not None and not hasattr(fitted.params, "moves_orbit")


def _is_in_detumbling(fitted: Fitted, envelope: Envelope, period: float) -> bool:
    """Whether a claim about detumbling includes a part: what it is about, environments with a bound, and everything that the
    law does not read."""
    part = fitted.part
    if part.role == "sensor" and "magnetic_field" in shown(fitted):
        return bounded(fitted, period) == NO_ERRORS and not is_random(noise_of(fitted, period))
    if part.role == "environment":
        still = not (moves(fitted.params) or _always_moves(fitted) or noise_of(fitted, period).torque)
        return _is_modelled(part) or (_pushes(fitted, envelope)[0] is not None and still)
    return part.role in ("sensor", "estimator", "target") or part.name in ("magnetorquers", "inactive-wheels")


def _pushes(fitted: Fitted, envelope: Envelope) -> tuple[Push | None, Push | None]:
    """Read the declared bounds of a part's torque and of its error of the command; for a part that could be left out only
    finite ones."""
    part = fitted.part
    acts = part.hook("torque" if part.role == "environment" else "reaction") is not None
    # The claim's numbers bound the torques that laws know, and are about the gravity gradient alone.
    acts = acts and (_is_modelled(part) or not part.flag("MODELLED"))
    tells: list[Any] = [part.hook("bound") if acts else None, part.hook("error") if part.role in COMMANDED else None]
    declared = [None if tell is None else tell(fitted.params, envelope) for tell in tells]
    torque, error = (push if push is None or _is_modelled(part) or all(map(isfinite, push)) else None for push in declared)
    return torque, error


def _field_error(fitted: Fitted, period: float, noisy: bool) -> float:
    """Return the largest error (T) of a measured magnetic field; its noise is bounded except for a share of times."""
    if "magnetic_field" not in shown(fitted):
        return 0.0
    error, deviation = bounded(fitted, period), noise_of(fitted, period).field
    return inf if error is None or (deviation and not noisy) else error.field + DEVIATIONS * deviation


def gaussian_vectors(loop: ClosedLoop) -> int:
    """Return how many Gaussian vectors count in bounds at a reading, as of a magnetic field measured with noise."""
    result = measured(loop)
    fields = sum(bool(noise_of(fitted, loop.period).field) for fitted in loop.used("sensor"))
    return fields + (0 if result is None else result.gaussian)


def _is_idle(loop: ClosedLoop, fitted: Fitted, envelope: Envelope) -> bool:
    """Return whether all readers of a sensor are parts whose torque is bounded for any reading."""
    if fitted.part.role != "sensor" or shown(fitted) & {*loop.start._fields, *loop.law.reads}:
        return False
    readers = [f for f in _acting(loop) if shown(fitted) & {*f.part.reads, *f.needs}]
    return all(f.part.role == "effector" and _pushes(f, envelope)[0] is not None for f in readers)
