"""Attitude control laws: their measurement, and the declarations in a law file.

A law file contains `CARD`, `class Gains(NamedTuple)`, the equation `torque(measurement, gains, craft, memory) -> (torque,
memory)` and `examples()`. It may add `lyapunov(measurement, gains, craft)`, design forms (`FORMS` with `design(craft,
spec)`, `complete(spec, start)` for inputs taken from the scenario, and `design_all(cases)` for many pairs of craft and
spec, where that is faster than one by one), `check(gains, craft)` that refuses gains that cannot be stable,
`remember(gains, craft, period)` for a memory that is not empty, `plan(gains, craft, period)` for proofs about a torque that
is the first move of a plan (`predictive.free.Plan`), and `record(memory, period)` for its recorded quantities, a NamedTuple
whose fields are annotated with `Quantity`. `FROM_OUTSIDE = True`: the torque must be external to the spacecraft, as that of
magnetorquers is and that of wheels is not.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

from starhold.algebra.vector import Vector, add, apply, gyroscopic_torque, subtract
from starhold.parts import contract
from starhold.parts.bodies.rigid_body import Measurement as Measurement
from starhold.parts.contract import Field as Field
from starhold.parts.contract import NoMemory as NoMemory
from starhold.parts.contract import Parameter
from starhold.parts.contract import fields as fields
from starhold.parts.craft import Craft
from starhold.synthesis.start import Start as Start

Claim: TypeAlias = Literal["global", "almost-global", "local", "none"]


@dataclass(frozen=True)
class Card(contract.Card):
    """The card of a law: title, formula, sources, assumptions, claimed stability, and facts that its users need."""

    claims: Claim
    """The claimed stability: global, almost-global, local or none; any claim needs assumptions."""
    quaternion_sign: Literal["odd", "even"] = "odd"
    """odd: feeding back -q in place of q changes the torque; even: it does not."""
    rest_tolerance: float = 0.0
    """Largest torque (N m) at rest on target; zero except for laws that solve a problem to a tolerance."""


Gain = Parameter
"""The name of a law's parameter."""


def tracking_torque(measurement: Measurement, craft: Craft) -> Vector:
    """Return the torque (N m) under which the motion relative to a moving target obeys the equations for a target at rest,
    J w_e' + w_e x J w_e = rest of the torque; zero for a target at rest."""
    gyroscopic = subtract(
        gyroscopic_torque(craft.inertia, measurement.body_rate), gyroscopic_torque(craft.inertia, measurement.rate)
    )
    return add(gyroscopic, apply(craft.inertia, measurement.target_acceleration))
