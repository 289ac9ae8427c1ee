"""Searches for the roots of the modal law that slew fastest within a scenario's limits, and fits the results."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from starhold.analysis.roots import PUBLISHED, Found, SlewProblem, TwoPieceFit, fit, search, unmet
from starhold.analysis.transient import Limits
from starhold.errors import InputError
from starhold.scenario.bodies.rigid_body.transient import TransientTable
from starhold.scenario.building import build
from starhold.scenario.reading import LawEntry, Scenario
from starhold.studies.body import SILENT, Notice

DIGITS = 6
"""The number of printed digits of the fit; the roots have three or four."""
PUBLISHED_FOR: dict[str, Any] = {
    "rate_limit": math.radians(30.0),
    "acceleration_limit": math.radians(50.0),
    "angle_end": math.radians(0.1),
    "rate_end": math.radians(0.1),
    "start_rate": (math.radians(20.0) / math.sqrt(3.0),) * 3,
}
"""The limits and start of the published fit, with the axis along the rate."""


@dataclass(frozen=True)
class Study:
    """The results of a search by angle; their fit, None for too few angles; and the published fit, None where limits or
    start differ from the published ones."""

    results: list[Found]
    b: float
    eased: bool
    """Whether the search was also run with the tolerances on the limits."""
    fitted: TwoPieceFit | None
    published: TwoPieceFit | None

    @property
    def angles(self) -> NDArray[np.float64]:
        """Initial angles (rad), (n,)."""
        return np.array([item.angle for item in self.results])

    @property
    def roots(self) -> NDArray[np.float64]:
        """The best roots within the limits (1/s), (n,)."""
        return np.array([math.nan if item.hard is None else item.hard.root for item in self.results])

    def fits(self) -> dict[str, TwoPieceFit]:
        """The fits by name in tables; empty where there are none."""
        both = {"fit": self.fitted, "published": self.published}
        return {name: pieces for name, pieces in both.items() if pieces is not None}


def pick_modal(scenario: Scenario, law: str | None) -> LawEntry:
    """Return the law of this name, or the first modal one. InputError where it is not modal or there are no limits."""
    if scenario.table.transient is None:
        raise InputError(scenario.where, "transient", "no such table", "a [transient] table with limits")
    if scenario.table.target.mode != "inertial":
        raise InputError(
            scenario.where, "target.mode", scenario.table.target.mode, '"inertial", because the search slews to rest'
        )
    entries = [entry for entry in scenario.laws if entry.law.name == "modal"]
    entry = scenario.pick(law) if law is not None else entries[0] if entries else None
    if entry is None or entry.law.name != "modal":
        raise InputError(scenario.where, "law", law or "none that is modal", 'a law with type = "modal"')
    return entry


def study(scenario: Scenario, entry: LawEntry, notice: Notice = SILENT) -> Study:
    """Return the results of a scenario's search, with a law from `pick_modal`, of which only b matters. `notice` is called
    with the number of angles done. InputError where no root keeps within the limits from some angle."""
    table: Any = scenario.table.transient
    limits, eased = _limits(table)
    problem = problem_of(scenario, entry)
    answers = search(problem, table.angles, table.roots, limits, eased, lambda done, total: notice(done, total, "angles"))
    for item in answers:
        if item.hard is None:
            raise _unreachable(scenario, problem, item.angle, limits)
    hard = [item.hard.root for item in answers if item.hard is not None]
    b = problem.b
    return Study(answers, b, eased != limits, fit(table.angles, hard), PUBLISHED if _as_published(table, b) else None)


def problem_of(scenario: Scenario, entry: LawEntry) -> SlewProblem:
    """Return the slews of a scenario's search, without faults."""
    table: Any = scenario.table.transient
    steps, ends = scenario.table.simulation.steps, (table.angle_end, table.rate_end)
    return SlewProblem(build(scenario, entry), steps, table.axis, table.start_rate, *ends, entry.gains.b)


def _limits(table: TransientTable) -> tuple[Limits, Limits]:
    """Return the limits, without and with their tolerances."""
    hard = Limits(table.rate_limit, table.acceleration_limit)
    return hard, Limits(hard.rate + table.rate_tolerance, hard.acceleration + table.acceleration_tolerance)


def _as_published(table: TransientTable, b: float) -> bool:
    along = np.linalg.norm(np.cross(table.axis, table.start_rate)) < 1e-9 and np.dot(table.axis, table.start_rate) > 0.0
    given = (np.allclose(getattr(table, name), value, rtol=1e-9) for name, value in PUBLISHED_FOR.items())
    return bool(along) and b == -0.01 and all(given)


def _unreachable(scenario: Scenario, problem: SlewProblem, angle: float, limits: Limits) -> InputError:
    """Return the error that names the limit that no root keeps within from an angle."""
    table: Any = scenario.table.transient
    why, duration = unmet(problem, angle, table.roots, limits), f"{problem.steps * problem.loop.period:g} s"
    ended = f"from {math.degrees(angle):.4g} deg no root that settles within {duration}"
    if why.what == "end":
        text = f"a longer one, or other roots: {ended.replace(' that settles', ' settles')}"
        return InputError(scenario.where, "simulation.duration", duration, text)
    if why.what == "both":
        return InputError(
            scenario.where, "transient", "rate_limit and acceleration_limit", f"wider ones: {ended} keeps both"
        )
    unit = "deg/s" if why.what == "rate" else "deg/s^2"
    limit = f"{math.degrees(getattr(limits, why.what)):.6g} {unit}"
    text = f"at least {math.degrees(why.least):.6g} {unit}: {ended} does with less (root {why.root:.6g} 1/s)"
    return InputError(scenario.where, f"transient.{why.what}_limit", limit, text)


def law_lines(pieces: TwoPieceFit, b: float) -> list[str]:
    """Return the lines of a [[law]] table in TOML whose root is given by a fit."""
    below, above = ([float(f"{x:.{DIGITS}g}") for x in piece] for piece in (pieces.below, pieces.above))
    split = f'split = "{math.degrees(pieces.split):.{DIGITS}g} deg"'
    return ["[[law]]", 'type = "modal"', 'form = "fit"', f"below = {below}", f"above = {above}", split, f"b = {b!r}"]
