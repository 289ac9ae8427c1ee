"""Finds when a flight leaves the claims about its law: when it no longer meets an assumption, or its motion is outside the
set of a claim."""

import math
from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import Any, NamedTuple, TypeAlias, cast

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.scalar import side
from starhold.algebra.vector import ZERO, add, apply, norm, subtract
from starhold.analysis.meter import ALMOST, on_limit
from starhold.analysis.misreadings import misreadings
from starhold.certification.appendages import recorded_states, start_of
from starhold.certification.assumptions import LINEAR, assumption
from starhold.certification.certificate import Certificate, Claim
from starhold.certification.unmodelled import BOUNDED
from starhold.laws.interface import Measurement
from starhold.loop.closed_loop import ClosedLoop
from starhold.loop.kernels import make_step
from starhold.parts.bodies.rigid_body import kinetic_energy
from starhold.parts.craft import tensor
from starhold.parts.quaternion_sign import SIGN_POLICIES
from starhold.simulation.lane import Recording
from starhold.trace.straight_line import evaluated

Array: TypeAlias = NDArray[np.float64]
CHANGES = "the loop, or the law's model of it, changes"
HELD = {"held-torque", "held-field"}
"""Assumptions of claims about a torque that is held between samples."""
RESTARTS = 64
"""From how many instants at most a flight is looked at for whether a claim covers it."""
LOST = "the motion diverges"
"""The reason when the motion is too fast for the integration, or beyond the divergence bound, which no proof covers."""
TURNED = "the torque is held while the body, or stored momentum, turns it by {:.2g} rad"


class Departure(NamedTuple):
    """The time (s) from which on a claim does not cover a flight; `how` is the reason, a sentence without its full stop."""

    time: float
    how: str


class Span:
    """A recorded run between two control steps, and its loop; unit: its unit of time (s)."""

    def __init__(self, loop: ClosedLoop, run: Recording, first: int = 0, last: int | None = None, unit: float = 1.0) -> None:
        every, self.unit = run.attrs["record_every"], unit
        part = slice(-(-first // every), None if last is None else -(-last // every))
        self.loop, self.arrays = loop, {name: values[part] for name, values in run.arrays.items()}
        self.changes = None if last is None else last * loop.period

    def __getitem__(self, name: str) -> Array:
        return self.arrays[name]

    @property
    def begun(self) -> float:
        """Return the time of the first sample (s)."""
        return float(self["time"][0]) * self.unit

    @cached_property
    def shown(self) -> Measurement:
        """Return the law's measurements without noise and external torque; numbers are columns (n,)."""
        wheels = self.loop.wheels
        stored: Any = ZERO if wheels is None else tuple((self["wheel_momentum"] @ np.array(wheels.axes)).T)
        attitude: Any = tuple(fed_back(self.loop, self["attitude_error"]).T)
        rate, error_rate = (cast(Any, tuple(self[name].T)) for name in ("rate", "rate_error"))
        turning = subtract(rate, error_rate)
        return Measurement(attitude, error_rate, rate, turning, ZERO, ZERO, ZERO, self.loop.period, stored)

    def on_limit(self, command: Array) -> Any:
        """Return a mask (n,) of the samples at which a command, or a part of it (n, components), is saturated."""
        return on_limit(command, self.loop.saturation_limit(), self.loop.limit)

    def reaches(self, values: Array, limits: Array) -> Any:
        """Return a mask of the values that have reached their limits."""
        return values >= limits * ALMOST

    def first(self, where: Any, how: str) -> list[Departure]:
        """Return a departure at the first sample at which a condition (n,) holds; a single boolean refers to the first
        sample."""
        places = np.flatnonzero(where)
        return [Departure(float(self["time"][places[0]]) * self.unit, how)] if len(places) else []

    def unmet(self, claim: Claim) -> list[Departure]:
        """Return a departure for every assumption of a claim that the flight does not meet."""
        return [one for where, how in self._tested(claim) for one in self.first(where, how)]

    def unmet_throughout(self, claim: Claim) -> list[str]:
        """Return how the loop does not meet a claim's assumptions, whatever its motion."""
        return [how for where, how in self._tested(claim) if not np.ndim(where) and where]

    def _tested(self, claim: Claim) -> Iterator[tuple[Any, str]]:
        """Return where a claim's assumptions are not met, and how."""
        tests = (unmet for name in claim.assumptions if (unmet := assumption(name).unmet) is not None)
        return (pair for unmet in tests for pair in unmet(self))


def departures(
    certificate: Certificate,
    loop: ClosedLoop,
    run: Recording,
    first: int = 0,
    last: int | None = None,
    change: str = CHANGES,
) -> dict[str, tuple[Departure, ...]]:
    """Return for each kind of proved claim about motions its departures in a run, in order of time; empty if there are none.
    loop: the certificate's loop, flown from control step `first` until it changes at `last` (None: never), for the reason
    `change`. Torque held between samples counts as a departure unless a proof allows it."""
    span = Span(loop, run, first, last)
    common = [] if span.changes is None else [Departure(span.changes, change)]
    if not len(span["time"]):
        return {claim.kind: tuple(common) for claim in _left(certificate) if common}
    reasons = {"refuted": "so long that even the linear loop is unstable", "proved": ""}
    sampled = certificate.claim("sampling")
    why = reasons.get("" if sampled is None else sampled.outcome, "for which stability is not proved")
    held_too_long = span.first(bool(why), f"the torque is held for {loop.period:g} s, {why}")
    # Proofs for held torque cover the linear loop at rest, without stored momentum.
    most = _turn_that_counts(loop, sampled)
    held_too_long += span.first(_turned(span) >= most, TURNED.format(most))
    if run.attrs.get("diverged_at") is not None:
        common.append(Departure(run.attrs["diverged_at"], LOST))
    by_kind: dict[str, tuple[Departure, ...]] = {}
    for claim in _left(certificate):
        programs = claim.programs
        paced = held_too_long if HELD.isdisjoint(claim.assumptions) else []
        by_kind[claim.kind] = tuple(sorted({*common, *paced, *span.unmet(claim), *_set(claim, programs, span)}))
    return by_kind


def _turned(span: Span) -> Array:
    """Return bounds (n,) on the angle (rad) by which a held torque lags the motion in a control period: the body rotates,
    and stored momentum rotates its rate."""
    stored = np.linalg.norm(np.broadcast_arrays(*span.shown.wheel_momentum, span["time"])[:3], axis=0)
    precession = stored / float(np.linalg.eigvalsh(tensor(span.loop.craft.inertia))[0])
    return (np.linalg.norm(span["rate"], axis=1) + precession) * span.loop.period


def _turn_that_counts(loop: ClosedLoop, sampled: Claim | None) -> float:
    """Return the angle (rad) from which on this rotation matters: one radian, and less if the period is near the longest
    stable one. A rate that turns by phi in a period is damped while the period is below (phi/2)/tan(phi/2) of the longest;
    a tenth is reserved for the effect of stiffness."""
    longest = None if sampled is None else sampled.numbers["longest"]
    share = 0.0 if longest is None else min(1.0, 1.1 * loop.period / longest)
    return min(1.0, 3.4 * math.sqrt(1.0 - share))


def _left(certificate: Certificate) -> list[Claim]:
    """Return the claims that a flight can leave: proved ones, except those about the linear motion."""
    return [claim for claim in certificate.claims if claim.outcome == "proved" and LINEAR not in claim.assumptions]


# --- sets -------------------------------------------------------------------------------------------------------------


def _set(claim: Claim, programs: Mapping[str, Any], span: Span) -> list[Departure]:
    """Return the departures of a flight that starts outside the claim's set, or leaves it."""
    left = [*_away(claim, span), *_misled(claim, span), *_swinging(claim, span), *_unplanned(claim, programs, span)]
    momentum = claim.numbers.get("momentum")
    if momentum is not None:
        total = momentum_of(span.loop, span.shown)
        left += span.first(total > momentum * (1.0 + 1e-9), "the total momentum exceeds the stated bound")
    if "rates" in claim.numbers:
        turned = np.linalg.norm(span["rate"], axis=1) > claim.numbers["rates"][0]
        left += span.first(turned, "it turns faster than the claim covers")
    # V is at most `start` at the start, and at most `level` from then on; None for no bound.
    start = claim.numbers.get("start")
    level = claim.numbers.get("level", start)
    value = None if start is None or level is None else height_of(claim, span.loop, span.shown)
    if value is None:
        return left
    if value[0] > start:
        return [*left, *span.first(True, "it is outside the set")]
    # Integration errors may increase V of a motion along the border.
    return [*left, *span.first(value > cast(float, level) * (1.0 + 1e-6), "it leaves the set")]


def _away(claim: Claim, span: Span) -> list[Departure]:
    """Return the departure of a flight that exceeds the ultimate bound of a claim."""
    settling = claim.numbers.get("settling")
    if settling is None:
        return []
    sine = np.linalg.norm(span["attitude_error"][:, 1:], axis=1)
    far = sine > math.sin(min(claim.numbers["angle"], math.pi) / 2.0) * (1.0 + 1e-6)
    return span.first(far & (span["time"] - span.begun > settling), "it is outside the ultimate bound")


def _swinging(claim: Claim, span: Span) -> list[Departure]:
    """Return the departures of a flight that starts with appendages moving more than the claim covers."""
    if "begun" not in claim.numbers:
        return []
    states = recorded_states(span.loop, span.arrays)
    if states is None:
        return span.first(True, "the motion of its appendages is not recorded")
    far = bool((np.abs(states[0]) > claim.numbers["begun"]).any())
    return span.first(far, "its appendages move more than the claim covers")


def _unplanned(claim: Claim, programs: Mapping[str, Any], span: Span) -> list[Departure]:
    """Return the departures at which the command differs from that of the best plan by more than is claimed, if the law
    gets the recorded state and the target is at rest."""
    loop, off = span.loop, claim.numbers.get("plan_error")
    if off is None or loop.used("sensor") or loop.used("estimator") or loop.target.part.name != "inertial":
        return []
    planned = np.broadcast_arrays(*evaluated(programs["law"], measurement=span.shown, craft=loop.known), span["time"])[:3]
    far = np.linalg.norm(span["command"] - np.transpose(planned), axis=1)
    return span.first(far > off * (1.0 + 1e-6), "the command is not that of the best plan")


def _misled(claim: Claim, span: Span) -> list[Departure]:
    """Return the departures at which the law is told more wrongly than is claimed."""
    how = "the estimation error exceeds the stated bound"
    return [one for far in misreadings(claim, span.loop, span) for one in span.first(far, how)]


def covered(
    certificate: Certificate, loop: ClosedLoop, run: Recording, first: int = 0, last: int | None = None
) -> tuple[float, float] | None:
    """Return the times (s) between which the claim about the loop as it flies covers a run: from when the estimate has
    settled and the motion is in the set. None if it is not proved, or never covers the run. loop, first, last: as in
    `departures`."""
    claim, span = certificate.claim("pointing"), Span(loop, run, first, last)
    if claim is None or claim.outcome != "proved":
        return None
    # From each begin on what the body did before counts no more as its motion, but as an error of what is told.
    for _ in range(RESTARTS):
        if not len(span["time"]):
            return None
        wrong = [np.flatnonzero(far) for far in misreadings(claim, loop, span)]
        settled = max((int(far[-1]) + 1 for far in wrong if len(far)), default=0)
        begins = settled + np.flatnonzero(height_of(claim, loop, span.shown)[settled:] <= claim.numbers["start"])
        if not len(begins):
            return None
        begin = float(span["time"][begins[0]])
        if not begins[0]:
            left = departures(certificate, loop, run, round(begin / loop.period), last).get("pointing", ())
            end = min((one.time for one in left), default=float(run["time"][-1]))
            return (begin, end) if end > begin else None
        span = Span(loop, run, round(begin / loop.period), last)
    return None


def start_inside(certificate: Certificate, loop: ClosedLoop) -> dict[str, bool]:
    """Return whether the loop starts in the sets of the proved claims about a level of V."""
    # The true initial state, not the measured one, but the command that flies.
    off = first_off(loop)
    loop, inside = loop.without("sensor", "estimator"), dict[str, bool]()
    shown = shown_at(loop, loop.start)
    momentum = momentum_of(loop, shown)
    for claim in _left(certificate):
        value = height_of(claim, loop, shown)
        if value is not None and "start" in claim.numbers:
            level = claim.numbers["start"]
            within = momentum <= claim.numbers.get("momentum", np.inf) and (level is None or value <= level)
            within = within and off <= claim.numbers.get("late_torque", np.inf)
            if "begun" in claim.numbers:
                within = within and bool((np.abs(start_of(loop)) <= claim.numbers["begun"]).all())
            inside[claim.kind] = bool(within)
    return inside


def first_off(loop: ClosedLoop) -> float:
    """Return how far the torque that acts as a flight starts is from its first command (N m)."""
    carry, step = loop.carry(), make_step(loop.composition())
    first = step.update(carry, 0, (loop.seed, loop.run), loop.gains, loop.known, loop.setup())
    return norm(subtract(carry.state.torque, first.command))


def measured_at(loop: ClosedLoop, state: Any) -> Any:
    """Return the measurement at an initial state of a flight, before the sign policy; numbers may be columns (n,)."""
    carry = loop.carry()._replace(state=state)
    return make_step(loop.composition()).measure(carry, 0, 0, loop.craft, loop.setup())


def shown_at(loop: ClosedLoop, state: Any) -> Measurement:
    """Return the law's measurement at an initial state of a flight; numbers may be columns (n,)."""
    shown = measured_at(loop, state)
    error = np.array(shown.attitude)
    attitude: Any = tuple(fed_back(loop, np.atleast_2d(error.T)).T.reshape(error.shape))
    return shown._replace(attitude=attitude)


def height_of(claim: Claim, loop: ClosedLoop, shown: Measurement) -> Any:
    """Return V of a claim at measurements as `value_of` does. Where the level holds the other quaternion of the target too,
    the set of a claim about the loop as it flies is its part with q0 > 0, and V is infinite outside of that, but for a law
    that is the same at both; so it is beyond the bounds of the set's rate and torque."""
    value = value_of(claim.programs, loop, shown)
    if value is None or claim.kind not in BOUNDED:
        return value
    value = np.where(beyond(claim, loop, shown), np.inf, value)
    if loop.law.card.quaternion_sign == "even":
        return value
    other = value_of(claim.programs, loop, shown._replace(attitude=(-1.0, *ZERO), rate=ZERO))
    return np.where((np.asarray(shown.attitude[0]) > 0.0) | (other > claim.numbers["start"]), value, np.inf)


def beyond(claim: Claim, loop: ClosedLoop, shown: Measurement) -> Any:
    """Return where the body turns faster, or the law asks for more because of the state and the wheels' momentum, than in
    the set of a claim."""
    n = claim.numbers
    far = 2.0 * kinetic_energy(shown.rate, loop.craft) > n.get("kinetic", np.inf)
    if "asked_torque" not in n and "asked_motors" not in n:
        return far
    # As if the target were at rest, with the same total momentum.
    stored = add(shown.wheel_momentum, apply(loop.craft.inertia, subtract(shown.body_rate, shown.rate)))
    alone = Measurement(shown.attitude, shown.rate, shown.rate, ZERO, ZERO, ZERO, ZERO, loop.period, stored)
    command = np.array(evaluated(claim.programs["law"], measurement=alone, craft=loop.known, gains=loop.gains))
    far |= (np.abs(command) > n.get("asked_torque", np.inf)).any(axis=0)
    if "asked_motors" in n and loop.wheels is not None:
        limits = np.array([np.inf if x is None else x for x in n["asked_motors"]])
        driven = np.array(loop.wheels.axes)[limits > 0.0]
        far |= (limits[limits > 0.0] < np.abs(np.linalg.pinv(driven.T) @ command).T).T.any(axis=0)
    return far


def value_of(programs: Mapping[str, Any], loop: ClosedLoop, shown: Measurement) -> Any:
    """Return V at measurements, whose numbers may be columns, minus V at rest on target; s.Js/2 for a law with a surface s.
    None without either."""
    if "surface" in programs:
        s: Any = tuple(evaluated(programs["surface"], measurement=shown, gains=loop.gains))
        return kinetic_energy(s, loop.craft)
    if "lyapunov" not in programs:
        return None
    J: Any = tuple(map(tuple, tensor(loop.craft.inertia).tolist()))
    craft, rest = loop.craft._replace(inertia=J), shown._replace(attitude=(1.0, *ZERO), rate=ZERO)
    (value,), (least,) = (
        evaluated(programs["lyapunov"], measurement=x, gains=loop.gains, craft=craft) for x in (shown, rest)
    )
    return value - least


def momentum_of(loop: ClosedLoop, shown: Measurement) -> Any:
    """Return the norm of the angular momentum of body and wheels (N m s)."""
    return np.linalg.norm(add(apply(loop.craft.inertia, shown.body_rate), shown.wheel_momentum), axis=0)


def fed_back(loop: ClosedLoop, error: Array) -> Array:
    """Return the quaternions (n, 4) that the law feeds back without noise, from the true errors (n, 4)."""
    if loop.sign_policy == "as_published":
        return error
    if loop.sign_policy == "shortest":
        return np.where(error[:, :1] < 0.0, -error, error)
    h, shown = side(float(error[0, 0])), np.empty(len(error))
    for place, q0 in enumerate(error[:, 0].tolist()):
        h = SIGN_POLICIES["hysteresis"]((q0, 0.0, 0.0, 0.0), h, loop.hysteresis_width)[1]
        shown[place] = h
    return error * shown[:, None]
