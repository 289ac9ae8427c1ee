"""The torque of the Earth's magnetic field on a spacecraft's residual dipole."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from starhold.algebra.quaternion import to_body
from starhold.algebra.vector import ZERO, Vector, cross, norm
from starhold.parts import magnetic_field
from starhold.parts.contract import Card, Envelope, Parameter, Push
from starhold.parts.craft import Craft
from starhold.parts.epoch import EPOCH, START, Date
from starhold.parts.random import Dice

CARD = Card(
    title="Residual dipole",
    summary="M = m x B, B the Earth's magnetic field",
    sources=(magnetic_field.SOURCE, "Fundamentals of Spacecraft Attitude Determination and Control (2014)"),
    assumptions=(
        *magnetic_field.ASSUMPTIONS,
        "the field in inertial axes is held for a control period",
        "unknown to all laws",
    ),
)
ROLE = "environment"
NEEDS = ("two-body",)
ABOUT = "Earth"
ACROSS_FIELD = True


class Params(NamedTuple):
    """The craft's residual dipole, and the epoch."""

    dipole: Annotated[Vector, Parameter("A m^2", shape=(3,), spread=False, text="magnetic moment, body axes")]
    epoch: Annotated[Date, EPOCH] = START


class Numbers(NamedTuple):
    """The dipole and the field."""

    dipole: Vector
    field: magnetic_field.Numbers


def prepare(params: Params, period: float) -> Numbers:
    """Return the numbers of a flight. Raise ValueError for an epoch at which the field is not known."""
    return Numbers(params.dipole, magnetic_field.prepared(params.epoch, period))


def remember(params: Numbers) -> Vector:
    """Return the initial memory, without field."""
    return ZERO


def update(memory: Vector, state: Any, params: Numbers, dice: Dice, step: int) -> Vector:
    """Return the field at the start of the control step (T, inertial axes)."""
    return magnetic_field.field_at(state.position, step, params.field)


def torque(state: Any, params: Numbers, craft: Craft, memory: Vector) -> Vector:
    """Return the torque on the body (N m, body axes)."""
    return cross(params.dipole, to_body(state.attitude, memory))


def bound(params: Params, envelope: Envelope) -> Push:
    """Return a bound on the norm of the torque, for a dipole across the strongest field at the least height of the orbit."""
    return Push(norm(params.dipole) * magnetic_field.strongest(params.epoch, envelope.distance))


def examples() -> list[Params]:
    """Return the dipole of a CubeSat, and of a larger craft at another time."""
    return [Params((0.01, -0.005, 0.02)), Params((0.0, 1.0, 0.3), (2027.0, 6.0, 21.0, 12.0, 30.0, 15.0))]
