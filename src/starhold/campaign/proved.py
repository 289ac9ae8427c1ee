"""Brackets by the claim about a loop as it flies: for each flight it is found when it meets the claim's premises, and from
then on the claim bounds it.

A flight has them from the start where it starts in the claim's set, or from a window of time on in which its angles and
rates are in that set, the law is told no more wrongly than the claim assumes, and the momentum is within its bound: so a
flight is covered once its estimate has settled, or once it comes from outside. It must be a flight of the claim's own
loop, in all numbers but the start."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
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
from starhold.certification.wording import enumerated, sentence
from starhold.kernel.numbers import rational
from starhold.loop.closed_loop import ClosedLoop, is_recorded
from starhold.scenario.building import build
from starhold.simulation.lanes import ThreadPool
from starhold.studies.body import Issued, study_of

Array = NDArray[np.float64]
Notice = Callable[..., None]
MOST, BLOCK = 20_000, 512
"""Runs of a campaign that are compared with the claim, from the first on, and those of a block."""
APART = 1_000
"""Runs that are compared where each has a loop of its own."""
SLACK = 1e-6
"""The share of a bound by which the integration may take a flight beyond it, or beyond a premise."""
NEARLY = 0.9
"""The bound of the final angle is the least that holds for this share of the flights that have one by the last quarter."""
START = ("state.attitude", "state.rate", "memories.", "h")
"""Numbers that a claim does not depend on but through the start begin with these."""
OUTSIDE, OTHER, MOVED = "do not come into its set", "fly another loop", "have more momentum"
"""Why flights are not covered."""


class Looked(NamedTuple):
    """This is found of flights (lanes,): from which control step on they are in the claim's set with an estimate that has
    settled, -1 for never; whether their momentum is within its bound from then on; whether the law is told more wrongly than
    is assumed; whether they fly the claim's loop; and their metrics from then on."""

    begun: Array
    kept: NDArray[np.bool_]
    misled: NDArray[np.bool_]
    alike: NDArray[np.bool_]
    values: dict[str, Array]


class Subject(NamedTuple):
    """A claim about a law's loop as it flies, and the loop."""

    claim: Claim
    issued: Issued
    loop: ClosedLoop
    steps: int

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


def look(job: Job, law: str, threads: int, notice: Notice | None = None) -> ByClaim:
    """Compare what is proved of a law with the flights of its campaign, which are flown once more. notice: called with the
    law and how many more are flown, and what for."""
    watching = Job(job.source, job.table, extras=(PREMISES,))
    lanes = watching.lanes(law)
    names = {name for places in lanes.moved.values() for name in _names(lanes.base.names, places)}
    alike = all(name.startswith(START) for name in names)
    runs = min(job.table.runs, MOST if alike else APART)
    tell = partial(notice or (lambda law, more, sought: None), law, sought=Sought("proof", runs))
    tell(0)
    about = _subject(job, law)
    if isinstance(about, str):
        tell(runs)
        return ByClaim(about)
    seen, meter = list[Looked](), watching.meter(law)
    with ThreadPool(threads) as pool:
        for first in range(0, runs, BLOCK):
            count = min(BLOCK, runs - first)
            columns, numbers = watching.plan.columns(first, count), np.arange(first, first + count)
            loops = partial(_loops, watching, law)
            take = partial(_take, about, meter, seen, None if alike else loops)
            watching.measure(law, columns, numbers, pool, take)()
            tell(count)
    return _judged(about, seen)


def _subject(job: Job, law: str) -> Subject | str:
    """Return the claim about a law's loop that flies at the end of a flight, or why there is none."""
    scenario, study = job.scenario, study_of(job.scenario.body)
    if scenario.supposed is not None:
        return "the law's nominal model is not the craft that flies"
    entry = scenario.pick(law)
    loop, steps = build(scenario, entry), scenario.table.simulation.steps
    why = "no claim is about the loop as it flies"
    for one in reversed(study.certify(scenario, entry, loop, pointing=True)):
        claim = one.certificate.claim("pointing")
        if one.mode is not None or one.before is not None:
            why = "claims are about single modes"
        elif claim is None or claim.outcome != "proved":
            why = one.certificate.unflown or why
        elif claim.left_out:
            why = f"the claim leaves out {enumerated(claim.left_out)}"
        elif condition := claim.limited_to(steps * loop.period):
            why = f"the claim holds only if {condition}"
        elif (change := study.ends(one, loop, steps * loop.period)) is not None:
            why = f"the claim ends with what changes at {change * loop.period:g} s"
        else:
            return Subject(claim, one, loop, steps)
    return why


def _names(names: tuple[str, ...], places: set[int]) -> Iterator[str]:
    """Return the names of numbers, "" for what is none."""
    return (names[place] if place >= 0 else "" for place in places)


def _loops(job: Job, law: str, lot: Lot) -> Iterator[ClosedLoop]:
    """Yield the loop of each run of a lot, from its own scenario."""
    lanes = job.lanes(law)
    return (lanes.exact(job.plan.columns(int(run), 1)).loop for run in lot.runs)


def _take(
    about: Subject,
    meter: Meter,
    seen: list[Looked],
    loops: Callable[[Lot], Iterator[ClosedLoop]] | None,
    metrics: Metrics,
    windows: Array,
    lot: Lot,
) -> None:
    """Look at the flights of a lot by their metrics and the largest values (windows, quantities, lanes) of windows."""
    n, begins = about.claim.numbers, np.array([0, *meter.cuts()[:-1]])
    rows = [window.value(windows[:, k]) for k, window in enumerate(meter.windows.values())]
    shown: dict[str, Array] = dict(zip(meter.windows, rows, strict=True))
    more = 1.0 + SLACK
    right = (shown["told_attitude"] <= n["attitude_error"] * more) & (shown["told_rate"] <= n["rate_error"] * more)
    light = shown["momentum"] <= n.get("momentum", math.inf) * more
    inside = about.holds(shown)
    alike = np.ones(inside.shape[1], dtype=bool)
    if loops is not None:
        alike, starts = np.array([_apart(about, loop) for loop in loops(lot)]).T
        inside[0] |= starts
    elif not about.issued.step:
        inside[0] |= _starts_inside(about, lot)
    # An estimate may be right before it has settled, for which it has half of the flight.
    place, starts_by = np.arange(len(begins))[:, None], begins[:, None]
    settles = np.where(~right & (starts_by < about.steps / 2.0), place, -1).max(axis=0)
    enters = right & inside & (starts_by >= about.issued.step) & (place > settles)
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
    seen.append(Looked(begun, (light | ~later).all(axis=0), (later & ~right).any(axis=0), alike, values))


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
    now = replace(loop, events=())
    alike = not about.issued.step and not differences(proof.claim, now)
    return alike, alike and start_inside(about.issued.certificate, now).get("pointing", False)


def _judged(about: Subject, seen: list[Looked]) -> ByClaim:
    columns: Any = zip(*(one[:4] for one in seen), strict=True)
    begun, kept, misled, alike = (np.concatenate(column) for column in columns)
    values = {name: np.concatenate([one.values[name] for one in seen]) for name in seen[0].values}
    there = begun >= 0
    covered = there & kept & alike
    left = {OTHER: ~alike, OUTSIDE: alike & ~there, MOVED: alike & there & ~kept}
    share = about.claim.numbers["share"]
    if share:
        # A flight is as many spans of time as its control steps begin.
        spans = math.ceil((about.steps + 1 - about.issued.step) / about.claim.numbers["samples"])
        share = max(1.0 - spans * (1.0 - share), 0.0)
    return ByClaim(
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
