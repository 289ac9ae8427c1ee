"""Straight-line programs of a craft near a libration point under a law, and the numbers that they ask for: for the kernel."""

from __future__ import annotations

from math import isfinite
from typing import Any

from starhold.algebra.vector import ZERO
from starhold.laws.catalogue import Law
from starhold.laws.point import PointMeasurement
from starhold.parts.actuators.limits import LIMITS
from starhold.parts.bodies.libration_point import Libration, linear, nonlinear
from starhold.trace.straight_line import labelled, straight_line

ASKED = PointMeasurement(ZERO, ZERO, 0.0, 0.0)
"""A measurement of which every number is an input."""


def point_programs(law: Law, gains: Any, craft: Libration, full: bool, limit: str) -> dict[str, dict[str, Any]]:
    """Return the programs by role: the field, the law, how its control is limited, and what it declares to make attractive:
    errors that vanish with their V, or a place of rest."""
    memory = law.remember(gains, craft, 0.0)

    def control(measurement: PointMeasurement, gains: Any, craft: Any) -> Any:
        return law.command(measurement, gains, craft, memory)[0]

    found = {
        "field": straight_line(nonlinear if full else linear, position=ZERO, velocity=ZERO, plant=craft),
        "law": straight_line(control, measurement=ASKED, gains=gains, craft=craft),
        "limited": straight_line(LIMITS[limit], command=ZERO, limit=0.0),
    }
    if errors := law.hook("errors"):
        found["errors"] = straight_line(errors, measurement=ASKED, gains=gains)
    if law.lyapunov is not None:
        found["lyapunov"] = straight_line(law.lyapunov, measurement=ASKED, gains=gains, craft=craft)
    if rest := law.hook("rest"):
        found["rest"] = straight_line(rest, gains=gains)
    return found


def point_subject(gains: Any, craft: Libration, known: Libration) -> dict[str, str]:
    """Return the exact numbers that the programs may ask for: gains, the craft's and those that the law takes it to have."""
    named = [*labelled("gains", gains), *labelled("plant", craft), *labelled("craft", known)]
    return {name: x.hex() for name, x in named if isfinite(x)}
