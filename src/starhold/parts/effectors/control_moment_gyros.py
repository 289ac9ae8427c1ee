"""Variable-speed control-moment gyros: their steering, their motion, and their torque on the body.

Each unit has a gimbal about an axis g fixed in the body, and in it a rotor about s, which turns with the gimbal; t = g x s.
With h the momentum of the rotor relative to the body about s, Js, Jt, Jg the moments of gimbal and rotor together about s,
t and g, Jr the rotor's about s, w_s and w_t the body's rate about s and t, p = h + (Js - Jt) w_s, and x the gimbal's angle,

    h' = rotor motor - Jr (s.w' + w_t x'),        Jg (x'' + g.w') = gimbal motor + p w_t

hold exactly, and the body feels -(rotor motor) s - x' b - (gimbal motor + p w_t) g with b = p t + (Js - Jr - Jt) w_t s.

The steering gives the wanted torque with gimbal rates and rotor torques, each as a share y of its limit, that minimise the
sum of y^2 of the gimbals and y^2 / weight of the rotors. The weight is small except near singularities of the gimbals,
where the gimbals have no torque in some direction and the rotors supply it."""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

import numpy as np

from starhold.algebra.circular import cosine_sine
from starhold.algebra.quantity import Quantity
from starhold.algebra.scalar import Scalar, clip, maximum
from starhold.algebra.several import each
from starhold.algebra.vector import (
    IDENTITY,
    ZERO,
    Matrix,
    Vector,
    add,
    apply,
    combine,
    cross,
    determinant,
    dot,
    most,
    scale,
    solve,
    subtract,
)
from starhold.parts.contract import Card, Parameter
from starhold.parts.craft import vector
from starhold.parts.effectors.wheels import Numbers, Wheels, available

CARD = Card(
    title="Control-moment gyros",
    summary="-sum (h x' t + motor s) = torque with least gimbal rates x' and, next to singularities, rotor torques",
    sources=(
        "Feedback Control Law for Variable Speed Control Moment Gyros (1998)",
        "Analytical Mechanics of Space Systems (2018): variable-speed control moment gyros",
    ),
    assumptions=(
        "balanced rotors, rigid frictionless bearings",
        "the craft's inertia is that of the whole spacecraft with every gimbal at angle zero and its rotors at rest",
        "steering knows the body's rate, angles and speeds without error, and acts all the time",
        "the gimbals' servo makes up for the moment that the turning body has on them, within the motors' limits",
        "no null motion: rotors are not brought back to their speeds, nor gimbals turned away from singularities",
        "gravity acts on the craft as if every gimbal were at angle zero",
    ),
)
ROLE = "effector"
ACTS = True
COLUMNS = (
    *(f"{what}_{axis}" for what in ("gimbal", "spin") for axis in "xyz"),
    "rotor_inertia",
    "about_spin",
    "about_transverse",
    "about_gimbal",
    "gimbal_rate_limit",
    "gimbal_torque_limit",
    "rotor_torque_limit",
    "momentum_limit",
    "angle",
    "momentum",
)
PERPENDICULAR = 1e-6
"""Cosine of the angle from which on axes do not count as perpendicular."""
FLOOR = 1e-12
"""Regularisation, as a share of the mean square torque, that keeps the steering finite where neither gimbals nor rotors
have torque in some direction."""


class Params(NamedTuple):
    """A row for each unit, and the parameters of the steering."""

    units: Annotated[
        tuple[tuple[float, ...], ...],
        Parameter(
            "1, 1, kg m^2, rad/s, N m, N m, N m s, rad, N m s",
            columns=COLUMNS,
            text="direction of the gimbal; of the spin axis at gimbal angle zero; moment of the rotor about it; moments of "
            "gimbal and rotor together about spin, transverse and gimbal axis; largest commanded gimbal rate (0: "
            "none); largest torques of the gimbal's and the rotor's motor (0: a rotor that nothing drives); largest "
            "momentum of the rotor relative to the body; gimbal angle and that momentum at the start",
        ),
    ]
    bandwidth: Annotated[float, Parameter("1/s", above=0.0, text="at which gimbal rates follow their commands")] = 10.0
    rotor_weight: Annotated[
        float, Parameter("1", at_least=0.0, text="of the rotors' torques beside gimbal rates, at a singularity")
    ] = 1.0
    singularity: Annotated[
        float,
        Parameter("1", above=0.0, text="determinant of the gimbals' torques, 1 at its best, at which that weight is a 16th"),
    ] = 0.1
    damping: Annotated[
        float,
        Parameter("1", at_least=0.0, text="at a singularity, of gimbal rates at the cost of torque; for undriven rotors"),
    ] = 0.0


class Unit(NamedTuple):
    """A unit in the form that equations take: unit vectors of the gimbal axis, and of the spin and transverse axes at angle
    zero; the rotor's moment, the unit's moments about spin, transverse and gimbal axis (kg m2), and the inverse of the
    last; limits of the gimbal's rate (rad/s) and motor (N m)."""

    gimbal: Vector
    spin: Vector
    transverse: Vector
    rotor_inertia: Scalar
    about_spin: Scalar
    about_transverse: Scalar
    about_gimbal: Scalar
    inverse: Scalar
    rate_limit: Scalar
    torque_limit: Scalar


class Prepared(NamedTuple):
    """The units, their rotors with their limits, the initial state, the mean square torque of the gimbals about an axis at
    their largest rate (N2 m2) and the inverse of its cube, and the parameters of the steering."""

    units: tuple[Unit, ...]
    rotors: Wheels
    start: State
    square: Scalar
    cube: Scalar
    bandwidth: Scalar
    rotor_weight: Scalar
    singularity: Scalar
    damping: Scalar


class State(NamedTuple):
    """The angle (rad) and rate (rad/s) of each gimbal, and the momentum of each rotor relative to the body (N m s)."""

    angle: Numbers
    rate: Numbers
    momentum: Numbers


class Sample(NamedTuple):
    """The recorded quantities of the units."""

    gimbal_angle: Annotated[Numbers, Quantity("rad", "angle of each gimbal", "gyro")]
    gimbal_rate: Annotated[Numbers, Quantity("rad/s", "rate of each gimbal", "gyro")]
    gimbal_rate_command: Annotated[Numbers, Quantity("rad/s", "commanded rate of each gimbal", "gyro")]
    gimbal_torque: Annotated[Numbers, Quantity("N m", "torque of each gimbal's motor", "gyro")]
    rotor_momentum: Annotated[Numbers, Quantity("N m s", "momentum of each rotor relative to the body", "gyro")]
    rotor_torque: Annotated[Numbers, Quantity("N m", "torque of each rotor's motor", "gyro")]
    gimbal_determinant: Annotated[float, Quantity("1", "of the gimbals' torques, 0 at a singularity")]


class Turned(NamedTuple):
    """A unit at its gimbal angle: spin and transverse axes, the body's rate about the transverse axis (rad/s), minus the
    torque on the body per unit of gimbal rate (N m s), and the moment of the turning body on the gimbal (N m)."""

    unit: Unit
    spin: Vector
    transverse: Vector
    across: Scalar
    column: Vector
    load: Scalar


def prepare(params: Params, period: float) -> Prepared:
    """Return the numbers that equations take. Raise ValueError for units that cannot be, or lack torque about an axis."""
    units: list[Unit] = []
    reach, squares = np.zeros((3, 3)), 0.0
    for number, row in enumerate(params.units, 1):
        unit = _unit(number, row)
        *_, torque_limit, momentum_limit, _, stored = row
        if not (torque_limit >= 0.0 and momentum_limit > 0.0 and abs(stored) <= momentum_limit):
            raise ValueError(
                f"the rotor of unit {number} needs a torque limit of at least 0, a momentum limit above 0, and a momentum "
                "within it"
            )
        if unit.rate_limit * stored:
            reach += np.eye(3) - np.outer(unit.gimbal, unit.gimbal)
        if torque_limit:
            reach += np.outer(unit.spin, unit.spin)
        squares += (unit.rate_limit * stored) ** 2 / 3.0
        units.append(unit)
    if not squares:
        raise ValueError("there is no unit with momentum in a gimbal that turns")
    if np.linalg.eigvalsh(reach)[0] < PERPENDICULAR:
        raise ValueError("the units give no torque about some axis: two gimbals that are not parallel are needed")
    *_, torques, momenta, angles, stored = zip(*params.units, strict=True)
    none = (0.0,) * len(units)
    rotors = Wheels(
        tuple(unit.spin for unit in units), tuple(unit.rotor_inertia for unit in units), torques, momenta, none, none, ()
    )
    return Prepared(tuple(units), rotors, State(angles, none, stored), squares, squares**-3, *params[1:])


def _unit(number: int, row: tuple[float, ...]) -> Unit:
    gimbal, spin = np.array(row[:6]).reshape(2, 3)
    rotor, about_spin, about_transverse, about_gimbal, rate_limit, torque_limit = row[6:12]
    for name, axis in (("gimbal", gimbal), ("spin axis", spin)):
        if not axis.any():
            raise ValueError(f"the {name} of unit {number} has no direction")
    g, s = gimbal / np.linalg.norm(gimbal), spin / np.linalg.norm(spin)
    if abs(g @ s) > PERPENDICULAR:
        raise ValueError(f"the spin axis of unit {number} is not perpendicular to its gimbal")
    if not (0.0 < rotor <= about_spin and about_transverse > 0.0 and about_gimbal > 0.0):
        raise ValueError(f"unit {number} needs moments of inertia above 0, of the rotor at most about_spin")
    if not (rate_limit >= 0.0 and torque_limit > 0.0):
        raise ValueError(f"the gimbal of unit {number} needs a rate limit of at least 0 and a torque limit above 0")
    t = np.cross(g, s)
    t /= np.linalg.norm(t)
    axes = vector(g), vector(np.cross(t, g)), vector(t)
    return Unit(*axes, rotor, about_spin, about_transverse, about_gimbal, 1.0 / about_gimbal, rate_limit, torque_limit)


def remember(params: Prepared) -> State:
    """Return the initial state: gimbals at rest at their angles."""
    return params.start


def command(applied: Vector, params: Prepared) -> Vector:
    """Return the wanted torque on the body (N m): its steering depends on the gimbal angles."""
    return applied


def turned(state: State, rate: Vector, params: Prepared) -> tuple[Turned, ...]:
    """Return the units at their gimbal angles, on a body that turns at this rate (rad/s)."""
    return each(_turned, (params.units, state.angle, state.momentum), rate)


def _turned(unit: Unit, angle: Scalar, stored: Scalar, rate: Vector) -> Turned:
    cosine, sine = cosine_sine(angle * (0.5 / math.pi))
    spin = add(scale(cosine, unit.spin), scale(sine, unit.transverse))
    transverse = subtract(scale(cosine, unit.transverse), scale(sine, unit.spin))
    across = dot(transverse, rate)
    carried = stored + (unit.about_spin - unit.about_transverse) * dot(spin, rate)
    frame = unit.about_spin - unit.rotor_inertia - unit.about_transverse
    column = add(scale(carried, transverse), scale(frame * across, spin))
    return Turned(unit, spin, transverse, across, column, carried * across)


class Steered(NamedTuple):
    """The demanded gimbal rates (rad/s) and rotor torques (N m), and the determinant of the gimbals' torques."""

    rate: Numbers
    torque: Numbers
    determinant: Scalar


def steer(units: tuple[Turned, ...], wanted: Vector, params: Prepared) -> Steered:
    """Return the gimbal rates (rad/s) and rotor torques (N m) that together give the body this torque (N m); if one would
    exceed its limit, all are scaled down, so that the torque keeps its direction."""
    turning = tuple(scale(one.unit.rate_limit, one.column) for one in units)
    driving = tuple(scale(limit, one.spin) for limit, one in zip(params.rotors.torque_limit, units, strict=True))
    by_gimbals = _gram(turning)
    size = determinant(by_gimbals) * params.cube
    # A power of a fraction in place of the published exponential: it can be differentiated as a rational function.
    share = params.singularity / (params.singularity + maximum(size, 0.0))
    share = share * share
    share = share * share
    weight, kept = params.rotor_weight * share, params.square * (params.damping * share + FLOOR)
    together = combine(1.0, combine(1.0, by_gimbals, weight, _gram(driving)), kept, IDENTITY)
    way = solve(together, scale(-1.0, wanted))
    rates, torques = each(dot, (turning,), way), tuple(weight * dot(one, way) for one in driving)
    within = 1.0 / maximum(1.0, most((*rates, *torques)))
    return Steered(
        tuple(within * y * one.unit.rate_limit for y, one in zip(rates, units, strict=True)),
        tuple(within * y * limit for y, limit in zip(torques, params.rotors.torque_limit, strict=True)),
        size,
    )


def _gram(columns: tuple[Vector, ...]) -> Matrix:
    """Return the sum of a a^T."""

    def row(axis: int) -> Vector:
        total = ZERO
        for one in columns:
            total = add(total, scale(one[axis], one))
        return total

    return (row(0), row(1), row(2))


def motors(state: State, units: tuple[Turned, ...], wanted: Vector, params: Prepared) -> tuple[Numbers, Numbers]:
    """Return the torques of the gimbals' motors and of the rotors' motors (N m)."""
    demanded = steer(units, wanted, params)
    gimbals = each(_servo, (units, state.rate, demanded.rate), params.bandwidth)
    return gimbals, each(clip, (demanded.torque, available(demanded.torque, state.momentum, params.rotors)))


def _servo(one: Turned, rate: Scalar, demanded: Scalar, bandwidth: Scalar) -> Scalar:
    unit = one.unit
    return clip(unit.about_gimbal * bandwidth * (demanded - rate) - one.load, unit.torque_limit)


def applied(state: State, command: Vector, body: Any, params: Prepared) -> Vector:
    """Return the torque of gimbals and motors on the body (N m), without the terms in its angular acceleration."""
    units = turned(state, body.rate, params)
    torque = ZERO
    for one, rate, gimbal, rotor in zip(units, state.rate, *motors(state, units, command, params), strict=True):
        felt = add(scale(rate, one.column), scale(gimbal + one.load, one.unit.gimbal))
        torque = subtract(torque, add(scale(rotor, one.spin), felt))
    return torque


def reaction(state: State, command: Vector, body: Any, params: Prepared) -> Vector:
    """Return the torque of the units on the body (N m)."""
    carried = add(momentum(state, params), apply(inertia_change(state, params), body.rate))
    return subtract(applied(state, command, body, params), cross(body.rate, carried))


def inertia(state: State, params: Prepared) -> Matrix:
    """Return the inertia (kg m2) to add to the body's own in its angular acceleration: rotors and gimbals keep turning
    about their own axes."""
    total = inertia_change(state, params)
    for one in turned(state, ZERO, params):
        unit = one.unit
        total = combine(1.0, total, -unit.rotor_inertia, _gram((one.spin,)))
        total = combine(1.0, total, -unit.about_gimbal, _gram((unit.gimbal,)))
    return total


def inertia_change(state: State, params: Prepared) -> Matrix:
    """Return the inertia of the whole minus that with all gimbals at angle zero (kg m2)."""
    total: Matrix = (ZERO, ZERO, ZERO)
    for one in turned(state, ZERO, params):
        more = combine(1.0, _gram((one.spin,)), -1.0, _gram((one.unit.spin,)))
        total = combine(1.0, total, one.unit.about_spin - one.unit.about_transverse, more)
    return total


def rates(state: State, command: Vector, body: Any, acceleration: Vector, params: Prepared) -> State:
    """Return d(angles, rates, momenta)/dt."""
    units = turned(state, body.rate, params)
    columns = (units, state.rate, *motors(state, units, command, params))
    return State(state.rate, each(_speeding, columns, acceleration), each(_spinning, columns, acceleration))


def _speeding(one: Turned, rate: Scalar, gimbal: Scalar, rotor: Scalar, acceleration: Vector) -> Scalar:
    return (gimbal + one.load) * one.unit.inverse - dot(one.unit.gimbal, acceleration)


def _spinning(one: Turned, rate: Scalar, gimbal: Scalar, rotor: Scalar, acceleration: Vector) -> Scalar:
    return rotor - one.unit.rotor_inertia * (dot(one.spin, acceleration) + one.across * rate)


def momentum(state: State, params: Prepared) -> Vector:
    """Return the units' angular momentum relative to the body (N m s)."""
    total = ZERO
    for one, rate, stored in zip(turned(state, ZERO, params), state.rate, state.momentum, strict=True):
        turning = scale(one.unit.about_gimbal * rate, one.unit.gimbal)
        total = add(total, add(scale(stored, one.spin), turning))
    return total


def record(state: State, command: Vector, body: Any, params: Prepared) -> Sample:
    """Return the recorded quantities."""
    units = turned(state, body.rate, params)
    gimbals, rotors = motors(state, units, command, params)
    demanded = steer(units, command, params)
    return Sample(state.angle, state.rate, demanded.rate, gimbals, state.momentum, rotors, demanded.determinant)


def fastest(params: Params) -> float:
    """Return the bandwidth (1/s) of the fastest gimbal servo."""
    return params.bandwidth


def examples() -> list[Params]:
    """Return four variable-speed units in a pyramid, and four with undriven rotors."""
    flat, up = math.sqrt(2.0 / 3.0), math.sqrt(1.0 / 3.0)
    around = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))
    unit = (8e-4, 1e-3, 6e-4, 8e-4, 1.0, 0.2)

    def pyramid(*rest: float) -> tuple[tuple[float, ...], ...]:
        return tuple((flat * x, flat * y, up, -y, x, 0.0, *unit, *rest) for x, y in around)

    return [Params(pyramid(0.01, 0.6, 0.2, 0.4)), Params(pyramid(0.0, 0.6, 0.0, 0.4), damping=0.01)]
