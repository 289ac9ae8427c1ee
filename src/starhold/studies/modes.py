"""Flights of laws with modes: their switches, and the certificates of each mode and hand-over."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from starhold.analysis.mode_notes import Span, span
from starhold.laws.conditions import Facts, Sight, Watch, needs_sky, sky_at, station_at
from starhold.laws.modes import Modes, Switch, names_of_modes
from starhold.loop.modes import loop_of_mode
from starhold.parts.craft import tensor
from starhold.parts.epoch import Date, date_after
from starhold.parts.outage import NEVER
from starhold.scenario.requirement import BEGINS, column_of, is_of_a_part
from starhold.studies.body import Issued
from starhold.studies.flight import Begun
from starhold.studies.requirements import tables_of, times_of

if TYPE_CHECKING:
    from starhold.analysis.departure import Departure
    from starhold.certification.certify import Wanted
    from starhold.laws.catalogue import Law
    from starhold.loop.closed_loop import ClosedLoop
    from starhold.scenario.reading import Scenario
    from starhold.simulation.lane import Recording


NEXT = "another mode begins"
SEEN = 2_000
"""The most samples of a run at which conditions that never held are evaluated again."""
SPARE, SLOW = 1.05, math.radians(0.3)
"""The factor on the rate at a hand-over, and the least rate (rad/s) from which the next mode is to be proved."""
STORED, RELEASED = "wheel_momentum_above", "wheel_momentum_below"
"""The tests of a switch for the wheels' momentum."""


class Stretch(NamedTuple):
    """An interval in which a mode, counted from 1, is active: control steps `first` to `last` (None: to the end)."""

    mode: int
    first: int
    last: int | None


def stretches(run: Recording) -> list[Stretch]:
    """Return the modes of a recorded run in order; none for a law without modes. A mode that begins and ends between two
    samples is missing."""
    if "mode" not in run.arrays:
        return []
    period = run.attrs["control_period"]
    modes, begun = run["mode"], np.rint((run["time"] - run["time_in_mode"]) / period).astype(int)
    places = np.flatnonzero(np.r_[True, (np.diff(modes) != 0.0) | (np.diff(begun) != 0)])
    starts = [max(0, int(begun[place])) for place in places]
    return [
        Stretch(int(modes[place]), first, last)
        for place, first, last in zip(places, starts, [*starts[1:], None], strict=True)
    ]


def modes_flown(law: Law, run: Recording, epoch: Date | None = None) -> tuple[Begun, ...]:
    """Return the modes of a recorded run with the control instants at which they begin; epoch: that of the flight, if its
    modes use dates."""
    period, module = run.attrs["control_period"], law.module
    begun: list[Begun] = []
    for mode, first, _ in stretches(run):
        time, monitor = first * period, 0
        if module.on_loss == mode - 1:
            monitor = int(run["tripped"][np.searchsorted(run["time"], time - 0.5 * period)])
        date, name = date_after(epoch, time) if epoch else "", module.monitors[monitor - 1].name if monitor else ""
        begun.append(Begun(module.modes[mode - 1].name, time, date, name))
    return tuple(begun)


def never_begun(law: Law, gains: Any, run: Recording) -> tuple[str, ...]:
    """Return sentences, without full stops, about the modes that could have followed a mode of a recorded run but never
    began; the mode on a loss is left out."""
    module: Any = law.module
    flown = {one.mode - 1 for one in stretches(run)}
    said: list[str] = []
    for to in (place for place in range(len(module.modes) if flown else 0) if place not in {*flown, module.on_loss}):
        ways = [
            (switch, numbers)
            for place, (_, _, switches) in enumerate(module.parts(gains))
            for switch, numbers in switches
            if place in flown and switch.to == to
        ]
        reasons = dict.fromkeys(_missed(module, gains, run, switch, numbers) for switch, numbers in ways)
        if reasons:
            said.append(f"{module.modes[to].name} never begins{': ' * any(reasons)}{'; '.join(filter(None, reasons))}")
    return tuple(said)


def _missed(module: Modes, gains: Any, run: Recording, switch: Switch, numbers: list[Any]) -> str:
    """Return the reason why a switch's condition, with these numbers, never held in a run, if a single test explains it;
    only tests of the craft's position and of time are considered."""
    (after, dwell, *levels), end = numbers, float(run["time"][-1])
    given = dict(zip(switch.keys, levels, strict=True))
    begin = max(after, given.get("not_before", 0.0)) + dwell
    if begin > end:
        return f"its condition needs {begin:g} s, and the flight ends at {end:g} s"
    period = run.attrs["control_period"]
    watch = Watch(0.0, sky_at(gains.epoch, module.ephemeris) if needs_sky(switch.tests) else (), (), 0.0)
    if "latitude" in given:
        given["station"] = station_at(given)
    count = len(run["time"])
    instants = range(0, count, max(1, count // SEEN))
    for test in (one for one in switch.tests if one.rpartition("_")[0] in ("elevation", "sunlight")):
        if not any(_holds(test, given, watch, run, k, period) for k in instants):
            return f"{test} holds at no time of this flight"
    return ""


def _holds(test: str, given: dict[str, Any], watch: Any, run: Recording, place: int, period: float) -> bool:
    """Return whether a test of the craft's position holds at a sample."""
    state: Any = SimpleNamespace(position=tuple(run["position"][place].tolist()))
    clock = watch._replace(clock=round(float(run["time"][place]) / period))
    measurement: Any = SimpleNamespace(period=period)
    return bool(Facts(measurement, clock, Sight(state, (), None)).holds(test, given[test], given))


def epoch_of(scenario: Scenario, law: Law) -> Date | None:
    """Return the epoch of a flight whose law has conditions on dates, stations or the Sun; None for other laws."""
    dated = isinstance(law.module, Modes) and law.module.WATCHES
    return scenario.orbit.epoch if dated and scenario.orbit is not None else None


def begins_asked(scenario: Scenario, law: Law) -> dict[str, int]:
    """Return the modes of a law, counted from 1, whose first beginning is required in campaigns, by the requirements'
    columns."""
    tables = [one for one in scenario.table.requirement if one.metric == BEGINS and one.method == "campaign"]
    names = names_of_modes(law)
    return {column_of(one): names.index(str(one.in_mode)) + 1 for one in tables if one.in_mode in names}


def parts_asked(scenario: Scenario, law: Law) -> dict[str, tuple[str, Span]]:
    """Return the error and the part of a flight in which campaigns must bound it, by the requirements' columns. InputError
    for times that are invalid or outside the flight."""
    names = names_of_modes(law)
    timing, parts = scenario.table.simulation, dict[str, tuple[str, Span]]()
    for key, table in tables_of(scenario, "campaign").items():
        if is_of_a_part(table) and (table.in_mode is None or table.in_mode in names):
            times = times_of(scenario, key, table, timing.duration)
            mode = None if table.in_mode is None else names.index(table.in_mode) + 1
            parts[column_of(table)] = str(table.metric), span(mode, *times, timing.control_period)
    return parts


def first_fault(scenario: Scenario, loop: ClosedLoop) -> tuple[float, ...]:
    """Return the time of the first fault of a flight, including sensor outages: infinite if there are none; an empty tuple
    where the law detects no losses, or a campaign draws outages, so that lanes differ in them."""
    campaign = scenario.table.campaign
    drawn = campaign is not None and any(".outage" in key for key in campaign.over)
    if drawn or not isinstance(loop.law.module, Modes) or loop.law.module.on_loss is None:
        return ()
    windows = [getattr(fitted.params, "outage", NEVER) for fitted in loop.used("sensor")]
    outages = [math.ceil(begin / loop.period - 1e-9) for begin, end in windows if end > begin]
    return (float(min([*outages, *(event.step for event in loop.events)], default=math.inf)),)


def named_modes(loop: ClosedLoop, name: str) -> dict[str, ClosedLoop]:
    """Return the loop of each mode of a law, by the name of its certificate."""
    modes: Any = loop.law.module.modes
    return {f"{name}: {mode.name}": loop_of_mode(loop, place) for place, mode in enumerate(modes)}


class HandOver(NamedTuple):
    """A switch between two modes, counted from 0, with the loops of both, the levels of its tests (rad/s, rad), and the
    least time (s) in the previous mode; `key`: "until" or "back"."""

    name: str
    places: tuple[int, int]
    before: ClosedLoop
    after: ClosedLoop
    levels: dict[str, float]
    least: float
    key: str


def hand_overs(loop: ClosedLoop, name: str) -> list[HandOver]:
    """Return the switches of a law, with the names of their certificates."""
    module: Any = loop.law.module
    return [
        HandOver(
            f"{name}: {mode.name} to {module.modes[switch.to].name}",
            (place, switch.to),
            loop_of_mode(loop, place),
            loop_of_mode(loop, switch.to),
            dict(zip(switch.keys, levels, strict=True)),
            least,
            switch.key,
        )
        for place, (mode, _, switches) in enumerate(module.parts(loop.gains))
        for switch, (least, _, *levels) in switches
    ]


def certify_modes(loop: ClosedLoop, name: str, wanted: Wanted) -> list[Issued]:
    """Return the certificates of each mode's law, and of each switch to a mode that is proved to converge."""
    from starhold.certification.certify import certify
    from starhold.certification.hand_over import flown_ends, hand_over

    issued, switches, flown = list[Issued](), hand_overs(loop, name), list[Any]()
    for place, (title, mode_loop) in enumerate(named_modes(loop, name).items()):
        # The rates that earlier modes hand over, with a margin for errors.
        rates = [
            flown_ends(one.levels, one.before, one.after, flown[one.places[0]], None)[0] * SPARE
            for one in switches
            if one.places[1] == place and one.key == "until" and one.places[0] < place
        ]
        begun = max([SLOW, *(rate for rate in rates if rate < math.inf)]) if place else None
        kept = replace(wanted, stored=most_stored(loop, place, begun or 0.0), begun=begun)
        certificate = certify(mode_loop, title, kept)
        issued.append(Issued(certificate, mode_loop, mode=place + 1))
        claim = certificate.claim("pointing")
        flown.append(claim if claim is not None and claim.outcome == "proved" else None)
    for one in switches:
        certificate = hand_over(one.after, one.before, one.name, one.levels)
        if certificate is not None:
            before, after = one.places
            issued.append(Issued(certificate, one.after, mode=after + 1, before=before + 1))
    return issued


def most_stored(loop: ClosedLoop, place: int, rate: float = 0.0) -> float:
    """Return the largest momentum (N m s) of the wheels that claims about a mode need to assume: the level at which the mode
    ends, else the level at which another mode hands over to it, else, after a mode with inactive wheels, the momentum of the
    rotors plus that of a body at this rate (rad/s); otherwise inf."""
    switches = hand_overs(loop, "")
    ends = [(one.places, one.levels[STORED]) for one in switches if STORED in one.levels]
    ending, beginning = ([level for places, level in ends if places[side] == place] for side in (0, 1))
    idle = [fresh_momentum(one, rate) for one in switches if one.places[1] == place and one.key == "until"]
    return max(ending or beginning or idle, default=math.inf)


def fresh_momentum(one: HandOver, rate: float) -> float:
    """Return the largest momentum (N m s) with which a mode begins at this rate (rad/s) after a mode with inactive wheels,
    whose rotors keep their momentum; inf after any other mode, and 0 without wheels."""
    if one.after.wheels is None:
        return 0.0
    if one.before.wheels is not None:
        return math.inf
    return float(np.linalg.norm(one.after.stored)) + _most_inertia(one) * rate


def left_momentum(one: HandOver, rate: float) -> float:
    """Return the largest momentum (N m s) at which a switch happens at a rate (rad/s) of the body: the wheels' momentum that
    it allows plus that of the body; inf where it allows any."""
    return one.levels.get(RELEASED, math.inf) + _most_inertia(one) * rate


def _most_inertia(one: HandOver) -> float:
    return float(np.linalg.eigvalsh(tensor(one.after.craft.inertia))[-1])


def flown_stretches(issued: Issued, run: Recording, end: int | None) -> list[Stretch]:
    """Return the stretches of a recorded run in which a certificate's mode flies (for a switch, only after the previous
    mode) with the certificate's loop, which flies up to the control step `end` (None: always)."""
    flown = stretches(run)
    befores = [None, *(one.mode for one in flown)]
    spans = [
        one._replace(first=max(one.first, issued.step), last=one.last if end is None else min(one.last or end, end))
        for one, before in zip(flown, befores, strict=False)
        # A switch before the certificate's loop flew is none of it.
        if one.mode == issued.mode and (issued.before is None or (issued.before == before and one.first >= issued.step))
    ]
    return [one for one in spans if one.last is None or one.first < one.last]


def mode_departures(issued: Issued, run: Recording, end: int | None) -> dict[str, tuple[Departure, ...]]:
    """How a run leaves the proved claims about a mode, or about the hand-over to it, while that mode flies with the loop of
    the claims, up to the control step `end` (None: always)."""
    from starhold.analysis.departure import CHANGES, Departure, departures

    spans = flown_stretches(issued, run, end)
    if not spans:
        what = "mode" if issued.before is None else "switch"
        lacks = "" if end is None and not issued.step else " while it has the loop of the claim"
        never = Departure(0.0, f"this flight has no such {what}{lacks}")
        return {claim.kind: (never,) for claim in issued.certificate.claims if claim.outcome == "proved"}
    reasons: dict[str, set[Departure]] = {}
    for one in spans:
        change = CHANGES if end is not None and one.last == end else NEXT
        for kind, left in departures(issued.certificate, issued.loop, run, one.first, one.last, change).items():
            reasons.setdefault(kind, set()).update(left)
    return {kind: tuple(sorted(left)) for kind, left in reasons.items()}
