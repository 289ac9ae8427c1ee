"""On-off thrusters in pairs about each body axis, one for each sense: pulse-width modulation behind a Schmitt trigger."""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple, TypeAlias

from starhold.algebra.quantity import Quantity
from starhold.algebra.quaternion import to_reference
from starhold.algebra.scalar import Scalar, absolute, less, maximum, minimum, sign, where
from starhold.algebra.several import each, weighted
from starhold.algebra.vector import ZERO, Vector, add, cross, norm, scale, subtract, times
from starhold.parts import as_built
from starhold.parts.contract import Card, Parameter
from starhold.parts.pushes import MASS, MOVES, inverse_mass

CARD = Card(
    title="On-off thrusters",
    summary="full torque for t = |command| / torque of the control period, once |command| > on and until |command| < off",
    sources=("Spacecraft Dynamics and Control (1997): reaction pulses, Schmitt trigger, pulse-width modulation",),
    assumptions=(
        "torques in pairs about the body axes but for the mounting error, at once on and at once off",
        'the torque alone, unless moves_orbit = "yes": then what the forces of the layout leave pushes the orbit',
        "a pulse begins with the control period; of a substep in which it ends the torque is the mean",
        "the propellant that is spent leaves mass and inertia as they are",
    ),
)
ROLE = "effector"
ACTS = OUTSIDE = True
KNOWN = ("torque",)
"""Pulse widths are computed from it."""
GRAVITY = 9.80665
"""Standard gravity (m/s2), by which a specific impulse is given in seconds."""
Row: TypeAlias = tuple[float, float, float, float, float, float, float, float]
OFF = 1e-6
"""Relative difference allowed between the torque of a layout and `torque`."""


class Params(NamedTuple):
    """The torque of a pair, its firing thresholds, its propellant, and the layout of its thrusters."""

    torque: Annotated[Vector, Parameter("N m", above=0.0, shape=(3,), text="of a pair about each body axis that fires")]
    minimum: Annotated[float, Parameter("s", at_least=0.0, text="shortest time that a pair is on")] = 0.0
    on: Annotated[Vector, Parameter("N m", at_least=0.0, shape=(3,), text="command above which a pair begins to fire")] = (
        ZERO
    )
    off: Annotated[Vector, Parameter("N m", at_least=0.0, shape=(3,), text="command below which it ends; at most `on`")] = (
        ZERO
    )
    pulses: Annotated[
        int, Parameter(choices=("modulated", "whole"), text="as long as commanded, or a whole control period")
    ] = 0
    lever: Annotated[float, Parameter("m", above=0.0, text="arm of a thruster about its axis")] = 1.0
    specific_impulse: Annotated[float, Parameter("s", above=0.0, text="of the propellant")] = 220.0
    mounting_error: Annotated[Vector, as_built.MOUNTING] = ZERO
    layout: Annotated[
        tuple[Row, ...],
        Parameter(
            "1, 1, m, m, m, N, N, N",
            columns=("axis", "sense", "x", "y", "z", "force_x", "force_y", "force_z"),
            text="thrusters that fire for a torque about an axis (1, 2 or 3) in a sense (1 or -1): place from the centre of "
            "mass and force on the spacecraft, body axes; together they give `torque`",
        ),
    ] = ()
    moves_orbit: Annotated[int, MOVES] = 0
    mass: Annotated[float, MASS] = math.inf


class Numbers(NamedTuple):
    """The parameters, the control period (s), the propellant per impulse of torque (kg/(N m s)), the rotation of their
    mounting, () for none, and the acceleration of the body by each axis in the positive and in the negative sense (m/s2,
    along the mounting), () if the orbit is not moved."""

    torque: Vector
    minimum: Scalar
    on: Vector
    off: Vector
    pulses: int
    period: Scalar
    propellant: Scalar
    mounted: as_built.Turn = ()
    pushes: tuple[tuple[Vector, ...], ...] = ()


class State(NamedTuple):
    """For each axis: the sense in which its thrusters fire (-1, 0, 1), the time left (s), and the total impulse of their
    torque since the start, both senses added (N m s)."""

    firing: Vector
    left: Vector
    impulse: Vector


class Sample(NamedTuple):
    """The recorded quantities of the thrusters."""

    thruster_time: Annotated[Vector, Quantity("s", "time on in each control period, signed", "axis")]
    thruster_impulse: Annotated[Vector, Quantity("N m s", "impulse of the thrusters' torque, either way", "axis")]
    propellant: Annotated[float, Quantity("kg", "propellant spent")]


def prepare(params: Params, period: float) -> Numbers:
    """Return the numbers that equations take, for a control period (s). Raise ValueError if thresholds, the shortest pulse
    or the layout do not fit, and for a force without a mass."""
    if any(off > on for off, on in zip(params.off, params.on, strict=True)):
        raise ValueError("a pair cannot stop firing at a command above that at which it starts: off must be at most on")
    if params.minimum > period:
        raise ValueError(f"the shortest pulse must be at most the control period of {period:g} s, not {params.minimum:g} s")
    spent = 1.0 / (params.lever * params.specific_impulse * GRAVITY)
    inverse, forces, pushes = inverse_mass(params.moves_orbit, params.mass), _forces(params.layout, params.torque), ()
    if inverse is not None:
        if not forces:
            raise ValueError("thrusters that move the orbit need a layout: where each is, and its force")
        pushes = tuple(tuple(scale(inverse, force) for force in sense) for sense in forces)
    return Numbers(*params[:5], period, spent, as_built.turn_of(params.mounting_error), pushes)


def _forces(layout: tuple[Row, ...], torque: Vector) -> tuple[tuple[Vector, ...], ...]:
    """Return the net force (N) of the thrusters for each axis in positive and negative sense, () without a layout."""
    forces, torques = ([[ZERO] * 3, [ZERO] * 3] for _ in range(2))
    for axis, sense, *numbers in layout:
        if axis not in (1.0, 2.0, 3.0) or sense not in (1.0, -1.0):
            raise ValueError(f"a thruster of the layout is for axis 1, 2 or 3 and sense 1 or -1, not {axis:g} and {sense:g}")
        k, i = int(sense < 0.0), int(axis) - 1
        place, force = (numbers[0], numbers[1], numbers[2]), (numbers[3], numbers[4], numbers[5])
        forces[k][i], torques[k][i] = add(forces[k][i], force), add(torques[k][i], cross(place, force))
    for k, sign_of in enumerate((1.0, -1.0) if layout else ()):
        for i, given in enumerate(torques[k]):
            wanted = tuple(sign_of * torque[i] if j == i else 0.0 for j in range(3))
            if not norm(subtract(given, wanted)) <= OFF * torque[i]:  # pyright: ignore[reportArgumentType]
                shown = f"[{', '.join(f'{x:.6g}' for x in given)}] N m, not [{', '.join(f'{x:.6g}' for x in wanted)}]"
                raise ValueError(f"the layout's thrusters for axis {i + 1} and sense {sign_of:g} give {shown}")
    return tuple(map(tuple, forces)) if layout else ()


def remember(params: Numbers) -> State:
    """Return the initial state: nothing fires."""
    return State(ZERO, ZERO, ZERO)


def switch(state: State, wanted: Vector, measurement: Any, body: Any, params: Numbers, step: int) -> State:
    """Return the state with the pairs that fire in this control step, and for how long, for a wanted torque (N m)."""
    firing: Any = each(_trigger, (wanted, state.firing, params.on, params.off))
    left: Any = each(_width, (wanted, firing, params.torque), params)
    return State(firing, left, state.impulse)


def _trigger(wanted: Scalar, firing: Scalar, on: Scalar, off: Scalar) -> Scalar:
    threshold = where(less(0.0, firing * wanted), off, on)
    return where(less(threshold, absolute(wanted)), sign(wanted), 0.0)


def _width(wanted: Scalar, firing: Scalar, torque: Scalar, params: Numbers) -> Scalar:
    demanded = params.period * (absolute(wanted) / torque)
    width = params.period if params.pulses else minimum(maximum(demanded, params.minimum), params.period)
    return absolute(firing) * width


def pulse(state: State, substep: Scalar, params: Numbers) -> Vector:
    """Return the share of a substep for which each pair is on, with its sense."""
    share: Any = each(_share, (state.firing, state.left), substep)
    return share


def _share(firing: Scalar, left: Scalar, substep: Scalar) -> Scalar:
    return firing * minimum(maximum(left / substep, 0.0), 1.0)


def reaction(state: State, command: Vector, body: Any, params: Numbers) -> Vector:
    """Return the torque on the body (N m)."""
    return as_built.in_body(params.mounted, times(params.torque, command))


def push(state: State, command: Vector, body: Any, params: Numbers) -> Vector | None:
    """Return the acceleration of the centre of mass (inertial, m/s2), None if the orbit is not moved."""
    if not params.pushes:
        return None
    shares = (*each(maximum, (command, ZERO)), *(maximum(-share, 0.0) for share in command))
    given = weighted(shares, (*params.pushes[0], *params.pushes[1]))
    return to_reference(body.attitude, as_built.in_body(params.mounted, given))


def rates(state: State, command: Vector, body: Any, acceleration: Vector, params: Numbers) -> Any:
    """Return d(state)/dt: the time left decreases, the impulse grows."""
    share: Any = each(absolute, (command,))
    return State(None, scale(-1.0, share), times(params.torque, share))  # pyright: ignore[reportArgumentType]


def momentum(state: State, params: Numbers) -> Vector:
    """Return zero momentum (N m s)."""
    return ZERO


def applied(state: State, command: Vector, body: Any, params: Numbers) -> Vector:
    """Return the mean torque of the control period that begins (N m)."""
    given = scale(1.0 / params.period, times(params.torque, times(state.firing, state.left)))
    return as_built.in_body(params.mounted, given)


def record(state: State, command: Vector, body: Any, params: Numbers) -> Sample:
    """Return the recorded quantities."""
    x, y, z = state.impulse
    return Sample(times(state.firing, state.left), state.impulse, params.propellant * (x + y + z))


def examples() -> list[Params]:
    """Return pairs of 20 mN m with a trigger, misaligned ones that fire for whole control periods, and single thrusters."""
    single = (
        (1.0, (0.0, 0.2, 0.0), (0.0, 0.0, 0.1)),
        (2.0, (0.0, 0.0, 0.2), (0.1, 0.0, 0.0)),
        (3.0, (0.2, 0.0, 0.0), (0.0, 0.1, 0.0)),
    )
    rows: Any = [(axis, s, *place, *(s * x for x in force)) for axis, place, force in single for s in (1.0, -1.0)]
    return [
        Params((0.02, 0.02, 0.02), 0.02, (5e-3, 5e-3, 5e-3), (2e-3, 2e-3, 2e-3), lever=0.5),
        Params((0.05, 0.04, 0.03), 0.0, (0.01, 0.01, 0.01), (4e-3, 4e-3, 4e-3), 1, mounting_error=(0.0, 0.01, 0.02)),
        Params((0.02, 0.02, 0.02), 0.02, layout=tuple(rows), moves_orbit=1, mass=12.0),
    ]
