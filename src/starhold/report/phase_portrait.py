"""The phase portrait of the X axis, along which rest is unstable: how far a limited control brings the craft back."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from starhold.analysis.libration_point import EquilibriumGoal, goal_of
from starhold.report.plane_plots import Guide, Line, Plane, PlanePlot
from starhold.report.plots import Curve, colour

if TYPE_CHECKING:
    from starhold.scenario.reading import LawEntry, Scenario
    from starhold.studies.flight import Flight

WINDOW = 1.7
"""Half the width of the picture, in distances of the saddles."""
FAMILY = 26
"""Paths on each edge of the picture."""
STEPS, STEP = 900, 0.01
"""Steps of the paths: how many, and how long in units of the natural time."""
PATH = 4000
"""Samples of a flight at most."""


class _Axis:
    """x'' = s^2 x + sat(-k_x x - k_v x'), in x (lengths) and x'/s, over the time s t."""

    def __init__(self, entry: LawEntry, scenario: Scenario) -> None:
        plant, gains = scenario.craft, entry.gains
        self.s = math.sqrt(plant.rate**2 + 2.0 * plant.stiffness)
        self.saddle = entry.options.limit / self.s**2
        self.k_x, self.k_v = gains.k_x / self.s**2, gains.k_velocity[0] / self.s

    def slope(self, state: NDArray[np.float64]) -> NDArray[np.float64]:
        x, w = state
        push = np.clip(-self.k_x * x - self.k_v * w, -self.saddle, self.saddle)
        return np.stack([w, x + push])

    def path(self, start: Any, step: float) -> NDArray[np.float64]:
        """From many starts (2, n) the paths (2, n, steps), by the classical Runge-Kutta method; far away they stop."""
        state, states = np.array(start, dtype=float), []
        for _ in range(STEPS):
            states.append(state)
            a = self.slope(state)
            b = self.slope(state + 0.5 * step * a)
            c = self.slope(state + 0.5 * step * b)
            d = self.slope(state + step * c)
            near = np.abs(state).max(axis=0) < 3.0 * WINDOW * self.saddle
            state = state + np.where(near, step / 6.0, 0.0) * (a + 2.0 * b + 2.0 * c + d)
        return np.stack(states, axis=-1)

    def separatrix(self, side: float) -> tuple[Curve, Curve]:
        """The path that ends in a saddle: where the region of attraction ends."""
        small = 1e-6 * self.saddle
        starts = np.array([[side * self.saddle + small, side * self.saddle - small], [-small, small]])
        halves = self.path(starts, -2.0 * STEP)
        x, w = (np.concatenate([half[0][::-1], half[1]]) for half in halves)
        return x, w


def phase_portrait(flights: Sequence[Flight], entries: Sequence[LawEntry], scenario: Scenario) -> PlanePlot | None:
    """x and x' of laws that hold a place of rest, among the paths of the X axis alone; None where no law does so or no law's
    X axis has a limit of its own."""
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
        every = max(1, -(-len(flight.recording["time"]) // PATH))
        state = flight.recording["position"][::every, 0], flight.recording["velocity"][::every, 0] / first.s
        lines.append(Line(*state) if entry in resting else Line(np.empty(0), np.empty(0)))
    name = f"x'/{first.s:.3g}, lengths"
    plane = Plane("x, lengths", name, lines, guides, (-size, size, -size, size))
    note = (
        f"Shaded: the region of attraction and, darker, the linear zone of {resting[0].name}. Grey: motions of the X axis "
        "alone, the other axes at rest. Dots: saddles."
    )
    return PlanePlot("phase", "X axis: position and velocity", [plane], "separatrices of the saddles", note)
