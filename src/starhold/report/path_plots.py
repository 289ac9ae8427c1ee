"""The plots of a craft near a libration point: its path and control in planes and over time, and the phase portrait of the
unstable X axis, which shows from what distance a limited control returns the craft."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.structure import runge_kutta
from starhold.analysis.libration_point import DAY, YEAR, CircleGoal, EquilibriumGoal, goal_of
from starhold.parts.bodies.libration_point import EARTH_DIAMETER, Sample
from starhold.report.plane_plots import Guide, Line, Plane, PlanePlot, ring
from starhold.report.plots import (
    Curve,
    Panel,
    Plot,
    colour,
    longest,
    near,
    positive,
    recorded_plots,
    sound,
    strided,
    thin,
    thin_times,
    thinning,
)

if TYPE_CHECKING:
    from starhold.scenario.reading import LawEntry, Scenario
    from starhold.studies.flight import Flight


WINDOW = 1.7
"""Half the width of the picture, as a multiple of the saddles' distance from the origin."""
FAMILY = 26
"""The number of paths from each edge of the picture."""
STEPS, STEP = 900, 0.01
"""The number of steps of a path, and their length in units of the natural time."""


class _Axis:
    """The system x'' = s^2 x + sat(-k_x x - k_v x'), in x (lengths) and x'/s, over the time s t."""

    def __init__(self, entry: LawEntry, scenario: Scenario) -> None:
        plant, gains = scenario.craft, entry.gains
        self.s = math.sqrt(plant.rate**2 + 2.0 * plant.stiffness)
        self.saddle = entry.options.limit / self.s**2
        self.k_x, self.k_v = gains.k_x / self.s**2, gains.k_velocity[0] / self.s

    def slope(self, state: Any) -> Any:
        x, w = state
        return w, x + np.clip(-self.k_x * x - self.k_v * w, -self.saddle, self.saddle)

    def path(self, start: Any, step: float) -> NDArray[np.float64]:
        """Return the paths (2, n, steps) from starts (2, n), by the classical Runge-Kutta method; they end far away."""
        state, states, advance = np.array(start, dtype=float), list[Any](), runge_kutta(self.slope)
        for _ in range(STEPS):
            states.append(state)
            near = np.abs(state).max(axis=0) < 3.0 * WINDOW * self.saddle
            state = np.where(near, advance(tuple(state), step), state)
        return np.stack(states, axis=-1)

    def separatrix(self, side: float) -> tuple[Curve, Curve]:
        """Return the path that ends in a saddle, the boundary of the region of attraction."""
        small = 1e-6 * self.saddle
        starts = np.array([[side * self.saddle + small, side * self.saddle - small], [-small, small]])
        halves = self.path(starts, -2.0 * STEP)
        x, w = (np.concatenate([half[0][::-1], half[1]]) for half in halves)
        return x, w


def phase_portrait(flights: Sequence[Flight], entries: Sequence[LawEntry], scenario: Scenario) -> PlanePlot | None:
    """Return the plot of x and x' for laws that hold an equilibrium, with paths of the X axis alone; None where no law does
    so or no law's X axis has its own saturation limit."""
    resting = [
        entry
        for entry in entries
        if isinstance(goal_of(entry.gains), EquilibriumGoal) and math.isfinite(entry.options.limit)
    ]
    if not resting or scenario.table.control.limit_kind != "axis":
        return None
    first = _Axis(resting[0], scenario)
    size = WINDOW * first.saddle
    edge = np.linspace(-size, size, FAMILY)
    ends = np.full(FAMILY, size)
    starts = np.concatenate([[edge, ends], [edge, -ends]], axis=1)
    paths = first.path(starts, STEP)
    guides = [Guide(x, w, kind="faint") for x, w in zip(paths[0], paths[1], strict=True)]
    (x, w), (far_x, far_w) = first.separatrix(1.0), first.separatrix(-1.0)
    area = Guide(np.concatenate([x, far_x]), np.concatenate([w, far_w]), "region of attraction", kind="light")
    slope, half = first.k_x / first.k_v, first.saddle / first.k_v
    across = np.array([-3.0, 3.0, 3.0, -3.0]) * size
    zone = Guide(across, np.array([1.0, 1.0, -1.0, -1.0]) * half - slope * across, "linear zone", kind="dark")
    guides = [area, zone, *guides]
    seen: set[float] = set()
    for entry in resting:
        if entry.options.limit in seen:
            continue
        seen.add(entry.options.limit)
        axis = _Axis(entry, scenario)
        shade = colour(entries.index(entry)) if len({other.options.limit for other in resting}) > 1 else None
        guides += [Guide(*axis.separatrix(side), "separatrix", shade) for side in (-1.0, 1.0)]
        guides.append(Guide(np.array([-axis.saddle, axis.saddle]), np.zeros(2), "saddles", shade, "points"))
    lines: list[Line] = []
    for flight, entry in zip(flights, entries, strict=True):
        place, speed = (strided(flight.recording[name], PATH)[:, 0] for name in ("position", "velocity"))
        lines.append(Line(place, speed / first.s) if entry in resting else Line(np.empty(0), np.empty(0)))
    name = f"x'/{first.s:.3g}, lengths"
    plane = Plane("x, lengths", name, lines, guides, (-size, size, -size, size))
    note = (
        f"Shaded: the region of attraction and, darker, the linear zone of {resting[0].name}. Grey: motions of the X axis "
        "alone, the other axes at rest. Dots: saddles."
    )
    return PlanePlot("phase", "X axis: position and velocity", [plane], "separatrices of the saddles", note)


LONG = 400.0 * DAY
"""Runs longer than this (s) have a time axis in years."""
ROOM = 0.08
"""The share of a picture left free around its contents."""
PATH = 4000
"""The most samples of a path."""
LEAST = 0.02
"""The least half width of a plot of x, as a share of the circle's radius: smaller motions are negligible."""


@dataclass(frozen=True)
class PathPlots:
    """All plots: the projections as in the publication, the phase portrait of X where a law holds an equilibrium, paths
    (n, 3) in length units, and the plots over time with their times."""

    times: Curve
    over_time: list[Plot]
    planes: list[PlanePlot]
    paths: list[NDArray[np.float64]]
    rings: list[float]
    unit: str


def collect(flights: Sequence[Flight], points: int, scenario: Scenario) -> PathPlots:
    """Return the plots of a comparison, with curves over time thinned to about `points` samples."""
    entries = [scenario.pick(flight.name) for flight in flights]
    units = scenario.table.libration.units
    times = longest(flights)["time"]
    factor = thinning(len(times), points)
    clock, tick = ("years", YEAR) if times[-1] * units.time > LONG else ("days", DAY)
    goals = [goal_of(entry.gains) for entry in entries]
    rings = sorted({goal.radius for goal in goals if isinstance(goal, CircleGoal)})
    portrait = phase_portrait(flights, entries, scenario)
    return PathPlots(
        thin_times(times, factor) * (units.time / tick),
        [
            _away(flights, entries, factor, scenario, clock),
            _control(flights, entries, factor, scenario, clock),
            *(replace(plot, clock=clock) for plot in recorded_plots(flights, factor, Sample._fields)),
        ],
        [_projections(flights, entries, scenario), *([] if portrait is None else [portrait])],
        [strided(flight.recording["position"], PATH) for flight in flights],
        rings,
        unit_text(scenario),
    )


def unit_text(scenario: Scenario) -> str:
    """Return the name of the unit of length."""
    length = scenario.table.libration.units.length
    return "Earth diameters" if length == EARTH_DIAMETER else f"units of {length / 1e3:g} km"


def _away(flights: Sequence[Flight], entries: Sequence[LawEntry], factor: int, scenario: Scenario, clock: str) -> Plot:
    """Return the plot of the distance from the circle, in and across its plane, or from the equilibrium."""
    length = scenario.table.libration.units.length / 1e3
    x = [thin(flight.recording["position"][:, 0] * length, factor) for flight in flights]
    goals = [goal_of(entry.gains) for entry in entries]
    off: list[Curve] = []
    circles = all(isinstance(goal, CircleGoal) for goal in goals)
    for flight, goal in zip(flights, goals, strict=True):
        position = flight.recording["position"]
        if circles and isinstance(goal, CircleGoal):
            off.append(thin((np.hypot(position[:, 1], position[:, 2]) - goal.radius) * length, factor))
        else:
            off.append(thin(goal.distance(position) * length, factor))
    if circles:
        panels = [Panel("from X axis − radius, km", off), Panel("x, km", x)]
        return Plot("deviation", "off the circle, in its plane and across", [sound(p, flights) for p in panels], clock=clock)
    near_km = scenario.table.settling.tolerance * length
    panels = [positive("distance, km", off, (near_km,)), Panel("x, km", x)]
    title = "distance from the point to be held, and along X"
    return Plot("deviation", title, [sound(p, flights) for p in panels], "tolerance", clock=clock)


def _control(flights: Sequence[Flight], entries: Sequence[LawEntry], factor: int, scenario: Scenario, clock: str) -> Plot:
    worth = scenario.table.libration.units.acceleration * 1e6
    limits = sorted({entry.options.limit * worth for entry in entries if math.isfinite(entry.options.limit)})
    kind = scenario.table.control.limit_kind
    each = tuple(sign * limit for limit in limits for sign in (-1.0, 1.0)) if kind == "axis" else ()
    panels: list[Panel] = []
    for i, axis in enumerate("xyz"):
        curves = [thin(flight.recording["control"][:, i] * worth, factor) for flight in flights]
        panels.append(Panel(f"{axis}, µm/s²", curves, False, near(each, curves) if each else ()))
    sizes = [thin(np.linalg.norm(flight.recording["control"], axis=1) * worth, factor) for flight in flights]
    panels.append(Panel("norm, µm/s²", sizes, False, near(tuple(limits), sizes) if limits and kind == "norm" else ()))
    limits_text = ", ".join(f"{limit:.4g}" for limit in limits)
    dashed = f"limit of {'each axis' if kind == 'axis' else 'the norm'}, {limits_text} µm/s²" if limits else "no limit"
    return Plot("control", "control acceleration", panels, dashed, True, clock, "Actuators")


def _projections(flights: Sequence[Flight], entries: Sequence[LawEntry], scenario: Scenario) -> PlanePlot:
    """Return plots of (x, y), (y, z) and (u_y, u_z), as published, and of (u_x, u_z), in which the control comes closest to
    its limit; with the circle and the limit."""
    goals = [goal_of(entry.gains) for entry in entries]
    radii = sorted({goal.radius for goal in goals if isinstance(goal, CircleGoal)})
    size = max([*radii, *(max(map(abs, goal.at(0.0)[0])) for goal in goals)]) or 1.0
    kept = [flight for flight in flights if flight.lost is None]
    places = [strided(flight.recording["position"], PATH) for flight in flights]
    controls = [strided(flight.recording["control"], PATH) for flight in flights]
    sound_places = [place for place, flight in zip(places, flights, strict=True) if flight in kept]

    def reach(column: int) -> float:
        farthest = max((float(np.abs(place[:, column]).max()) for place in sound_places), default=2.0 * size)
        return (1.0 + ROOM) * max(farthest, LEAST * size)

    across = (1.0 + ROOM) * max([size, *(reach(i) / (1.0 + ROOM) for i in (1, 2))])
    limits: dict[float, str] = {}
    for number, entry in enumerate(entries):
        if math.isfinite(entry.options.limit):
            limits.setdefault(entry.options.limit, colour(number))
    same = len(limits) == 1
    most = max((float(np.abs(control).max()) for control in controls), default=1.0)
    bounds = [
        ring(limit, "limit", None if same else shade) for limit, shade in limits.items() if limit < 3.0 * max(most, 1e-9)
    ]
    if scenario.table.control.limit_kind == "axis":
        bounds = [_square(guide) for guide in bounds]
    strong = (1.0 + ROOM) * max([most, *(float(np.abs(guide.x).max()) for guide in bounds)])
    x = reach(0)
    places_of = [goal.place for goal in goals if isinstance(goal, EquilibriumGoal)]
    rests = [Guide(np.array([y]), np.array([z]), "rest", kind="points") for _, y, z in places_of]
    planes = [
        Plane("x", "y", [Line(p[:, 0], p[:, 1]) for p in places], [], (-x, x, -across, across), False),
        Plane(
            "y",
            "z",
            [Line(p[:, 1], p[:, 2]) for p in places],
            [*(ring(radius, "circle") for radius in radii), *rests],
            (-across, across, -across, across),
        ),
        *(
            Plane(
                f"u_{'xyz'[i]}",
                "u_z",
                [Line(u[:, i], u[:, 2]) for u in controls],
                bounds,
                (-strong, strong, -strong, strong),
            )
            for i in (1, 0)
        ),
    ]
    dashed = " and ".join([*(["circle to be held"] if radii else []), *(["limit"] if bounds else [])])
    worth = scenario.table.libration.units
    note = f"1 = {worth.length / 1e3:g} km; of the control {worth.acceleration * 1e6:.4g} µm/s²"
    return PlanePlot("projections", "projections of motion and control", planes, dashed, note)


def _square(guide: Guide) -> Guide:
    """Return the square of a limit per axis in place of the circle of a limit on the norm."""
    size = float(np.abs(guide.x).max())
    x, y = size * np.array([1.0, 1.0, -1.0, -1.0, 1.0]), size * np.array([-1.0, 1.0, 1.0, -1.0, -1.0])
    return Guide(x, y, guide.text, guide.colour)
