"""Measures shared by several publications."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from starhold.analysis.rigid_body import error_angle
from starhold.publications.desk import Desk
from starhold.publications.figure import Curve, Figure, Panel
from starhold.publications.verdicts import Finding

CLOCKS = {"s": 1.0, "min": 60.0}
"""Units of time in figures, in seconds."""


def metric(
    desk: Desk, file: str, law: str, name: str, scale: float = 1.0, changes: Mapping[str, Any] | None = None
) -> Finding:
    """Return a metric of a flight, as `compare` reports it (SI), times a scale; NaN where the flight has no such value."""
    value = desk.flight(file, law, changes).metrics.get(name)
    return Finding(float("nan") if value is None else scale * float(value))


def proved(desk: Desk, file: str, law: str, claim: str) -> Finding:
    """Return whether a claim of a law's certificate is proved."""
    outcome = desk.claims(file, law)[claim].outcome
    return Finding(outcome == "proved", f"{claim}: {outcome}")


def samples(
    desk: Desk, file: str, law: str, quantity: str, until: float = math.inf, changes: Mapping[str, Any] | None = None
) -> tuple[Any, Any]:
    """Return the times (n,) of a flight up to `until` (the recording's unit of time) and a quantity (n, ...) at these."""
    recording = desk.recording(file, law, changes)
    shown = np.asarray(recording["time"]) <= until
    return np.asarray(recording["time"])[shown], np.asarray(recording[quantity])[shown]


def history(
    desk: Desk,
    file: str,
    law: str,
    quantity: str,
    label: str,
    components: Sequence[int] = (),
    names: Sequence[str] = (),
    scale: float = 1.0,
    until: float = math.inf,
    changes: Mapping[str, Any] | None = None,
) -> Figure:
    """Return a figure of components of a recorded quantity over time, up to `until` (the recording's unit of time)."""
    time, values = samples(desk, file, law, quantity, until, changes)
    columns = values.reshape(len(values), -1)
    curves = [
        Curve(time, scale * columns[:, number], names[place] if names else "", hue=place)
        for place, number in enumerate(components or range(columns.shape[1]))
    ]
    return Figure([Panel(f"time, {desk.recording(file, law, changes).time_unit}", label, curves)])


def histories(
    desk: Desk, runs: Sequence[tuple[str, str]], until: float, clock: str = "s", levels: Sequence[float] = (), **what: Any
) -> Figure:
    """Return a figure with a panel as in `history` per flight, values held between samples, with these levels."""
    figures = {law: history(desk, file, law, until=until, **what) for file, law in runs}
    panels: list[Panel] = []
    for law, figure in figures.items():
        curves = [replace(one, x=one.x / CLOCKS[clock], style="steps") for one in figure.panels[0].curves]
        panels.append(replace(figure.panels[0], x_label=f"time, {clock}", curves=curves, title=law, levels=levels))
    return Figure(panels, columns=2)


def angles(
    desk: Desk, runs: Mapping[str, Sequence[str]], until: float = math.inf, clock: str = "s", log: bool = False
) -> Figure:
    """Return a figure of the angle from the target over time for several flights, given by name as file and law."""
    curves: list[Curve] = []
    for name, (file, law) in runs.items():
        time, error = samples(desk, file, law, "attitude_error", until)
        curves.append(Curve(time / CLOCKS[clock], np.degrees(error_angle(error)), name))
    return Figure([Panel(f"time, {clock}", "angle from the target, °", curves, log_y=log)])


def bounded(desk: Desk, of: Mapping[str, Sequence[Any]], name: str, at_most: float = math.inf, unit: str = "") -> Finding:
    """Return for several flights, given by name as file, law and changes if any, whether a metric (SI) exists and is at most
    `at_most`."""
    values = {case: desk.flight(*flight).metrics[name] for case, flight in of.items()}
    shown = ", ".join(f"{case} {'none' if value is None else f'{value:.3g}'}" for case, value in values.items())
    return Finding(
        {case: value is not None and value <= at_most for case, value in values.items()}, f"{shown} {unit}".rstrip()
    )
