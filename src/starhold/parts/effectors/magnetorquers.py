"""Three magnetic rods or coils along the body axes, which act against the Earth's magnetic field."""

from __future__ import annotations

from functools import reduce
from typing import Annotated, Any, NamedTuple, cast

from starhold.algebra.quantity import Quantity
from starhold.algebra.quaternion import to_body
from starhold.algebra.scalar import Scalar, Truth, absolute, clip, divide, either, less, maximum, where
from starhold.algebra.several import each
from starhold.algebra.structured import when
from starhold.algebra.vector import ZERO, Vector, cross, dot, scale
from starhold.parts import as_built, magnetic_field
from starhold.parts.contract import Card, Parameter
from starhold.parts.epoch import EPOCH, START, Date

CARD = Card(
    title="Magnetorquers",
    summary="M = m x B with m = B_m x command / |B_m|^2 within the dipole limit, B_m the measured field",
    sources=(magnetic_field.SOURCE, "Fundamentals of Spacecraft Attitude Determination and Control (2014)"),
    assumptions=(
        *magnetic_field.ASSUMPTIONS,
        "along the body axes but for the mounting error, without lag or hysteresis, held for a control period",
        "the field in inertial axes is held for a control period",
        "no torque along the field",
    ),
)
ROLE = "effector"
ACTS = OUTSIDE = True
NEEDS = ("two-body",)
ABOUT = "Earth"
READS = ("magnetic_field",)
LIMIT = Parameter("A m^2", above=0.0, shape=(3,), text="largest dipole along each body axis")
LIMITED = Parameter(
    choices=("together", "each"),
    text="dipoles beyond the limit are scaled down together, which keeps the torque's direction, or each is clipped",
)
"""The declaration of the dipole limit, common to all parts with magnetorquers."""


class Params(NamedTuple):
    """The dipole limit of the magnetorquers, and the epoch."""

    dipole_limit: Annotated[Vector, LIMIT]
    limited: Annotated[int, LIMITED] = 0
    epoch: Annotated[Date, EPOCH] = START
    mounting_error: Annotated[Vector, as_built.MOUNTING] = ZERO


class Numbers(NamedTuple):
    """The largest dipoles (A m2), how they are limited, the field, and the rotation of their mounting, () for none."""

    dipole_limit: Vector
    limited: int
    field: magnetic_field.Numbers
    mounted: as_built.Turn = ()


class State(NamedTuple):
    """The dipole (A m2, body axes) and the field (T, inertial axes) during a control period."""

    dipole: Vector
    field: Vector


class Sample(NamedTuple):
    """The recorded quantities of the magnetorquers."""

    magnetic_dipole: Annotated[Vector, Quantity("A m^2", "dipole of the magnetorquers, body axes", "axis")]


def prepare(params: Params, period: float) -> Numbers:
    """Return the numbers of a flight. Raise ValueError for an epoch at which the field is not known."""
    field, mounted = magnetic_field.prepared(params.epoch, period), as_built.turn_of(params.mounting_error)
    return Numbers(params.dipole_limit, params.limited, field, mounted)


def remember(params: Any) -> State:
    """Return the initial state: switched off."""
    return State(ZERO, ZERO)


def switch(state: State, wanted: Vector, measurement: Any, body: Any, params: Numbers, step: int) -> State:
    """Return the dipole for a wanted torque (N m) in the measured field, and the field at the craft."""
    dipole = within(dipole_for(wanted, measurement.magnetic_field), params.dipole_limit, params.limited)
    return State(as_built.in_body(params.mounted, dipole), magnetic_field.field_at(body.position, step, params.field))


def dipole_for(torque: Vector, field: Vector) -> Vector:
    """Return the least dipole (A m2) whose torque in a field (T) is the component of a torque (N m) across the field; zero
    without a field."""
    square = dot(field, field)
    return scale(where(less(0.0, square), divide(1.0, square), 0.0), cross(field, torque))


def within(dipole: Vector, limit: Vector, limited: int) -> Vector:
    """Return a dipole (A m2) within the limit of each axis, scaled down as a whole or clipped per axis."""

    def reduced(*dipole: Scalar) -> Vector:
        x, y, z = each(_filled, (dipole, limit))
        return scale(1.0 / maximum(maximum(maximum(x, y), z), 1.0), cast(Vector, dipole))

    if not limited:
        # Most dipoles are within their limits, and do not change.
        exceeds = reduce(either, each(_exceeds, (dipole, limit)))
        dipole = cast(Vector, when(exceeds, reduced, *dipole))
    cut: Any = each(clip, (dipole, limit))
    return cut


def _exceeds(dipole: Scalar, limit: Scalar) -> Truth:
    return less(limit, absolute(dipole))


def _filled(dipole: Scalar, limit: Scalar) -> Scalar:
    return absolute(dipole) / limit


def reaction(state: State, command: Any, body: Any, params: Any) -> Vector:
    """Return the torque on the body (N m)."""
    return cross(state.dipole, to_body(body.attitude, state.field))


def rates(state: State, command: Any, body: Any, acceleration: Vector, params: Any) -> Any:
    """Return no rates: nothing changes between control instants."""
    return None


def momentum(state: State, params: Any) -> Vector:
    """Return zero momentum (N m s)."""
    return ZERO


def applied(state: State, command: Any, body: Any, params: Numbers) -> Vector:
    """Return the torque on the body (N m)."""
    return reaction(state, command, body, params)


def record(state: State, command: Any, body: Any, params: Numbers) -> Sample:
    """Return the recorded quantities."""
    return Sample(state.dipole)


def examples() -> list[Params]:
    """Return those of a CubeSat, and larger, misaligned ones at another time."""
    large = Params((30.0, 30.0, 20.0), 1, (2027.0, 6.0, 21.0, 12.0, 30.0, 15.0), (0.01, -0.02, 0.0))
    return [Params((0.2, 0.2, 0.2)), large]
