"""Brackets by the claim about a loop as it flies: for each flight it is found when it meets the claim's premises, and from
then on the claim bounds it. Of a law of modes each claim is about the flights that end in its mode, from when that began.

A flight has them from the start where it starts in the claim's set, or from a window of time on in which its angles and
rates are in that set, the law is told no more wrongly than the claim assumes, and the momentum is within its bound: so a
flight is covered once its estimate has settled, or once it comes from outside. With a lag the torque that acts must then be
as near to the command as the claim assumes. It must be a flight of the claim's own loop, in all numbers but the start."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.structure import unflatten
from starhold.analysis.departure import height_of, momentum_of, shown_at, start_inside
from starhold.analysis.meter import Meter, Metrics, tail_start
from starhold.analysis.premise_notes import PREMISES
from starhold.campaign.job import Job
from starhold.campaign.lanes import Lot
from starhold.campaign.results import ByClaim, Within
from starhold.campaign.worst import Sought
from starhold.certification.certificate import Claim
from starhold.certification.comparison import differences
from starhold.certification.unmodelled import named
from starhold.certification.wording import enumerated, sentence
from starhold.kernel.numbers import rational
from starhold.loop.closed_loop import ClosedLoop, is_recorded
from starhold.loop.modes import loop_of_mode
from starhold.scenario.building import build
from starhold.simulation.lanes import ThreadPool
from starhold.studies.body import Issued, study_of

Array = NDArray[np.float64]
Notice = Callable[..., None]
MOST, BLOCK = 20_000, 512
"""The largest number of runs of a campaign that are compared with a claim, and the number of runs in a block."""
APART = 1_000
"""The largest number of runs that are compared if each run has a loop of its own."""
SLACK = 1e-6
"""The share of a bound by which the integration may take a flight beyond it, or beyond a premise."""
NEARLY = 0.9
"""The bound of the final angle is the least that holds for this share of the flights that have one by the last quarter."""
START = ("state.attitude", "state.rate", "memories.", "h")
"""Numbers that a claim does not depend on but through the start begin with these."""
OUTSIDE, OTHER, MOVED = "do not come into its set", "fly another loop", "have more momentum, as certify.momentum may state"
ELSEWHERE, NEARER = "end in another mode", "are bounded by a narrower claim"
"""Why flights are not covered."""


class Looked(NamedTuple):
    """This is found of flights (lanes,): whether they end in the claim's mode; from which control step on they are in
    the claim's set with an estimate that has settled, -1 for never; whether their momentum is within its bound from then
    on; whether the law is told more wrongly than is assumed; whether they fly the claim's loop; and their metrics from
    then on."""

    there: NDArray[np.bool_]
    begun: Array
    kept: NDArray[np.bool_]
    misled: NDArray[np.bool_]
    alike: NDArray[np.bool_]
    values: dict[str, Array]


class Subject(NamedTuple):
    """A claim about a law's loop as it flies, and the number of control steps of a flight."""

    claim: Claim
    issued: Issued
    steps: int

    @property
    def loop(self) -> ClosedLoop:
        """The loop that the claim is about."""
        return self.issued.loop

    @property
    def is_watched(self) -> bool:
        """Whether all that the law is told is recorded."""
        return bool(self.loop.used("estimator")) or all(is_recorded(one.part) for one in self.loop.used("sensor"))

    def holds(self, shown: Mapping[str, Array]) -> NDArray[np.bool_]:
        """Return in which windows of flights the attitudes and rates, by the largest values, are in the claim's set, which
        holds attitudes up to an angle at up to a rate, of that quaternion of each that has q0 > 0."""
        n, loop = self.claim.numbers, self.loop
        inside = (shown["attitude_error"] <= n["slew_angle"]) & (shown["rate_error"] <= max(n["rate_start"] or 0.0, 0.0))
        if loop.law.card.quaternion_sign == "even" or loop.sign_policy == "shortest":
            return inside
        kept = loop.sign_policy == "as_published" or math.cos(n["slew_angle"] / 2.0) > loop.hysteresis_width
        return inside & (shown["other_quaternion"] <= 0.0) & kept


class Last(NamedTuple):
    """The mode, counted from 1, in which flights (lanes,) end, and the control step at which it began; 0 without modes."""

    mode: Array
    begun: Array

    @staticmethod
    def of(shown: Mapping[str, Array], ended: Array, period: float) -> Last:
        """Read them from the windows (windows, lanes) of flights that end, or diverge, at control steps (lanes,)."""
        none = np.zeros(shown["torque"].shape[1])
        if "mode" not in shown:
            return Last(none, none)
        modes, lanes = np.rint(shown["mode"]), np.arange(len(none))
        place = len(modes) - 1 - (modes[::-1] > 0.0).argmax(axis=0)
        return Last(modes[place, lanes], ended - np.rint(shown["time_in_mode"][place, lanes] / period))


def look(job: Job, law: str, threads: int, notice: Notice | None = None) -> tuple[ByClaim, ...]:
    """Compare what is proved of a law, or of each of its modes, with the flights of its campaign, which are flown once more.
    notice: called with the law and how many more are flown, and what for."""
    watching = Job(job.source, job.table, extras=(PREMISES,))
    lanes = watching.lanes(law)
    names = {lanes.base.names[place] if place >= 0 else "" for places in lanes.moved.values() for place in places}
    alike = all(name.startswith(START) for name in names)
    runs = min(job.table.runs, MOST if alike else APART)
    tell = partial(notice or (lambda law, more, sought: None), law, sought=Sought("proof", runs))
    tell(0)
    subjects, lacking = _subjects(job, law)
    if not subjects and None in lacking:
        tell(runs)
        return (ByClaim(*lacking[None]),)
    meter, seen = watching.meter(law), [list[Looked]() for _ in subjects]
    modes = list[Array]()
    with ThreadPool(threads) as pool:
        for first in range(0, runs, BLOCK):
            count = min(BLOCK, runs - first)
            columns, numbers = watching.plan.columns(first, count), np.arange(first, first + count)
            loops = partial(_loops, watching, law)
            take = partial(_take, subjects, meter, seen, modes, None if alike else loops)
            watching.measure(law, columns, numbers, pool, take)()
            tell(count)
    ended = np.concatenate(modes)
    counts = ((why, int((ended == mode).sum())) for mode, why in lacking.items())
    others = (ByClaim(name, f"{why}; {count} of {runs} flights end in this mode") for (name, why), count in counts if count)
    return (*_judged(subjects, seen), *others)


def _subjects(job: Job, law: str) -> tuple[list[Subject], dict[int | None, tuple[str, str]]]:
    """Return the claims about the loop that a law, or a mode of it, has at the end of a flight, and for each mode without
    such a claim, or None for all of the law, the name of its certificate and why there is none."""
    scenario, study = job.scenario, study_of(job.scenario.body)
    if scenario.supposed is not None:
        return [], {None: (law, "the law's nominal model is not the craft that flies")}
    entry = scenario.pick(law)
    loop, steps = build(scenario, entry), scenario.table.simulation.steps
    subjects, lacking = list[Subject](), dict[int | None, tuple[str, str]]()
    for one in reversed(study.certify(scenario, entry, loop, pointing=True)):
        claim, lacks = one.certificate.claim("pointing"), ""
        if subjects and one.mode is None:
            break
        if claim is None or claim.outcome != "proved":
            lacks = one.certificate.unflown or "no claim is about the loop as it flies"
        elif claim.left_out:
            lacks = f"the claim leaves out {enumerated(claim.left_out)}"
        elif condition := claim.limited_to(steps * loop.period):
            lacks = f"the claim holds only if {condition}"
        elif (change := study.ends(one, loop, steps * loop.period)) is not None:
            lacks = f"the claim ends with what changes at {change * loop.period:g} s"
        elif one.loop.craft.inertia != loop.craft.inertia:
            lacks = "the momentum of flights is noted with the inertia of their start"
        else:
            subjects.insert(0, Subject(claim, one, steps))
        if lacks and one.before is None:
            lacking[one.mode] = one.certificate.name, lacks
    proved = {one.issued.mode for one in subjects}
    return subjects, {mode: why for mode, why in reversed(lacking.items()) if mode not in proved}


def _loops(job: Job, law: str, lot: Lot) -> Iterator[ClosedLoop]:
    """Yield the loop of each run of a lot, from its own scenario."""
    lanes = job.lanes(law)
    return (lanes.exact(job.plan.columns(int(run), 1)).loop for run in lot.runs)


def _take(
    subjects: Sequence[Subject],
    meter: Meter,
    seen: Sequence[list[Looked]],
    modes: list[Array],
    loops: Callable[[Lot], Iterator[ClosedLoop]] | None,
    metrics: Metrics,
    windows: Array,
    lot: Lot,
) -> None:
    """Look at the flights of a lot by their metrics and the largest values (windows, quantities, lanes) of windows."""
    rows = [window.value(windows[:, k]) for k, window in enumerate(meter.windows.values())]
    shown: dict[str, Array] = dict(zip(meter.windows, rows, strict=True))
    lost, begins = metrics["diverged_at"], np.array([0, *meter.cuts()[:-1]])
    last = Last.of(shown, np.where(np.isnan(lost), meter.steps, lost / meter.instant), meter.instant)
    modes.append(last.mode)
    each = None if loops is None else list(loops(lot))
    for about, looked in zip(subjects, seen, strict=True):
        looked.append(_look(about, metrics, shown, begins, last, lot, each))


def _look(
    about: Subject,
    metrics: Metrics,
    shown: Mapping[str, Array],
    begins: Array,
    last: Last,
    lot: Lot,
    loops: Sequence[ClosedLoop] | None,
) -> Looked:
    """Look at flights by their windows, which begin at these control steps; loops: of each flight, where they differ in more
    than the start."""
    n, mode = about.claim.numbers, about.issued.mode
    more = 1.0 + SLACK
    right = (shown["told_attitude"] <= n["attitude_error"] * more) & (shown["told_rate"] <= n["rate_error"] * more)
    light = shown["momentum"] <= n.get("momentum", math.inf) * more
    inside = about.holds(shown)
    alike = np.ones(inside.shape[1], dtype=bool)
    if loops is not None:
        alike, starts = np.array([_apart(about, loop) for loop in loops]).T
        inside[0] |= starts
    elif not about.issued.step and mode in (None, 1):
        inside[0] |= _starts_inside(about, lot)
    if late := n.get("late_torque"):
        # As a claim begins the torque that acts may be no further from the command.
        inside &= shown["late_torque"] <= late
    # An estimate may be right before it has settled, for which it has half of the flight.
    place, starts_by = np.arange(len(begins))[:, None], begins[:, None]
    settles = np.where(~right & (starts_by < about.steps / 2.0), place, -1).max(axis=0)
    there = np.ones_like(alike) if mode is None else last.mode == mode
    flies = there & (starts_by >= np.maximum(last.begun, about.issued.step))
    enters = right & inside & flies & (place > settles)
    within = enters & light
    first = np.where(within.any(axis=0), within.argmax(axis=0), enters.argmax(axis=0))
    begun = np.where(enters.any(axis=0), begins[first], -1)
    later = place >= first
    values = {name: metrics[name] for name in ("final_attitude_error", "final_rate_error", "limit_share")}
    values |= {
        name: np.where(later, shown[row], 0.0).max(axis=0)
        for name, row in (("peak_torque_norm", "torque"), ("peak_wheel_momentum", "wheel_momentum"))
    }
    lost = ~np.isnan(metrics["diverged_at"])
    values = {name: np.where(lost, np.nan, x) for name, x in values.items()}
    return Looked(there, begun, (light | ~later).all(axis=0), (later & ~right).any(axis=0), alike, values)


def _starts_inside(about: Subject, lot: Lot) -> NDArray[np.bool_]:
    """Return which flights (lanes,), which differ in nothing but their start, start in the claim's set."""
    begun = unflatten([*lot.carries], lot.loop.carry()).state
    # The true start, not as measured.
    quiet, n = about.issued.loop.without("sensor", "estimator"), about.claim.numbers
    shown = shown_at(quiet, quiet.start._replace(attitude=begun.attitude, rate=begun.rate))
    return (height_of(about.claim, quiet, shown) <= n["start"]) & (momentum_of(quiet, shown) <= n.get("momentum", math.inf))


def _apart(about: Subject, loop: ClosedLoop) -> tuple[bool, bool]:
    """Return whether a run's own loop is one that the claim is about, and whether it starts in the claim's set."""
    proof: Any = about.claim.proof
    now, mode = replace(loop, events=()), about.issued.mode
    now = now if mode is None else loop_of_mode(now, mode - 1)
    stays = not about.issued.step and all(event.step > about.steps for event in loop.events)
    # Other numbers of a part may have no bounds.
    (whole,) = named([replace(about.claim, assumptions=())], now, about.claim.numbers.get("momentum", 0.0))
    alike = stays and not (differences(proof.claim, now) or whole.left_out or whole.limited_to(about.steps * now.period))
    begins = alike and mode in (None, 1)
    return alike, begins and start_inside(about.issued.certificate, now).get("pointing", False)


def _judged(subjects: Sequence[Subject], seen: Sequence[list[Looked]]) -> Iterator[ByClaim]:
    """Yield what is found of each claim whose mode flights end in; that with more momentum is about those that are left."""
    bounded: dict[int | None, NDArray[np.bool_]] = {}
    for about, looked in zip(subjects, seen, strict=True):
        columns: Any = zip(*(one[:5] for one in looked), strict=True)
        ends, begun, kept, misled, alike = (np.concatenate(column) for column in columns)
        values = {name: np.concatenate([one.values[name] for one in looked]) for name in looked[0].values}
        nearer, mode = bounded.get(about.issued.mode, np.zeros_like(ends)), about.issued.mode
        if not (ends & ~nearer).any():
            continue
        here, enters = alike & ends & ~nearer, begun >= 0
        covered = here & enters & kept
        bounded[mode] = nearer | covered
        left = {ELSEWHERE: ~ends, NEARER: nearer, OTHER: ends & ~nearer & ~alike}
        left |= {OUTSIDE: here & ~enters, MOVED: here & enters & ~kept}
        share = about.claim.numbers["share"]
        if share:
            # A flight is as many spans of time as its control steps begin.
            spans = math.ceil((about.steps + 1 - about.issued.step) / about.claim.numbers["samples"])
            share = max(1.0 - spans * (1.0 - share), 0.0)
        yield ByClaim(
            about.issued.certificate.name,
            sentence(about.claim, about.issued.certificate.subject),
            len(begun),
            {why: int(which.sum()) for why, which in left.items() if which.any()},
            share,
            int((covered & misled).sum()) if about.is_watched else None,
            tuple(_within(about, covered, begun, values)),
        )


def _within(about: Subject, covered: NDArray[np.bool_], begun: Array, values: Mapping[str, Array]) -> Iterator[Within]:
    """Yield the bracket of each metric that the claim bounds."""
    n, tail = about.claim.numbers, tail_start(about.steps)
    since = (tail - begun) * about.loop.period
    for name, unit, levels in (
        ("final_attitude_error", "rad", n["funnel"]),
        ("final_rate_error", "rad/s", [(n["settling"], n["rate"])]),
        ("peak_torque_norm", "N m", [(-math.inf, x) for x in _torque(about)]),
        ("peak_wheel_momentum", "N m s", [(-math.inf, x) for x in _stored(about)]),
    ):
        bounds, there = np.full(len(begun), np.inf), covered
        if name == "peak_wheel_momentum":
            # On their limits motors would have moved momentum between wheels before the claim covers the flight.
            there = covered & (values["limit_share"] == 0.0)
        for time, most in levels:
            bounds = np.where(since >= time, np.minimum(bounds, most), bounds)
        some = np.sort(bounds[there & (bounds < np.inf)])
        if not len(some):
            continue
        proved = float(some[math.ceil(NEARLY * len(some)) - 1])
        flights = values[name][there & (bounds <= proved)]
        beyond = int((~(flights <= proved * (1.0 + SLACK))).sum())
        worst = float(flights.max()) if not np.isnan(flights).any() else math.nan
        yield Within(name, unit, worst, proved, len(flights), beyond)


def _limits(about: Subject) -> dict[str, float]:
    """Return the limits that the claim keeps."""
    proof: Any = about.claim.proof
    return {name: float(rational(x)) for name, x in proof.claim["numbers"].items()}


def _torque(about: Subject) -> Iterator[float]:
    """Yield the largest norm of the torque on the body (N m), where the claim bounds it."""
    limits, wheels, n = _limits(about), about.issued.loop.wheels, about.claim.numbers
    motors = [limits[name] for name in (f"motors.{k}" for k in range(len(about.loop.rotors))) if name in limits]
    if n["error_per_rate"]:
        return
    if "limit.norm" in limits or "limit" in limits:
        yield (limits["limit.norm"] if "limit.norm" in limits else math.sqrt(3.0) * limits["limit"]) + n["error"]
    if wheels is not None and len(motors) == len(wheels.axes):
        yield float(np.linalg.norm(np.abs(np.array(wheels.axes)).T @ np.array(motors))) + n["error"]


def _stored(about: Subject) -> Iterator[float]:
    """Yield the largest momentum of a wheel (N m s), where the claim bounds that of every wheel with the rotors of the
    start; after a fault they are those of one flight."""
    limits, count = _limits(about), len(about.loop.rotors)
    stored = [limits[name] for name in (f"stored.{k}" for k in range(count)) if name in limits]
    # Momentum that friction moves between wheels has no bound.
    if not about.issued.step and count and len(stored) == count and "spare-momentum" not in about.claim.assumptions:
        yield max(stored)
