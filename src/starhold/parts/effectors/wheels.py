"""Reaction wheels: the allocation of a wanted torque, motors and friction, and the torque on the body.

The state of a wheel is the absolute axial momentum h = inertia (W + a . rate) of its rotor (N m s): a is its unit axis in
body axes, W its speed relative to the body. With the wheels' axial inertia subtracted from the body's (`bare_inertia`),

    J' w' = on_body + external - w x J' w,        h_i' = motor_i

hold exactly; the momentum of the whole is J' w + sum a_i h_i."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial, reduce
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.quantity import Quantity
from starhold.algebra.scalar import Scalar, Truth, absolute, both, clip, either, less, less_equal, plus, where
from starhold.algebra.several import each, weighted
from starhold.algebra.structured import Buffer, repeat, when
from starhold.algebra.vector import Vector, add, cross, dot, scale
from starhold.parts.contract import Card, Envelope, Push
from starhold.parts.craft import vector
from starhold.parts.effectors.envelope import authority, check_authority, facets_of
from starhold.parts.effectors.layouts import pyramid, three_orthogonal
from starhold.parts.effectors.wheel_arrays import axial, checked_axes, checked_column, least_squares
from starhold.parts.effectors.wheel_motion import (
    as_known,
    at_top_speed,
    limited,
    shaken,
    slopes,
    speeds,
    sticking,
    top_speeds,
)

CARD = Card(
    title="Reaction wheels",
    summary="h' = motor torque - friction about each spin axis; the body feels -sum a h' - w x sum a h",
    sources=("published study of control by reaction wheels with the largest degree of stability",),
    assumptions=("rotors balanced except as stated", "rigid bearings"),
)
ROLE = "effector"
TABLE = "wheels"
BODY = "rigid-body"
ACTS = True

Numbers = tuple[Scalar, ...]
"""A number for each wheel."""
Rows = tuple[Vector, ...]
"""A vector for each wheel: motor torque i is row i times the wanted body torque."""

BAND = 0.01
"""Over this last share of the momentum range the motor's outward torque fades linearly to zero at the limit."""
CREEP = 1.0
"""Below this relative speed (rad/s) Coulomb friction is proportional to the speed: with a jump at standstill, any
fixed-step integrator would chatter there."""

ALLOCATIONS = ("least-squares", "least-peak")
"""The allocation rules."""


class Wheels(NamedTuple):
    """N wheels: unit spin axes (body), rotor inertias about them (kg m2), largest motor torques (N m; 0 for a lost wheel),
    largest axial momenta (N m s), viscous (N m s) and Coulomb friction (N m); and how a torque is allocated, by least
    squares (a row for each wheel, zero for one that takes no part) or with the least peak, which needs `with_facets`."""

    axes: tuple[Vector, ...]
    inertia: Numbers
    torque_limit: Numbers
    momentum_limit: Numbers
    viscous: Numbers
    coulomb: Numbers
    least: Rows
    allocation: int = 0
    """The allocation rule, an index into ALLOCATIONS."""
    facets: Buffer | tuple[()] = ()
    """The pieces of `allocate_peak`, of 6 + 3 N numbers each: a normal, an edge, and a row for each wheel. Torques in the
    cone above a facet of the envelope have the peak |normal . torque|, and among the pieces of one facet the largest |edge
    . torque| decides."""
    sticking: Numbers = ()
    """Static friction beyond Coulomb's (N m), its speeds (rad/s), power limits of the motors (W), and two torques (N m at 1
    rad/s) that turn with each rotor; () for none. See `wheel_motion`."""
    stribeck_speed: Numbers = ()
    power_limit: Numbers = ()
    unbalanced: tuple[Rows, ...] = ()
    known_axes: Rows = ()
    """The axes that laws and allocation assume for misaligned wheels; () for aligned wheels."""

    SIZES_IN_COMMON = ("axes",)  # pyright: ignore
    """Kernels merge numbers of these fields that differ in sign alone: a pyramid's wheel needs one product for all axes."""


Params = Wheels


class State(NamedTuple):
    """The absolute momentum of each rotor about its axis (N m s), and the angles (turns) of unbalanced rotors."""

    momentum: Numbers
    angle: Numbers = ()


class Sample(NamedTuple):
    """The recorded quantities of the wheels."""

    wheel_momentum: Annotated[Numbers, Quantity("N m s", "angular momentum of each rotor about its spin axis", "wheel")]
    wheel_torque: Annotated[Numbers, Quantity("N m", "rate of that momentum: the motor's torque and friction", "wheel")]
    wheel_command: Annotated[Numbers, Quantity("N m", "commanded torque of each motor", "wheel")]
    wheel_available: Annotated[
        Numbers, Quantity("N m", "largest torque of the motor in that direction at its present momentum", "wheel")
    ]


def prepare(params: Wheels, period: float) -> Wheels:
    """Return the wheels, prepared for their allocation."""
    return with_facets(params) if params.allocation else params


def with_facets(wheels: Wheels) -> Wheels:
    """Return the wheels with the facets that `allocate_peak` needs. Their number depends only on the number of wheels, so
    one kernel serves before and after a loss."""
    return wheels._replace(facets=facets_of(as_known(wheels).axes, wheels.least))


def remember(params: Wheels) -> State:
    """Return the initial state: rotors at rest."""
    return State((0.0,) * len(params.axes), (0.0,) * len(params.unbalanced))


def command(applied: Vector, params: Wheels) -> Numbers:
    """Return the motor torques (N m) for a wanted torque on the body (N m)."""
    return allocate_peak(applied, params) if params.allocation else allocate(applied, params)


def reaction(state: State, command: Numbers, body: Any, params: Wheels) -> Vector:
    """Return the torque of the wheels on the body (N m)."""
    h, rate = state.momentum, body.rate
    torque = on_body(motor(command, h, rate, params, _rubs(params)), h, rate, params)
    return add(torque, shaken(state.angle, h, rate, params)) if params.unbalanced else torque


def rates(state: State, command: Numbers, body: Any, acceleration: Vector, params: Wheels) -> State:
    """Return d(momentum)/dt of each rotor (N m), and the speeds (turns/s) of unbalanced rotors."""
    turning = speeds(state.momentum, body.rate, params) if params.unbalanced else ()
    given = motor(command, state.momentum, body.rate, params, _rubs(params))
    return State(given, tuple(x * (0.5 / math.pi) for x in turning))


def momentum(state: State, params: Wheels) -> Vector:
    """Return the rotors' momentum in body axes (N m s)."""
    return wheel_momentum(state.momentum, params)


def measured_momentum(state: State, params: Wheels) -> Vector:
    """Return this momentum as measured by tachometers, with the assumed axes (N m s)."""
    return wheel_momentum(state.momentum, as_known(params))


def record(state: State, command: Numbers, body: Any, params: Wheels) -> Sample:
    """Return the recorded quantities."""
    h = state.momentum
    return Sample(
        h, motor(command, h, body.rate, params), command, available(command, h, limited(command, h, body.rate, params))
    )


def applied(state: State, command: Numbers, body: Any, params: Wheels) -> Vector:
    """Return the torque of motors and friction on the body (N m)."""
    return scale(-1.0, weighted(motor(command, state.momentum, body.rate, params), params.axes))


def error(params: Wheels, envelope: Envelope) -> Push:
    """Return a bound on the difference between the wheels' torque and the command due to friction, for rotors within their
    momentum limits; unbalanced wheels on a turning body have no bound, and misaligned wheels state none."""
    if params.unbalanced or params.known_axes:
        return Push(math.inf)
    A, viscous = np.array(params.axes), np.array(params.viscous)
    speeds = np.array(params.momentum_limit) / np.array(params.inertia)
    most = np.where(viscous > 0.0, viscous, 0.0) * np.where(viscous > 0.0, speeds, 0.0) + np.array(params.coulomb)
    most = most + np.array(params.sticking) if params.sticking else most
    stretch = float(np.linalg.norm(A, 2))
    return Push(stretch * float(np.linalg.norm(most)), stretch**2 * float(viscous.max()))


def fastest(params: Wheels) -> float:
    """Return the fastest rate (1/s) at which friction stops a rotor, including Coulomb friction within CREEP, or the top
    speed of unbalanced rotors."""
    columns = zip(params.viscous, params.coulomb, params.inertia, slopes(params), strict=True)
    friction = max((viscous + coulomb / CREEP + slope) / inertia for viscous, coulomb, inertia, slope in columns)
    return max(friction, *top_speeds(params)) if params.unbalanced else friction


def examples() -> list[Wheels]:
    """Return three wheels along the axes, with friction, and a pyramid of four."""
    return [make_wheels(three_orthogonal(), 1e-3, 0.05, 0.4, 1e-5, 1e-4), make_wheels(pyramid(), 1e-3, 0.05, 0.4)]


def allocate(torque: Vector, wheels: Wheels) -> Numbers:
    """Return the motor torques (N m) with the least sum of squares that give the body this torque (N m), -sum a_i tau_i =
    torque. Limits and friction are ignored; a lost wheel gets zero."""
    return each(dot, (wheels.least,), torque)


def allocate_peak(torque: Vector, wheels: Wheels) -> Numbers:
    """Return the motor torques (N m) that give the body this torque (N m) with the least peak, and among those with the
    least next largest one. They are continuous and piecewise linear in the torque. Limits and friction are ignored; a lost
    wheel gets zero. Not for exact polynomials, which cannot compare pieces with pieces.

    By duality the least peak is the largest |y . torque| with sum |y . a_k| = 1, and the largest is reached where y is
    normal to two of the axes: all other wheels give the peak, and the two follow from the torque (facets of a zonotope, the
    torque envelope; Markley, Reynolds, Liu, Lebsock 2010, Maximum Torque and Momentum Envelopes for Reaction-Wheel Arrays).
    """
    facets, width = wheels.facets, 6 + 3 * len(wheels.axes)
    if not isinstance(facets, Buffer):
        raise TypeError("these wheels have no facets: see parts.effectors.wheels.with_facets")

    def piece(k: Any) -> tuple[Any, ...]:
        n0, n1, n2, e0, e1, e2, *rows = facets.row(k, width)
        shared = each(dot, (tuple(zip(rows[::3], rows[1::3], rows[2::3], strict=True)),), torque)
        return absolute(dot((n0, n1, n2), torque)), absolute(dot((e0, e1, e2), torque)), *shared

    def better(k: Any, *best: Scalar) -> tuple[Any, ...]:
        candidate = piece(k + 1)
        # Where two facets have the same peak, both give the same torques.
        inner = both(less_equal(best[0], candidate[0]), less(best[1], candidate[1]))
        wins = either(less(best[0], candidate[0]), inner)
        return tuple(where(wins, new, old) for new, old in zip(candidate, best, strict=True))

    return repeat(facets.size // width - 1, better, *piece(0))[2:]


def motor(command: Numbers, momentum: Numbers, rate: Vector, wheels: Wheels, rubs: Truth = True) -> Numbers:
    """Return d(momentum)/dt of each wheel (N m) under the commanded motor torques (N m), at axial momenta (N m s) and body
    rate (rad/s): the command within the torque limit, faded out where it would carry the momentum beyond its limit (see
    BAND), and friction against the speed relative to the body (see CREEP). Limits may be infinite. rubs: False omits
    friction that is zero, which may change the sign of a zero but no motion."""
    limit = limited(command, momentum, rate, wheels).torque_limit
    given = each(_driven, (command, momentum, limit, wheels.momentum_limit))
    # Reciprocals of constants, which a compiler takes out of the loop over the lanes.
    inverse = tuple(1.0 / inertia for inertia in wheels.inertia)

    def braked(*given: Scalar) -> Numbers:
        columns = (given, momentum, inverse, wheels.axes, wheels.viscous, wheels.coulomb)
        # Row by row: within a branch, assembling short vectors costs more than it saves.
        return tuple(map(partial(_braked, rate), *columns))

    given = when(rubs, braked, *given)
    return tuple(map(plus, given, sticking(momentum, rate, wheels))) if wheels.sticking else given


def _rubs(wheels: Wheels) -> Truth:
    """Return whether there is friction that `motor` must include; most bearings are modelled as ideal."""
    return less(0.0, reduce(plus, (*wheels.viscous, *wheels.coulomb)))


def _driven(command: Scalar, momentum: Scalar, torque_limit: Scalar, momentum_limit: Scalar) -> Scalar:
    return _room(command, momentum, momentum_limit) * clip(command, torque_limit)


def _braked(
    rate: Vector, given: Scalar, momentum: Scalar, inverse: Scalar, axis: Vector, viscous: Scalar, coulomb: Scalar
) -> Scalar:
    speed = momentum * inverse - dot(axis, rate)
    return given - viscous * speed - coulomb * clip(speed * (1.0 / CREEP), 1.0)


def _room(command: Scalar, momentum: Scalar, limit: Scalar) -> Scalar:
    """Return the share of its torque that a motor has at this momentum in the direction of the command."""
    # The sign goes to the constant: the product is the same, and a held command decides on it once for all stages.
    inverse = 1.0 / limit
    filled = momentum * where(less(0.0, command), inverse, -inverse)
    return _fraction((1.0 - filled) * (1.0 / BAND))


def available(command: Numbers, momentum: Numbers, wheels: Wheels) -> Numbers:
    """Return the largest torque of each motor in the direction of its command (N m): its torque limit, faded out near its
    momentum limit."""
    return each(_available, (command, momentum, wheels.torque_limit, wheels.momentum_limit))


def _available(command: Scalar, momentum: Scalar, torque_limit: Scalar, momentum_limit: Scalar) -> Scalar:
    room = _room(command, momentum, momentum_limit)
    # A zero share of an infinite torque counts as zero.
    return where(less(0.0, room), room * torque_limit, 0.0)


def _fraction(x: Scalar) -> Scalar:
    # A minimum and a maximum, each one instruction.
    most = where(less(x, 1.0), x, 1.0)
    return where(less(most, 0.0), 0.0, most)


def on_body(momentum_rate: Numbers, momentum: Numbers, rate: Vector, wheels: Wheels) -> Vector:
    """Return the torque of the wheels on the body (N m): -sum a_i h_i' - rate x sum a_i h_i."""
    turning = add(weighted(momentum_rate, wheels.axes), cross(rate, wheel_momentum(momentum, wheels)))
    return scale(-1.0, turning)


def wheel_momentum(momentum: Numbers, wheels: Wheels) -> Vector:
    """Return the wheels' momentum in body axes (N m s): sum a_i h_i."""
    return weighted(momentum, wheels.axes)


def make_wheels(
    axes: Sequence[Sequence[float]],
    inertia: float | Sequence[float],
    torque_limit: float | Sequence[float],
    momentum_limit: float | Sequence[float],
    viscous: float | Sequence[float] = 0.0,
    coulomb: float | Sequence[float] = 0.0,
) -> Wheels:
    """Return validated wheels from N spin axes (body; any length) and, for all or for each, rotor inertia (kg m2), torque
    limit (N m; 0 for a wheel that takes no part), momentum limit (N m s), viscous (N m s) and Coulomb friction (N m).
    Limits may be infinite.

    Raise ValueError if a number is out of range, there are more than MOST wheels, fewer than three working wheels have
    independent axes (it names the body direction without authority), or they lie so close to a plane that the matrix of
    axes has a condition number above 1000.
    """
    matrix = checked_axes(axes)
    count = len(matrix)
    columns = (
        checked_column("rotor inertia", inertia, count, least=None),
        checked_column("torque limit", torque_limit, count, least=0.0, infinite=True),
        checked_column("momentum limit", momentum_limit, count, least=None, infinite=True),
        checked_column("viscous friction", viscous, count, least=0.0),
        checked_column("Coulomb friction", coulomb, count, least=0.0),
    )
    working = [i for i in range(count) if columns[1][i] > 0.0]
    check_authority(matrix[working], "the wheels give" if len(working) == count else "the working wheels give")
    return Wheels(_rows(matrix), *columns, _rows(least_squares(matrix, working)))


def lose(wheels: Wheels, index: int) -> Wheels:
    """Return the wheels after one of them (`index` counts from 0, messages from 1) has lost its motor: it takes no part in
    the allocation, its torque limit is 0, and its rotor coasts down by friction.

    Raise ValueError if there is no such wheel, or the others have no torque about three axes (it names the body direction
    without authority).
    """
    count = len(wheels.axes)
    if not 0 <= index < count:
        raise ValueError(f"there is no wheel {index + 1}; the wheels are 1 to {count}")
    limits = tuple(0.0 if i == index else limit for i, limit in enumerate(wheels.torque_limit))
    working = [i for i in range(count) if limits[i] > 0.0]
    matrix = np.array(as_known(wheels).axes)
    check_authority(matrix[working], f"without wheel {index + 1} the others give")
    return wheels._replace(torque_limit=limits, least=_rows(least_squares(matrix, working)), facets=())


def capacity(state: State, params: Wheels) -> float:
    """Return the norm (N m s) of the momentum that wheels in this initial state can store in every direction before a motor
    fades, with least-squares allocation; 0 if one fades already."""
    total = momentum(state, params)
    columns = zip(params.least, params.momentum_limit, state.momentum, strict=True)
    # The null-space part of the momenta stays in the rotors.
    rooms = [((1.0 - BAND) * limit - abs(h + dot(row, total)), math.sqrt(dot(row, row))) for row, limit, h in columns]
    return max(0.0, min(room / share for room, share in rooms if share > 0.0))


def sure_torque(params: Wheels, kind: Literal["axis", "norm"]) -> float:
    """Return the torque (N m) available in every direction by the allocation, in norm or about each axis at once."""
    return authority(at_top_speed(as_known(params)), kind, peak=params.allocation == ALLOCATIONS.index("least-peak"))


def shared_as(params: Wheels, known: Wheels, like: Wheels | None = None) -> Wheels:
    """Return the wheels with the allocation and the momentum measurement of the wheels that laws assume, if these are as
    many. like: the wheels of a loop of the same form, for recorded numbers, which cannot be compared."""
    if len(params.axes) != len(known.axes):
        return params
    axes = as_known(known).axes
    same = axes == params.axes if like is None else not like.known_axes
    return params._replace(least=known.least, known_axes=() if same else axes)


def axial_inertia(params: Wheels) -> NDArray[np.float64]:
    """Return the inertia of the rotors about their assumed axes (3, 3; kg m2)."""
    return axial(np.array(as_known(params).axes), np.array(params.inertia))


def gives_allocated_torque(wheels: Wheels) -> bool:
    """Return whether, within the wheels' limits, the torque on the body is the allocated one, and the momentum given to
    laws is correct: it is not while the allocation still uses a lost wheel, nor for misaligned wheels, even a lost one that
    still turns."""
    if wheels.known_axes:
        return False
    working = [(axis, row) for axis, row, limit in zip(wheels.axes, wheels.least, wheels.torque_limit, strict=True) if limit]
    axes, rows = (
        (np.array(part).reshape(-1, 3) for part in zip(*working, strict=True)) if working else (np.zeros((1, 3)),) * 2
    )
    return bool(np.abs(axes.T @ rows + np.eye(3)).max() < 1e-9)


def _rows(matrix: NDArray[np.float64]) -> tuple[Vector, ...]:
    return tuple(vector(row) for row in matrix)
