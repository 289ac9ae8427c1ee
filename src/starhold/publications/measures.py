"""Measures that more than one publication asks for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from starhold.publications.desk import Desk
from starhold.publications.figure import Curve, Figure, Panel
from starhold.publications.verdicts import Finding


def metric(
    desk: Desk, file: str, law: str, name: str, scale: float = 1.0, changes: Mapping[str, Any] | None = None
) -> Finding:
    """A metric of a flight, as `compare` tells it (SI), times a scale; not a number where the flight has none."""
    value = desk.flight(file, law, changes).metrics.get(name)
    return Finding(float("nan") if value is None else scale * float(value))


def proved(desk: Desk, file: str, law: str, claim: str) -> Finding:
    """Tell whether a claim of a law's certificate is proved."""
    outcomes = {found.kind: found.outcome for found in desk.certificate(file, law).claims}
    return Finding(outcomes[claim] == "proved", f"{claim}: {outcomes[claim]}")


def history(
    desk: Desk,
    file: str,
    law: str,
    quantity: str,
    label: str,
    components: Sequence[int] = (),
    names: Sequence[str] = (),
    scale: float = 1.0,
    until: float | None = None,
    changes: Mapping[str, Any] | None = None,
) -> Figure:
    """Components of a recorded quantity over the time of a flight, up to `until` (the recording's unit of time)."""
    recording = desk.recording(file, law, changes)
    values, time = np.asarray(recording[quantity]), np.asarray(recording["time"])
    shown = time <= (time[-1] if until is None else until)
    columns = values.reshape(len(values), -1)
    picked = list(components) or list(range(columns.shape[1]))
    curves = [
        Curve(time[shown], scale * columns[shown, number], names[place] if names else "", hue=place)
        for place, number in enumerate(picked)
    ]
    return Figure([Panel(f"time, {recording.time_unit}", label, curves)])
