"""Finds the numbers and the evidence about a plan, for the proof of a law that plans its moves."""

from __future__ import annotations

from typing import Any

import numpy as np

from starhold.certification.evidence.recorded import RecordedLoop
from starhold.certification.evidence.squares import rounded
from starhold.certification.matrices import above
from starhold.certification.subject import gravity_gradient_bounds
from starhold.kernel.numbers import demand
from starhold.laws.predictive.free import Plan

TURN = 0.3
"""How far (rad) a body turns at most within the horizon, in claims about a plan."""
DIGITS = 4
"""The digits to which the units of motions are rounded."""


def told_of(loop: RecordedLoop, plan: Plan) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the numbers and the evidence about a plan. RefusedError for one with another body, or at another place,
    than the loop's."""
    flown, stiffness = loop.loop, 0.0
    demand(flown.known.inertia == flown.craft.inertia, "the law plans for another inertia than the body's")
    telling = [f.part.module.Reading for f in flown.used("sensor")] + [
        f.part.module.Estimate for f in flown.used("estimator")
    ]
    demand(not any("position" in reading._fields for reading in telling), "the law is told a position that may be off")
    if flown.has("two-body"):
        # Twice the torque for a turn by q, half its slope, twice: |n x J (n x e) + (n x e) x J n| <= (largest - least) |e|.
        stiffness = above(4 * gravity_gradient_bounds(flown)[1])
    else:
        demand(not any(flown.start.position), "the law plans with gravity, and there is no orbit")
    # Those in which motions cost alike.
    units = [str(rounded(float(x), DIGITS)) for x in np.sqrt(np.diag(plan.cost))]
    numbers = {"plan.rate": TURN / (plan.moves * flown.period), "plan.gap": plan.gap, "plan.stiffness": stiffness}
    moves: Any = np.vectorize(float.hex, otypes=[object])(plan.free).tolist()
    return numbers, {"plan": {"units": units, "moves": moves}}
