"""Gives the kernel programs and numbers of a craft near a libration point, and certificates what it proved about them."""

from __future__ import annotations

import re
from math import isfinite
from typing import Any

from starhold.algebra.vector import ZERO
from starhold.kernel.check import Proved
from starhold.laws.catalogue import Law
from starhold.laws.program import ASKED, law_program
from starhold.parts.actuators.limits import LIMITS
from starhold.parts.bodies.libration_point import Libration, linear, nonlinear
from starhold.trace.straight_line import labelled, straight_line


def point_programs(law: Law, gains: Any, craft: Libration, full: bool, limit: str) -> dict[str, dict[str, Any]]:
    """Return the programs by role: the field, the law, how its control is limited, and the set that it declares to make
    attractive: errors that vanish with their V, or an equilibrium."""
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
    """Return the exact numbers that the programs may read: gains, the craft's and those of the law's model of it."""
    named = [*labelled("gains", gains), *labelled("plant", craft), *labelled("craft", known)]
    return {name: x.hex() for name, x in named if isfinite(x)}


HOWS = {
    "Vanishes": "exact identity",
    "Solves": "exact identity",
    "Exceeds": "exact inequality",
    "Squares": "sum of squares",
    "Contracts": "Lyapunov's matrix",
}
"""The methods of the kernel's rules, in words."""
TOLD = {
    "ends on the circle": ("circle", ("level", "inner", "outer", "velocity")),
    "comes to rest": ("equilibrium", ()),
    "returns with limited control": ("saturated-axis", ("limit", "width", "reach", "boundary")),
    "needs more control on the circle": ("control-limit", ()),
    "holds another circle": ("circle", ()),
    "does not return": ("equilibrium", ()),
}
"""The kind of claim that each theorem proves or refutes, and the numbers that the claim states."""
REFUTED = {
    "needs more control on the circle": ("control", ("control", "y", "z")),
    "holds another circle": ("only the circle", ("radius", "needs", "of")),
    "does not return": ("each axis returns", ()),
}
"""The statements that refuting theorems contradict, and the numbers."""
_NUMBER = re.compile(r"( [+-]?\d+)+$")


def claim_of(proved: Proved, circle: bool) -> dict[str, Any]:
    """Return a certificate's entries of a proved claim; circle: the law is for one."""
    numbers = {name: float(x) for name, x in proved.claim.numbers.content.items()}
    kind, names = TOLD[proved.claim.theorem]
    limit = next((name for name in ("norm", "axis") if f"limit.{name}" in numbers), None)
    claimed: dict[str, Any] = {} if limit is None else {"limit": numbers[f"limit.{limit}"], "kind": limit}
    claimed |= {name: numbers[name] for name in names}
    # Steps of one name are listed once.
    steps = dict.fromkeys((_NUMBER.sub("", name), HOWS[rule]) for name, rule in proved.shown)
    outcome, shown = "proved", [(*step, "proved", dict[str, float]()) for step in steps]
    if proved.claim.theorem in REFUTED:
        name, evidence = REFUTED[proved.claim.theorem]
        outcome = "refuted"
        if kind == "equilibrium" and circle:
            kind, name = "circle", "x returns"
        shown = [(name, "exact inequality", "refuted", {key: numbers[key] for key in evidence})]
    return {
        "kind": "control-limit" if limit else kind,
        "outcome": outcome,
        "numbers": claimed,
        "assumptions": [*proved.statement.assumptions],
        "obligations": [dict(zip(("name", "how", "outcome", "evidence"), one, strict=True)) for one in shown],
    }
