"""The report of a rotating body: its figures, and the animated body on the page."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from starhold.algebra.quaternion import conjugate, multiply, to_body
from starhold.analysis.rigid_body import DECADES
from starhold.parts.craft import EARTH, total_inertia
from starhold.report import transients
from starhold.report.accuracy import draw_accuracy
from starhold.report.attitude_plots import (
    ACCURACIES,
    AttitudePlots,
    begun,
    closest_limit,
    collect,
    early,
    steps_within,
    until,
)
from starhold.report.body import PageParts, Sampling
from starhold.report.figures import POINTS, Picture, over_time, without_runs
from starhold.report.page_parts import PAGE_POINTS, over_time_data, panel_data, rounded, views
from starhold.report.plots import Panel, Plot, longest, thinning
from starhold.report.tables import swatch
from starhold.scenario.bodies.rigid_body.faults import fault_times
from starhold.studies.flight import Begun, Flight

if TYPE_CHECKING:
    from starhold.scenario.reading import Scenario

FRAMES = 180
"""The number of attitudes of the animated body; the page interpolates smoothly between them."""
EARLY_POINTS = 900
"""The number of samples of a curve that shows only the transient."""
EARLY = 1.6
"""Frame k of n shows the time T (k/n)^EARLY, because most of the motion is at the start. Where a run is much longer than its
transient, half of the frames show the transient."""
SECONDS = 14.0
"""The duration of the animation."""

_VIEWS = (
    "The measured attitude in the axes of the target (dashed, x* y* z*); solid axes are the body's, and the angle is the "
    "one left to turn. The outline is the uniform box with this inertia."
)
_ORBITAL = (
    " In the orbital frame x* points along the motion, y* against the orbit's normal, and z* to the centre of "
    "attraction, which is down in the picture."
)


def picture(flights: Sequence[Flight], scenario: Scenario) -> Picture:
    """Return the figures: attitude over time, steps to each accuracy, and angle and torque during a short transient."""
    plots, shown, name = collect(flights, POINTS, scenario), without_runs(flights), scenario.name
    drawn = (plots.scalar, plots.attitude, plots.rate, plots.torque, plots.angle, plots.roll_pitch_yaw, *plots.further)
    more = plots.marks, shown, name, plots.shaded
    figures: Picture = {plot.name: partial(over_time, plot, plots.times, *more) for plot in drawn}
    if (end := early(flights)) is not None:
        first = collect(until(flights, end), POINTS, scenario, end)
        for plot in (first.angle, first.torque):
            cut = replace(plot, title=f"{plot.title}, transient")
            figures[f"{plot.name}-transient"] = partial(over_time, cut, first.times, first.marks, shown, name, first.shaded)
    steps = {label: [steps_within(flight, kind) for flight in flights] for kind, label in ACCURACIES}
    return figures | {"accuracy": partial(draw_accuracy, steps, list(DECADES), shown, name)}


def page(flights: Sequence[Flight], scenario: Scenario) -> PageParts:
    """Return the parts of the page: the attitude over time, and the body as a rotating box."""
    # Imported here, because it loads much of SciPy, which the figures do not need.
    from starhold.report.linear_loop import section

    plots, end = collect(flights, PAGE_POINTS, scenario), early(flights)
    scene = _scene(scenario, flights)
    data = {"times": rounded(plots.times), "plots": [*_drawn(plots, flights, scenario), _accuracy(flights)]}
    data |= {"scene": scene, "unsure": plots.shaded, **_happenings(scenario, flights)}
    sampling = Sampling(thinning(len(longest(flights)["time"]), PAGE_POINTS))
    if end is not None:
        early_flights = until(flights, end)
        count = len(longest(early_flights)["time"])
        sampling = sampling._replace(early=(count, thinning(count, EARLY_POINTS)))
        first = collect(early_flights, EARLY_POINTS, scenario, end)
        drawn = {one["name"]: one for one in _drawn(first, flights, scenario)}
        data["transient"] = {"times": rounded(first.times), "plots": drawn}
    return PageParts(
        data,
        views=views(flights, len(scene["times"]), "The turning body", "Attitude", _simplification(scene)),
        measured=_limits(flights, scenario) + transients.section(flights),
        folds={"Linear loop": section(scenario, flights)},
        transient=end,
        scripts=("space.js", "body.js"),
        footer=f"; seed {scenario.table.simulation.seed}",
        sampling=sampling,
    )


def _limits(flights: Sequence[Flight], scenario: Scenario) -> str:
    """Return HTML that states to which limit each flight comes closest."""
    closest = [(number, *closest_limit(flight, scenario)) for number, flight in enumerate(flights)]
    said = "".join(f"<span>{swatch(number)}{name} {100.0 * share:.3g} %</span>" for number, share, name in closest if name)
    return f'<p class="best-at of-file"><strong>Closest to a limit of torque or wheels</strong>{said}</p>' if said else ""


def _simplification(scene: Mapping[str, Any]) -> str:
    arrow = "" if scene["earth"] is None else f" The arrow leads to the {scene['centre']}."
    return _VIEWS + (_ORBITAL if scene["down"] else "") + arrow


def _drawn(plots: AttitudePlots, flights: Sequence[Flight], scenario: Scenario) -> list[dict[str, Any]]:
    """Return the plots over time for the script, beginning with the error that the laws control."""
    (angle, speed), of_angle = plots.angle.panels, replace(plots.angle, title="error angle")
    lead = [replace(of_angle, panels=[angle]), replace(of_angle, name="speed", title="relative rate", panels=[speed])]
    # Where every attitude is within its tolerance, the rate comes first.
    if scenario.table.settling.attitude_tolerance >= math.pi:
        lead.reverse()
    quaternion = Plot("quaternion", "error quaternion", [*plots.scalar.panels, *plots.attitude.panels])
    drawn = (*lead, plots.roll_pitch_yaw, quaternion, plots.rate, plots.torque, *plots.further)
    return [over_time_data(plot, flights) for plot in drawn]


def _happenings(scenario: Scenario, flights: Sequence[Flight]) -> dict[str, Any]:
    """Return the marks of faults, reactions and modes: bands of time where only one law has them, else their beginnings."""
    struck = {fault.time for fault in scenario.table.fault}
    marks = [(time, "fault" if time in struck else "acted on") for time in fault_times(scenario)]
    moded = [flight for flight in flights if flight.modes]
    if len(moded) != 1:
        return {"marks": [*marks, *begun(flights)], "bands": []}
    begin = [*moded[0].modes, Begun("", float(moded[0].recording["time"][-1]))]
    return {"marks": marks, "bands": [(one.time, after.time, one.mode) for one, after in pairwise(begin)]}


def _accuracy(flights: Sequence[Flight]) -> dict[str, Any]:
    order = list(range(len(flights)))
    panels: list[dict[str, Any]] = []
    for kind, label in ACCURACIES:
        steps = [steps_within(flight, kind) for flight in flights]
        panels.append({**panel_data(Panel(f"steps to {label}", []), order), "curves": steps, "widths": [2.0] * len(order)})
    period = flights[0].recording.attrs["control_period"]
    return {
        "name": "accuracy",
        "topic": "Motion",
        "title": "control steps needed to stay within 10⁻ᵏ",
        "dashed": "",
        "xlabel": f"k; a control step lasts {period:g} s",
        "panels": panels,
        "x": list(DECADES),
        "split": True,
        "markers": True,
    }


def _scene(scenario: Scenario, flights: Sequence[Flight]) -> dict[str, Any]:
    every = longest(flights)["time"]
    # Some frames of a short run would be equal; each sample shows once.
    end = early(flights)
    power = EARLY if end is None else max(EARLY, math.log(end / float(every[-1])) / math.log(0.5))
    frames = np.rint((len(every) - 1) * np.linspace(0.0, 1.0, FRAMES + 1) ** power).astype(int)
    places = np.array(list(dict.fromkeys(frames.tolist())))
    attitudes: list[list[list[float | None]]] = []
    for flight in flights:
        q = flight.recording["attitude_error"]
        attitudes.append([rounded(q[place], 4) for place in places if place < len(q)] or [[1.0, 0.0, 0.0, 0.0]])
    times = every[places] if len(places) > 1 else np.array([0.0, 1.0])
    size, axes = _box(total_inertia(scenario.craft))
    return {
        "times": rounded(times),
        "digits": max(0, min(3, 3 - math.floor(math.log10(max(float(times[-1]), 1e-3))))),
        "attitudes": attitudes,
        "places": places.tolist(),
        "size": rounded(size, 4),
        "axes": [rounded(row) for row in axes],
        "earth": None if scenario.table.orbit is None else _earth(flights, places),
        "centre": "Earth" if abs(scenario.craft.gravity - EARTH) < 1e-3 * EARTH else "planet",
        "down": scenario.table.target.mode == "orbital",
        "seconds": SECONDS,
    }


def _earth(flights: Sequence[Flight], places: Any) -> list[list[float | None]]:
    """Return unit vectors, in target axes, to the centre of attraction at these samples of the longest run."""
    run = longest(flights)
    attitude, error, position = (run[name][places].T for name in ("attitude", "attitude_error", "position"))
    goal = multiply(tuple(attitude), conjugate(tuple(error)))
    toward = to_body(goal, tuple(-position / np.linalg.norm(position, axis=0)))
    return [rounded(row, 4) for row in np.transpose(toward)]


def _box(inertia: Any) -> tuple[Any, Any]:
    """Half edges of the uniform box with this inertia, the longest 0.95, and its axes as columns, in body axes.

    For edges 2a, 2b, 2c a moment is proportional to b^2 + c^2, so a^2 is proportional to the sum of the other two moments
    less its own. Edges that would vanish (a flat body has them) are shown as a tenth of the longest."""
    full = np.asarray(inertia, dtype=float)
    if full.ndim == 1:
        moments, axes = full, np.eye(3)
    else:
        moments, axes = np.linalg.eigh(full)
        # The library may return either sign, but the picture should be the same everywhere.
        axes = axes * np.where(np.take_along_axis(axes, np.abs(axes).argmax(axis=0)[None], axis=0)[0] < 0.0, -1.0, 1.0)
        axes[:, 2] *= np.sign(np.linalg.det(axes))
    edges = np.sqrt(np.maximum(moments.sum() - 2.0 * moments, 0.0))
    return 0.95 * np.maximum(edges / edges.max(), 0.1), axes
