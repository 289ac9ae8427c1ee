"""Bending modes of appendages, as from finite elements: small deflections relative to a rigid hub."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

import numpy as np

from starhold.algebra.quantity import Quantity
from starhold.algebra.scalar import Scalar
from starhold.algebra.several import each, weighted
from starhold.algebra.vector import Matrix, Vector, cross, dot, scale, subtract
from starhold.parts.contract import Card, Parameter
from starhold.parts.craft import Craft, tensor, total_inertia

CARD = Card(
    title="Flexible modes",
    summary="x_i'' + 2 damping f x_i' + f^2 x_i = -d_i.w'; the body feels -sum d_i x_i'' - w x sum d_i x_i'",
    sources=("Spacecraft Dynamics and Control (1997): hybrid coordinates",),
    assumptions=(
        "small deflections, which leave the inertia as it is",
        "cantilever modes of unit modal mass, whose coupling includes the recoil of the craft's centre of mass",
        "gravity acts on the craft as if nothing were deflected",
    ),
)
ROLE = "effector"
COLUMNS = ("frequency", "damping", "coupling_x", "coupling_y", "coupling_z", "deflection")


class Params(NamedTuple):
    """A row for each mode."""

    modes: Annotated[
        tuple[tuple[float, ...], ...],
        Parameter(
            "rad/s, 1, sqrt(kg) m, sqrt(kg) m",
            columns=COLUMNS,
            text="frequency with the hub held fast; damping ratio; angular momentum about the craft's centre of mass per "
            "modal speed; modal deflection at the start",
        ),
    ]


class Numbers(NamedTuple):
    """For each mode: stiffness f^2 (1/s2), damper 2 damping f (1/s), coupling and initial deflection."""

    stiffness: tuple[Scalar, ...]
    damping: tuple[Scalar, ...]
    coupling: tuple[Vector, ...]
    deflection: tuple[Scalar, ...]


class State(NamedTuple):
    """The deflection of each mode (sqrt(kg) m) and its rate."""

    deflection: tuple[Scalar, ...]
    rate: tuple[Scalar, ...]


class Sample(NamedTuple):
    """The recorded quantities of the modes."""

    mode_deflection: Annotated[tuple[float, ...], Quantity("sqrt(kg) m", "modal deflection of each mode", "mode")]
    mode_rate: Annotated[tuple[float, ...], Quantity("sqrt(kg) m/s", "rate of that deflection", "mode")]


def prepare(params: Params, period: float) -> Numbers:
    """Return the numbers that equations take. Raise ValueError for no mode, a frequency not above 0 or a damping below
    0."""
    if not params.modes:
        raise ValueError("there is no mode")
    for number, (frequency, damping, *_) in enumerate(params.modes, 1):
        if not (frequency > 0.0 and damping >= 0.0):
            raise ValueError(f"mode {number} needs a frequency above 0 and a damping of at least 0")
    rows = [(f * f, 2.0 * damping * f, (x, y, z), at) for f, damping, x, y, z, at in params.modes]
    return Numbers(*zip(*rows, strict=True))


def check(params: Numbers, craft: Craft) -> None:
    """Raise ValueError if the modes have more inertia than the craft, so that the hub's would be negative."""
    rest = tensor(total_inertia(craft)) + np.array(inertia(remember(params), params))
    moments = np.linalg.eigvalsh(rest)
    if moments[0] <= 0.0:
        shown = ", ".join(f"{moment:g}" for moment in moments)
        raise ValueError(f"the modes carry more inertia than the craft has: without them its principal moments are {shown}")


def remember(params: Numbers) -> State:
    """Return the initial state: the modes deflected, at rest."""
    return State(params.deflection, (0.0,) * len(params.deflection))


def _spring(stiffness: Scalar, damping: Scalar, deflection: Scalar, rate: Scalar) -> Scalar:
    return stiffness * deflection + damping * rate


def springs(state: State, params: Numbers) -> tuple[Scalar, ...]:
    """Return the forces of springs and dampers on the modes (sqrt(kg) m/s2), with the sign of the deflection."""
    return each(_spring, (params.stiffness, params.damping, state.deflection, state.rate))


def reaction(state: State, command: Any, body: Any, params: Numbers) -> Vector:
    """Return the torque of the modes on the body (N m)."""
    return subtract(weighted(springs(state, params), params.coupling), cross(body.rate, momentum(state, params)))


def inertia(state: State, params: Numbers) -> Matrix:
    """Return the inertia (kg m2) to add to the body's own in its angular acceleration, -sum d d^T."""

    def row(axis: int) -> Vector:
        return scale(-1.0, weighted(tuple(d[axis] for d in params.coupling), params.coupling))

    return (row(0), row(1), row(2))


def rates(state: State, command: Any, body: Any, acceleration: Vector, params: Numbers) -> State:
    """Return d(deflections, rates)/dt."""
    pairs = zip(springs(state, params), params.coupling, strict=True)
    return State(state.rate, tuple(-spring - dot(coupling, acceleration) for spring, coupling in pairs))


def momentum(state: State, params: Numbers) -> Vector:
    """Return the modes' angular momentum relative to the body (N m s)."""
    return weighted(state.rate, params.coupling)


def record(state: State, command: Any, body: Any, params: Numbers) -> Sample:
    """Return the recorded quantities."""
    return Sample(state.deflection, state.rate)


def fastest(params: Params) -> float:
    """Return the fastest rate (1/s) of a mode with the hub fixed."""
    return max((row[0] for row in params.modes), default=0.0)


def examples() -> list[Params]:
    """Return a bending and a torsion mode, and one without damping."""
    return [
        Params(((0.6, 0.005, 0.3, 0.0, 0.1, 0.0), (2.4, 0.005, 0.0, 0.2, 0.0, 0.01))),
        Params(((1.5, 0.0, 0.0, 0.5, 0.2, 0.05),)),
    ]
