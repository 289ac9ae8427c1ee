"""A flight leaves what is claimed of its law where it meets an assumption no longer; claims are about motions from a set."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias, cast

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.quaternion import vector_part
from starhold.algebra.scalar import side
from starhold.algebra.vector import ZERO, add, apply, dot, subtract
from starhold.analysis.metrics import ALMOST, on_limit
from starhold.certification.certificate import WHEELS
from starhold.certification.mixed import Shape
from starhold.certification.openness import WITHOUT
from starhold.laws.interface import Measurement
from starhold.loop.kernels import make_step
from starhold.parts.bodies.rigid_body import kinetic_energy
from starhold.parts.craft import tensor
from starhold.parts.effectors.wheels import BAND, Wheels
from starhold.parts.quaternion_sign import SIGN_POLICIES

if TYPE_CHECKING:
    from starhold.certification.certificate import Certificate, Claim
    from starhold.loop.closed_loop import ClosedLoop
    from starhold.simulation.lane import Recording

Array: TypeAlias = NDArray[np.float64]
CHANGES = "what flies, or what the law knows of it, changes"
LOST = "the simulation loses the motion"
"""Which no proof speaks of: it is too fast for the integration, or farther away than a scenario follows it."""


HELD = "torque held between samples"
"""The assumption of a claim about a torque that is held."""
TURNED = "the torque is held while the body, or stored momentum, turns it by {:.2g} rad"


class Departure(NamedTuple):
    """From `time` (s) on a flight is not what a claim speaks of; `how` is a sentence without its end that says why."""

    time: float
    how: str


class Span:
    """A span is a recorded run between two control steps, and the loop that flies it."""

    def __init__(self, loop: ClosedLoop, run: Recording, first: int, last: int | None) -> None:
        every = run.attrs["record_every"]
        part = slice(-(-first // every), None if last is None else -(-last // every))
        self.loop, self.arrays = loop, {name: values[part] for name, values in run.arrays.items()}
        self.changes = None if last is None else last * loop.period

    def __getitem__(self, name: str) -> Array:
        return self.arrays[name]

    @property
    def begun(self) -> float:
        """Return the time of the first sample (s)."""
        return float(self["time"][0])

    @cached_property
    def shown(self) -> Measurement:
        """The measurements that the law is shown, but for noise and torque from outside: numbers are columns (n,)."""
        wheels = self.loop.wheels
        stored: Any = ZERO if wheels is None else tuple((self["wheel_momentum"] @ np.array(wheels.axes)).T)
        attitude: Any = tuple(fed_back(self.loop, self["attitude_error"]).T)
        rate, error_rate = (cast(Any, tuple(self[name].T)) for name in ("rate", "rate_error"))
        turning = subtract(rate, error_rate)
        return Measurement(attitude, error_rate, rate, turning, ZERO, ZERO, ZERO, self.loop.period, stored)

    def first(self, held: Any, how: str) -> list[Departure]:
        """Return a departure at the first sample at which something holds (n,)."""
        places = np.flatnonzero(held)
        return [Departure(float(self["time"][places[0]]), how)] if len(places) else []

    def always(self, how: str, holds: bool = True) -> list[Departure]:
        """Return a departure from the start on."""
        return [Departure(self.begun, how)] if holds else []


def departures(
    certificate: Certificate,
    loop: ClosedLoop,
    run: Recording,
    first: int = 0,
    last: int | None = None,
    change: str = CHANGES,
) -> dict[str, tuple[Departure, ...]]:
    """Tell for each proved kind of claim about motions how a run leaves it, in order of time; empty where it does not.

    loop: what the certificate speaks of, flown from control step `first` until it changes at `last` (None: it does not),
    as `change` tells.
    That torque is held between samples counts unless it is proved that it may be.
    """
    span = Span(loop, run, first, last)
    common = [] if span.changes is None else [Departure(span.changes, change)]
    if not len(span["time"]):
        return {claim.kind: tuple(common) for claim in _left(certificate) if common}
    held = {"refuted": "with which not even the linear loop is stable", "proved": ""}
    sampled = certificate.claim("sampling")
    why = held.get("" if sampled is None else sampled.outcome, "with which it is not shown to be stable")
    held_too_long = span.always(f"the torque is held for {loop.period:g} s, {why}", bool(why))
    # What is proved of held torque is proved of the linear loop at rest, without stored momentum.
    most = _turn_that_counts(loop, sampled)
    held_too_long += span.first(_turned(span) >= most, TURNED.format(most))
    if run.attrs.get("diverged_at") is not None:
        common.append(Departure(run.attrs["diverged_at"], LOST))
    found: dict[str, tuple[Departure, ...]] = {}
    for claim in _left(certificate):
        own = [one for assumed in claim.assumptions for one in _met(assumed, span)]
        own += [] if HELD in claim.assumptions else held_too_long
        found[claim.kind] = tuple(sorted({*common, *own, *_set(claim, span)}))
    return found


def _turned(span: Span) -> Array:
    """Return bounds (n,) of the angle (rad) by which a held torque turns beside the motion in a control period: the body
    turns, and stored momentum makes its rate turn."""
    stored = np.linalg.norm(np.broadcast_arrays(*span.shown.wheel_momentum, span["time"])[:3], axis=0)
    precession = stored / float(np.linalg.eigvalsh(tensor(span.loop.craft.inertia))[0])
    return (np.linalg.norm(span["rate"], axis=1) + precession) * span.loop.period


def _turn_that_counts(loop: ClosedLoop, sampled: Claim | None) -> float:
    """Return the angle (rad) from which on turning counts: one radian, and less where the period comes near the longest that
    is stable. A rate of turn phi in a period is damped while the period is below (phi/2)/tan(phi/2) of the longest; a tenth
    is left for what stiffness adds."""
    longest = None if sampled is None else sampled.numbers["longest"]
    share = 0.0 if longest is None else min(1.0, 1.1 * loop.period / longest)
    return min(1.0, 3.4 * math.sqrt(1.0 - share))


def _left(certificate: Certificate) -> list[Claim]:
    """Return the claims that a flight can leave: those about motions that are proved."""
    return [claim for claim in certificate.claims if claim.outcome == "proved" and claim.kind != "sampling"]


# --- assumptions ------------------------------------------------------------------------------------------------------


def _kept(span: Span) -> list[Departure]:
    return []


def _unlimited(span: Span) -> list[Departure]:
    bound = on_limit(span["command"], span.loop.craft.torque_limit, span.loop.limit)
    return span.first(bound, "the torque reaches its limit")


def _wheels_unlimited(span: Span) -> list[Departure]:
    wheels = cast(Wheels, span.loop.wheels)
    working = np.array(wheels.torque_limit) > 0.0
    torque, momentum = np.abs(span["wheel_torque"]), np.abs(span["wheel_momentum"])
    strong = (torque >= np.array(wheels.torque_limit) * ALMOST)[:, working].any(axis=1)
    full = (momentum > np.array(wheels.momentum_limit) * (1.0 - BAND))[:, working].any(axis=1)
    reached = [*span.first(strong, "a motor reaches its limit"), *span.first(full, "a wheel is full")]
    return [*_friction(span), *_unlimited(span), *reached]


def _friction(span: Span) -> list[Departure]:
    wheels = cast(Wheels, span.loop.wheels)
    return span.always("the wheels have friction", any((*wheels.viscous, *wheels.coulomb)))


def _absent(assumption: str, span: Span) -> list[Departure]:
    return span.always(f"{HAS}{assumption.removeprefix(WITHOUT)}")


def _cancelled(span: Span) -> list[Departure]:
    gravity = span.loop.has("gravity-gradient") and not cancels(span.loop)
    return span.always("the law does not cancel the gravity gradient", gravity)


def _alone(span: Span) -> list[Departure]:
    return span.always("the gravity gradient acts", span.loop.has("gravity-gradient"))


def _still(span: Span) -> list[Departure]:
    return span.always("the target turns", span.loop.target.part.name != "inertial")


def _met(assumption: str, span: Span) -> list[Departure]:
    return _absent(assumption, span) if assumption.startswith(WITHOUT) else MET[assumption](span)


HAS = "the loop has the "
"""Begins the words for a part that a claim leaves out, role and name."""
MET: Mapping[str, Callable[[Span], list[Departure]]] = {
    "rigid body": _kept,
    "inertia exactly as given": _kept,
    "inertia within the tolerance": _kept,
    "torque applied continuously": _kept,
    # What keeps measurement and actuators from being so is a part, which is left out by name.
    "exact measurement and ideal actuators": _kept,
    "torque not limited": _unlimited,
    WHEELS: _wheels_unlimited,
    "wheels without friction": _friction,
    # The claim's own number stands in no assumption; `_set` looks at it.
    "total momentum at most as told": _kept,
    "no torque from outside but what the law cancels": _cancelled,
    "no torque from outside": _alone,
    # So is what has no bound; the rest is within its own.
    "torques from outside and errors of the command no larger than told": _kept,
    HELD: _kept,
    "target's motion at most as told": _kept,
    "torque from outside bounded on each axis": _kept,
    "target at rest": _still,
}
"""For each assumption of a claim about motions how a flight departs from it. Those that are `_kept` a simulation meets, but
for what `departures` says of held torque and of changes."""


def cancels(loop: ClosedLoop) -> bool:
    """Tell whether the law takes the torque that the models know from what it commands: at the start, whatever that is."""
    loop = loop.without("sensor", "estimator")
    measurement = make_step(loop.composition()).measure(loop.carry(), 0, 0, loop.craft, loop.setup())
    memory = loop.law.remember(loop.gains, loop.craft, loop.period)
    more = 0.01 * loop.craft.torque_limit if math.isfinite(loop.craft.torque_limit) else 1.0
    # From rest on target, where clipped and switching laws are farthest from their limits.
    measurement = measurement._replace(attitude=(1.0, 0.0, 0.0, 0.0), rate=ZERO)
    torques = [
        np.array(loop.law.command(measurement._replace(external_torque=(x, x, x)), loop.gains, loop.craft, memory)[0])
        for x in (0.0, more)
    ]
    return bool(np.allclose(torques[0] - torques[1], more, rtol=1e-6))


# --- sets -------------------------------------------------------------------------------------------------------------


def _set(claim: Claim, span: Span) -> list[Departure]:
    """Tell whether a flight starts outside of the claim's set, and when it leaves that."""
    found = _away(claim, span)
    momentum = claim.numbers.get("momentum")
    if momentum is not None:
        total = momentum_of(span.loop, span.shown)
        found += span.first(total > momentum * (1.0 + 1e-9), "the total momentum is more than told")
    start, level = _levels(claim)
    value = None if start is None or level is None else value_of(claim, span.loop, span.shown)
    if value is None:
        return found
    if value[0] > start:
        return [*found, *span.always("it is outside the set")]
    # The integration lets V of a motion along the border rise by its own error.
    return [*found, *span.first(value > cast(float, level) * (1.0 + 1e-6), "it leaves the set")]


def _away(claim: Claim, span: Span) -> list[Departure]:
    """Tell when a flight that should have ended near its target is farther away."""
    settling = claim.numbers.get("settling")
    if settling is None:
        return []
    sine = np.linalg.norm(span["attitude_error"][:, 1:], axis=1)
    far = sine > math.sin(min(claim.numbers["angle"], math.pi) / 2.0) * (1.0 + 1e-6)
    return span.first(far & (span["time"] - span.begun > settling), "it is farther from the target than in the end")


def start_inside(certificate: Certificate, loop: ClosedLoop) -> dict[str, bool]:
    """Tell whether the loop's start lies in the sets of the proved claims that are about a level of V."""
    if loop.remembers:
        return {}
    # The true start, whatever the sensors make of it.
    loop, found = loop.without("sensor", "estimator"), dict[str, bool]()
    shown = shown_at(loop, loop.start)
    momentum = momentum_of(loop, shown)
    for claim in _left(certificate):
        if claim.kind == "region" or (loop.law.lyapunov is not None and "start" in claim.numbers):
            level, value = _levels(claim)[0], value_of(claim, loop, shown)
            inside = momentum <= claim.numbers.get("momentum", np.inf) and (level is None or value <= level)
            found[claim.kind] = bool(inside)
    return found


def shown_at(loop: ClosedLoop, state: Any) -> Measurement:
    """Return the measurement that the law is shown at a state as a flight begins; numbers may be columns (n,)."""
    carry = loop.carry()._replace(state=state)
    shown = make_step(loop.composition()).measure(carry, 0, 0, loop.craft, loop.setup())
    error = np.array(shown.attitude)
    attitude: Any = tuple(fed_back(loop, np.atleast_2d(error.T)).T.reshape(error.shape))
    return shown._replace(attitude=attitude)


def value_of(claim: Claim, loop: ClosedLoop, shown: Measurement) -> Any:
    """Return the claim's V at measurements; None where the law has none. Polynomials take whole columns at once."""
    function, stiffness = loop.law.lyapunov, claim.witness.get("stiffness")
    if claim.kind == "region":
        return Shape(**claim.witness).value(shown.attitude, shown.rate)
    if claim.kind == "sliding":
        return kinetic_energy(loop.law.module.surface(shown, loop.gains), loop.craft)
    mixed = claim.witness.get("epsilon", 0.0) * dot(vector_part(shown.attitude), apply(loop.craft.inertia, shown.rate))
    if stiffness is not None:
        return kinetic_energy(shown.rate, loop.craft) + 2.0 * stiffness * (1.0 - shown.attitude[0]) + mixed
    return None if function is None else function(shown, loop.gains, loop.craft) + mixed


def momentum_of(loop: ClosedLoop, shown: Measurement) -> Any:
    """Return the norm of the angular momentum of body and wheels (N m s)."""
    return np.linalg.norm(add(apply(loop.craft.inertia, shown.body_rate), shown.wheel_momentum), axis=0)


def _levels(claim: Claim) -> tuple[float | None, float | None]:
    """Return the most that V is at the start, and from then on; None for no bound."""
    start = claim.numbers.get("start", claim.numbers.get("level"))
    return start, claim.numbers.get("level", start)


def fed_back(loop: ClosedLoop, error: Array) -> Array:
    """Return the quaternions (n, 4) that the law is shown without noise, of the true errors (n, 4)."""
    if loop.sign_policy == "as_published":
        return error
    if loop.sign_policy == "shortest":
        return np.where(error[:, :1] < 0.0, -error, error)
    h, shown = side(float(error[0, 0])), np.empty(len(error))
    for place, q0 in enumerate(error[:, 0].tolist()):
        h = SIGN_POLICIES["hysteresis"]((q0, 0.0, 0.0, 0.0), h, loop.hysteresis_width)[1]
        shown[place] = h
    return error * shown[:, None]
