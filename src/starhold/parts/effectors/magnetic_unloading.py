"""Magnetorquers unload the momentum of the wheels, under any law."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from starhold.algebra.quantity import Quantity
from starhold.algebra.scalar import Scalar
from starhold.algebra.vector import ZERO, Vector, norm, scale, subtract
from starhold.parts import as_built, magnetic_field
from starhold.parts.contract import Card, Envelope, Parameter, Push
from starhold.parts.effectors import magnetorquers
from starhold.parts.effectors.magnetorquers import LIMIT, LIMITED, State, dipole_for, within
from starhold.parts.epoch import EPOCH, START, Date

CARD = Card(
    title="Magnetic unloading",
    summary="M = m x B with m = -gain B_m x (h - momentum) / |B_m|^2 within the dipole limit, h of the wheels",
    sources=(magnetic_field.SOURCE, "Spacecraft Dynamics and Control (1997): momentum unloading, cross-product law"),
    assumptions=(
        *magnetorquers.CARD.assumptions[:-1],
        "its torque is unknown to all laws; the wheels absorb it as they hold the attitude",
        "momentum along the field stays until the field has turned",
    ),
)
ROLE = "effector"
OUTSIDE = True
NEEDS = ("two-body", "wheels")
ABOUT = "Earth"
READS = ("magnetic_field",)


class Params(NamedTuple):
    """The unloading gain, the dipoles of the magnetorquers, and the epoch."""

    gain: Annotated[float, Parameter("1/s", above=0.0, text="share of the momentum across the field taken out in a second")]
    dipole_limit: Annotated[Vector, LIMIT]
    limited: Annotated[int, LIMITED] = 0
    momentum: Annotated[
        Vector, Parameter("N m s", shape=(3,), spread=False, text="that the wheels are to keep, body axes")
    ] = ZERO
    epoch: Annotated[Date, EPOCH] = START
    mounting_error: Annotated[Vector, as_built.MOUNTING] = ZERO


class Numbers(NamedTuple):
    """The gain (1/s), the largest dipoles (A m2), how they are limited, the momentum to keep (N m s), the field, and the
    rotation of their mounting, () for none."""

    gain: Scalar
    dipole_limit: Vector
    limited: int
    momentum: Vector
    field: magnetic_field.Numbers
    mounted: as_built.Turn = ()


class Sample(NamedTuple):
    """The recorded quantities of the unloading."""

    unloading_dipole: Annotated[Vector, Quantity("A m^2", "dipole that unloads the wheels, body axes", "axis")]
    unloading_torque: Annotated[Vector, Quantity("N m", "torque that unloads the wheels, body axes", "axis")]


def prepare(params: Params, period: float) -> Numbers:
    """Return the numbers of a flight. Raise ValueError for an epoch at which the field is not known."""
    mounted = as_built.turn_of(params.mounting_error)
    return Numbers(*params[:4], magnetic_field.prepared(params.epoch, period), mounted)


def switch(state: State, wanted: Vector, measurement: Any, body: Any, params: Numbers, step: int) -> State:
    """Return the dipole for the wheels' momentum in the measured field, and the field at the craft."""
    torque = scale(-params.gain, subtract(measurement.wheel_momentum, params.momentum))
    dipole = within(dipole_for(torque, measurement.magnetic_field), params.dipole_limit, params.limited)
    return State(as_built.in_body(params.mounted, dipole), magnetic_field.field_at(body.position, step, params.field))


remember, reaction, rates, momentum = (
    magnetorquers.remember,
    magnetorquers.reaction,
    magnetorquers.rates,
    magnetorquers.momentum,
)


def record(state: State, command: Any, body: Any, params: Numbers) -> Sample:
    """Return the recorded quantities."""
    return Sample(state.dipole, reaction(state, command, body, params))


def bound(params: Params, envelope: Envelope) -> Push:
    """Return a bound on the norm of the torque: that of all dipoles in the strongest field of the orbit, or the torque
    demanded by the momentum, if that is less.

    The limits make no dipole longer: |m| <= gain |h - momentum| / |B_m|, so |m x B| <= |m| |B_m| + |m| |B - B_m| is at most
    gain |h - momentum| plus the torque of the dipoles in the field's error. h is the total minus the body's momentum.
    """
    limit = norm(params.dipole_limit)
    full = limit * magnetic_field.strongest(params.epoch, envelope.distance)
    for_momentum = params.gain * (envelope.momentum + norm(params.momentum)) + limit * envelope.field_error
    if as_built.is_given(params.mounting_error):
        return Push(full)
    return Push(full) if full <= for_momentum else Push(for_momentum, params.gain * envelope.moment)


def examples() -> list[Params]:
    """Return slow unloading by a CubeSat's magnetorquers, and fast unloading, misaligned, that leaves a bias."""
    askew = Params(0.02, (30.0, 30.0, 20.0), 1, (0.0, 0.01, 0.0), mounting_error=(0.0, 0.01, 0.02))
    return [Params(1e-3, (0.2, 0.2, 0.2)), askew]
