"""The kernel's programs and numbers for a craft near a libration point."""

from __future__ import annotations

from math import isfinite
from typing import Any

from starhold.algebra.vector import ZERO
from starhold.laws.catalogue import Law
from starhold.laws.program import ASKED, law_program
from starhold.parts.actuators.limits import LIMITS
from starhold.parts.bodies.libration_point import Libration, linear, nonlinear
from starhold.trace.straight_line import labelled, straight_line


def point_programs(law: Law, gains: Any, craft: Libration, full: bool, limit: str) -> dict[str, dict[str, Any]]:
    """Return the programs by role: the vector field, the law, its control limit, and the set that it is to make attractive,
    which is given by errors that vanish on it and their V, or is an equilibrium."""
    measurement = ASKED["libration-point"]
    programs = {
        "field": straight_line(nonlinear if full else linear, position=ZERO, velocity=ZERO, plant=craft),
        "law": law_program(law, gains, craft, 0.0),
        "limited": straight_line(LIMITS[limit], command=ZERO, limit=0.0),
    }
    if errors := law.hook("errors"):
        programs["errors"] = straight_line(errors, measurement=measurement, gains=gains)
    if law.lyapunov is not None:
        programs["lyapunov"] = straight_line(law.lyapunov, measurement=measurement, gains=gains, craft=craft)
    if rest := law.hook("rest"):
        programs["rest"] = straight_line(rest, gains=gains)
    return programs


def point_subject(gains: Any, craft: Libration, known: Libration) -> dict[str, str]:
    """Return the exact numbers that the programs may read: the gains, the craft, and the law's nominal model."""
    named = [*labelled("gains", gains), *labelled("plant", craft), *labelled("craft", known)]
    return {name: x.hex() for name, x in named if isfinite(x)}
