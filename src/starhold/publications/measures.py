"""Measures that several publications share."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from starhold.publications.desk import Desk
from starhold.publications.figure import Curve, Figure, Panel
from starhold.publications.verdicts import Finding


def metric(
    desk: Desk, file: str, law: str, name: str, scale: float = 1.0, changes: Mapping[str, Any] | None = None
) -> Finding:
    """A metric of a flight, as `compare` reports it (SI), times a scale; not a number where the flight has none."""
    value = desk.flight(file, law, changes).metrics.get(name)
    return Finding(float("nan") if value is None else scale * float(value))


def proved(desk: Desk, file: str, law: str, claim: str) -> Finding:
    """Return whether a claim of a law's certificate is proved."""
    outcome = desk.claims(file, law)[claim].outcome
    return Finding(outcome == "proved", f"{claim}: {outcome}")


def samples(
    desk: Desk, file: str, law: str, quantity: str, until: float = math.inf, changes: Mapping[str, Any] | None = None
) -> tuple[Any, Any]:
    """The times (n,) of a flight up to one (the recording's unit of time), and a recorded quantity (n, ...) at these."""
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
    """Components of a recorded quantity over the time of a flight, up to `until` (the recording's unit of time)."""
    time, values = samples(desk, file, law, quantity, until, changes)
    columns = values.reshape(len(values), -1)
    curves = [
        Curve(time, scale * columns[:, number], names[place] if names else "", hue=place)
        for place, number in enumerate(components or range(columns.shape[1]))
    ]
    return Figure([Panel(f"time, {desk.recording(file, law, changes).time_unit}", label, curves)])
