"""Notes on the premises of a claim about a loop as it flies: the estimation errors, the momentum of body and wheels, and the
difference between the acting torque and the command."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from starhold.algebra.quaternion import relative
from starhold.algebra.scalar import maximum
from starhold.algebra.several import weighted
from starhold.algebra.vector import Vector, add, apply, dot, most, subtract
from starhold.analysis.meter import KINDS, TOLD, Window

PREMISES = "premises"
"""The name of these notes among the extras of a meter."""
MODES = {"mode": ("mode at the end", "1"), "time_in_mode": ("time since the mode began, at the end", "s")}
"""The windows of a law of modes, with what they mean and their units."""


class Premises(NamedTuple):
    """The maxima in a window: the squared sine of half the angle error, and the squared rate error, of the law's inputs;
    the squared momentum of body and wheels; a wheel's momentum; how far q0 is below zero; and the squared torque beside the
    command. modes: at its last instant, the mode and for how long (s) it has flown, for a law of modes."""

    attitude: float
    rate: float
    momentum: float
    wheel: float
    other: float
    late: float
    modes: tuple[float, ...]


class Masses(NamedTuple):
    """The inertia of the body (kg m2) and the axes of its wheels; modes: a zero for each of `MODES`, for a law of modes."""

    inertia: Any
    axes: tuple[Vector, ...]
    modes: tuple[float, ...] = ()


def begun(masses: Masses | None) -> Any:
    """Return the notes before a flight; none if none are wanted."""
    return () if masses is None else Premises(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, masses.modes)


def noted(seen: Any, quantities: Mapping[str, Any], masses: Any) -> Any:
    """Return the notes updated with the quantities of a sample. The law knows exactly what no part reports to it."""
    if not seen:
        return seen
    attitude, rate = (quantities[name] for name in ("attitude", "rate"))
    turned = relative(attitude, quantities.get(f"{TOLD}attitude", attitude))
    off = subtract(quantities.get(f"{TOLD}rate", rate), rate)
    late = subtract(quantities["torque"], quantities["command"])
    total, rotors = apply(masses.inertia, rate), quantities.get("wheel_momentum", ())
    total = add(total, weighted(rotors, masses.axes)) if rotors else total
    return Premises(
        maximum(seen.attitude, turned[1] * turned[1] + turned[2] * turned[2] + turned[3] * turned[3]),
        maximum(seen.rate, dot(off, off)),
        maximum(seen.momentum, dot(total, total)),
        maximum(seen.wheel, most(rotors)) if rotors else seen.wheel,
        maximum(seen.other, -quantities["attitude_error"][0]),
        maximum(seen.late, dot(late, late)),
        (quantities["mode"], quantities["time_in_mode"]) if seen.modes else (),
    )


def windows(rows: Any) -> dict[str, Window]:
    """Return the windows of notes at these rows."""
    if not rows:
        return {}
    return {
        "told_attitude": Window(rows.attitude, KINDS["angle"], "error of the attitude that the law is told", "rad"),
        "told_rate": Window(rows.rate, np.sqrt, "error of the rate that the law is told", "rad/s"),
        "momentum": Window(rows.momentum, np.sqrt, "momentum of body and wheels", "N m s"),
        "wheel_momentum": Window(rows.wheel, KINDS["number"], "momentum of a wheel", "N m s"),
        "other_quaternion": Window(rows.other, KINDS["number"], "how far q0 is below zero", "1"),
        "late_torque": Window(rows.late, np.sqrt, "torque that acts less the command", "N m"),
        **{name: Window(row, KINDS["number"], *MODES[name]) for name, row in zip(MODES, rows.modes, strict=False)},
    }
