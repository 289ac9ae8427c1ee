"""Rotation of a rigid body and motion of its centre of mass."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from starhold.algebra.operations import ABSENT
from starhold.algebra.quantity import Quantity
from starhold.algebra.quaternion import Quaternion, derivative, relative, renormalise, to_body
from starhold.algebra.scalar import Scalar, Truth, both, is_finite, less, side
from starhold.algebra.structure import rows
from starhold.algebra.vector import ZERO, Vector, add, apply, cross, dot, gyroscopic_torque, scale, subtract
from starhold.parts.contract import CLOCK, IS_VALID, Card
from starhold.parts.craft import Craft
from starhold.parts.quaternion_sign import SIGN_POLICIES as SIGN_POLICIES
from starhold.parts.roles import Goal, Loads, Scene

CARD = Card(
    title="Rigid body",
    summary="J w' = torque - w x J w, q' = q w/2, and the motion of the centre of mass",
    sources=("Fundamentals of Spacecraft Attitude Determination and Control (2014)",),
    assumptions=("rigid body", "constant inertia"),
)
ROLE = "body"
COMMAND = "torque"
"""Laws for this body define an equation of this name; the state has a field of this name for the torque that acts."""


class State(NamedTuple):
    """Attitude q_BN (inertial to body), rate omega_BN_B (rad/s), position and velocity (inertial; m, m/s), and the torque
    of the actuators (body, N m), which has its own dynamics if the actuators lag."""

    attitude: Quaternion
    rate: Vector
    position: Vector
    velocity: Vector
    torque: Vector


ROWS: Any = rows(State((1.0, 0.0, 0.0, 0.0), ZERO, ZERO, ZERO, ZERO))
"""The rows of each field in a table of states."""


class Measurement(NamedTuple):
    """Quantities that a law reads at a control instant; vectors are in body axes."""

    attitude: Annotated[Quaternion, Quantity("1", "rotation from the target axes to the body axes, scalar first")]
    rate: Annotated[Vector, Quantity("rad/s", "angular velocity relative to the target")]
    body_rate: Annotated[Vector, Quantity("rad/s", "absolute angular velocity")]
    target_rate: Annotated[Vector, Quantity("rad/s", "the target's angular velocity")]
    target_acceleration: Annotated[Vector, Quantity("rad/s^2", "derivative of target_rate in the rotating body axes")]
    external_torque: Annotated[Vector, Quantity("N m", "modelled torque from outside at this attitude")]
    position: Annotated[Vector, Quantity("m", "from the centre of attraction")]
    period: Annotated[float, Quantity("s", "for which the torque will be held")]
    wheel_momentum: Annotated[Vector, Quantity("N m s", "angular momentum of the body's wheels")] = ZERO
    magnetic_field: Annotated[Vector, Quantity("T", "as a magnetometer measures it; zero without one")] = ZERO
    time: Annotated[float, Quantity("s", 'since the start, for laws with `READS = ("time",)`; others must not use it')] = 0.0
    is_valid: Annotated[
        float,
        Quantity("1", '1 where the estimate that the law uses is valid, else 0, for laws with `READS = ("is_valid",)`'),
    ] = 1.0


class Sample(NamedTuple):
    """One recorded instant: the true state, the command, the error relative to the target."""

    attitude: Annotated[Quaternion, Quantity("1", "attitude, inertial to body, scalar first", "quaternion")]
    rate: Annotated[Vector, Quantity("rad/s", "angular velocity, body axes", "axis")]
    position: Annotated[Vector, Quantity("m", "position, inertial", "axis")]
    velocity: Annotated[Vector, Quantity("m/s", "velocity, inertial", "axis")]
    torque: Annotated[Vector, Quantity("N m", "torque applied by the actuators, body axes", "axis")]
    command: Annotated[Vector, Quantity("N m", "torque commanded, within the limits, body axes", "axis")]
    attitude_error: Annotated[Quaternion, Quantity("1", "turn from the target to the body, scalar first", "quaternion")]
    rate_error: Annotated[Vector, Quantity("rad/s", "angular velocity relative to the target, body axes", "axis")]


TIME_UNIT = "s"


def angular_acceleration(rate: Vector, torque: Vector, craft: Craft) -> Vector:
    """Return w' (rad/s2) from Euler's equation J w' = torque - w x J w."""
    return apply(craft.inverse_inertia, subtract(torque, gyroscopic_torque(craft.inertia, rate)))


def motion(
    state: State, torque: Vector, acceleration: Vector, torque_rate: Vector | None, craft: Craft, more: Any = None
) -> tuple[Quaternion, Vector, Vector, Vector, Vector | None]:
    """Return d(state)/dt under the total torque (body), the acceleration of the centre of mass (inertial) and the rate of
    the actuator torque (None: held). more: the inertia (3, 3; kg m2) that effectors add by back-substitution."""
    turning = derivative(state.attitude, state.rate)
    if more is None:
        spin = angular_acceleration(state.rate, torque, craft)
    else:
        spin = solve_symmetric(_plus(craft.inertia, more), subtract(torque, gyroscopic_torque(craft.inertia, state.rate)))
    return (turning, spin, state.velocity, acceleration, torque_rate)


def rates(state: State, loads: Loads, torque_rate: Vector | None, craft: Craft) -> Any:
    """Return d(state)/dt under all loads on the body. If an effector takes the command, the actuators' torque acts only on
    it."""
    torque = state.torque if loads.reaction is None else loads.reaction
    if loads.reaction is not None and loads.direct:
        torque = add(state.torque, torque)
    if loads.torque is not None:
        torque = add(torque, loads.torque)
    return motion(state, torque, loads.acceleration or ZERO, torque_rate, craft, loads.inertia)


def renormalised(state: State) -> State:
    """Return the state with its quaternion renormalised."""
    return state._replace(attitude=renormalise(state.attitude))


def is_sound(state: State, setup: Any) -> Truth:
    """Return whether the motion is finite, and turns by less than a radian in a substep."""
    turn = setup.substep * setup.substep * dot(state.rate, state.rate)
    finite = both(is_finite(state.attitude[0]), is_finite(dot(state.position, state.position)))
    return both(less(turn, 1.0), finite)


def side_of(state: State, goal: Goal) -> float:
    """Return the sign of the scalar part of the error quaternion, with which the sign policy begins."""
    return side(relative(goal.attitude, state.attitude)[0])


def observe(state: State, scene: Scene) -> Measurement:
    """Return the law's measurement of a state from sensors or estimators."""
    goal = scene.goal
    error = relative(goal.attitude, state.attitude)
    position = to_body(state.attitude, state.position)
    field: Vector = getattr(scene.readings, "magnetic_field", ZERO)
    time, is_valid = (getattr(scene.readings, name, ABSENT) for name in (CLOCK, IS_VALID))
    known: Any = (scene.torque, position, scene.period, scene.momentum, field, time, is_valid)
    if scene.still:
        # The arithmetic on the zeros of a target at rest is skipped here, because a compiler must not drop it.
        return Measurement(error, state.rate, state.rate, ZERO, ZERO, *known)
    target_rate, target_acceleration = to_body(error, goal.rate), to_body(error, goal.acceleration)
    error_rate = subtract(state.rate, target_rate)
    target_acceleration = subtract(target_acceleration, cross(error_rate, target_rate))
    return Measurement(error, error_rate, state.rate, target_rate, target_acceleration, *known)


def sample(state: State, goal: Goal, applied: Vector, command: Vector) -> Sample:
    """Return the recorded quantities; applied: the torque on the body (N m), which for wheels is that of motors and
    friction."""
    error = relative(goal.attitude, state.attitude)
    rate = subtract(state.rate, to_body(error, goal.rate))
    return Sample(state.attitude, state.rate, state.position, state.velocity, applied, command, error, rate)


def _plus(a: Any, b: Any) -> Any:
    """Return the sum of two inertias; the first may be three moments."""
    full = a if isinstance(a[0], tuple) else ((a[0], 0.0, 0.0), (0.0, a[1], 0.0), (0.0, 0.0, a[2]))
    return tuple(add(x, y) for x, y in zip(full, b, strict=True))


def solve_symmetric(m: Any, v: Vector) -> Vector:
    """Return the x with M x = v for a symmetric 3x3 matrix, by cofactors."""
    (a, b, c), (_, d, e), (_, _, f) = m
    p, q, r = d * f - e * e, c * e - b * f, b * e - c * d
    s = 1.0 / (a * p + b * q + c * r)
    y, z = a * f - c * c, b * c - a * e
    rows = ((p, q, r), (q, y, z), (r, z, a * d - b * b))
    return scale(s, (dot(rows[0], v), dot(rows[1], v), dot(rows[2], v)))


def kinetic_energy(rate: Vector, craft: Craft) -> Scalar:
    """Return the rotational energy (J)."""
    return 0.5 * dot(rate, apply(craft.inertia, rate))
