"""Rigid panels on hinges with springs and dampers, whose motion moves the centre of mass and changes the inertia.

The body axes are those of the hub; the inertia is that of the whole with all panels in their rest positions. About the
centre of mass of the whole, which shifts as panels swing, the angular momentum is H = (J + dJ(x)) w + sum A_i(x) x_i', with
x_i the angles of the hinges. Panels interact through the acceleration of that centre, three numbers, which are solved for
first, so the work grows with the number of panels and not with its cube."""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

import numpy as np

from starhold.algebra.circular import cosine_sine
from starhold.algebra.quantity import Quantity
from starhold.algebra.scalar import Scalar
from starhold.algebra.vector import (
    ZERO,
    Matrix,
    Vector,
    add,
    apply,
    combine,
    cross,
    diagonal,
    dot,
    inverse,
    multiply,
    scale,
    subtract,
    transpose,
)
from starhold.parts.contract import Card, Parameter
from starhold.parts.craft import Craft, check_inertia, tensor, total_inertia, vector

CARD = Card(
    title="Hinged panels",
    summary="D_i x_i'' + damping x_i' + stiffness x_i = -A_i.w' - terms in the rates; the body feels the panels' momentum",
    sources=("Lagrange's equations of a hub with rigid panels on hinges",),
    assumptions=(
        "rigid panels, springs and dampers linear in the angle",
        "the craft's inertia and centre of mass are those of the whole with every panel at its rest, angle zero",
        "a panel's principal axes are the hinge's, that towards its centre of mass, and their normal",
        "gravity acts on the craft as if no panel were deflected",
    ),
)
ROLE = "effector"
_NONE: Matrix = (ZERO, ZERO, ZERO)
COLUMNS = (
    "mass",
    *(f"{what}_{axis}" for what in ("hinge", "axis", "centre") for axis in "xyz"),
    "about_hinge",
    "about_centre_line",
    "about_normal",
    "stiffness",
    "damping",
    "angle",
)


class Params(NamedTuple):
    """The mass of the craft, and a row for each panel."""

    mass: Annotated[float, Parameter("kg", above=0.0, text="of the whole craft")]
    panels: Annotated[
        tuple[tuple[float, ...], ...],
        Parameter(
            "kg, m, 1, m, kg m^2, N m/rad, N m s/rad, rad",
            columns=COLUMNS,
            text="mass; a point of the hinge, from the craft's centre of mass; direction of the hinge; centre of mass "
            "of the panel, from that point; moments of inertia about that centre; spring; damper; angle at the start",
        ),
    ]


class Panel(NamedTuple):
    """A panel in the form that equations take: mass, the point on its hinge nearest its centre of mass (m), unit vectors
    along the hinge, towards the centre and normal to both, the distance of the centre (m), moments about these axes (kg
    m2), the inverse of the inertia about the hinge (1/(kg m2)), spring, damper, and initial angle."""

    mass: Scalar
    hinge: Vector
    axis: Vector
    out: Vector
    normal: Vector
    length: Scalar
    moments: Vector
    inverse: Scalar
    stiffness: Scalar
    damping: Scalar
    angle: Scalar


class Numbers(NamedTuple):
    """The panels, the mass of the whole (kg) and its inverse, and the panels' inertia in their rest positions (kg m2)."""

    panels: tuple[Panel, ...]
    mass: Scalar
    inverse: Scalar
    rest: Matrix


class State(NamedTuple):
    """The angle (rad) and the rate (rad/s) of each hinge."""

    angle: tuple[Scalar, ...]
    rate: tuple[Scalar, ...]


class Sample(NamedTuple):
    """The recorded quantities of the panels."""

    panel_angle: Annotated[tuple[float, ...], Quantity("rad", "angle of each panel about its hinge", "panel")]
    panel_rate: Annotated[tuple[float, ...], Quantity("rad/s", "rate of that angle", "panel")]


class _Swung(NamedTuple):
    """A panel at its angle: its rate, its axes towards the centre and normal, its centre of mass relative to that of the
    craft (m), and per unit of rate its momentum (kg m) and its angular momentum about the craft's centre (kg m2)."""

    panel: Panel
    angle: Scalar
    rate: Scalar
    out: Vector
    normal: Vector
    place: Vector
    pushed: Vector
    turned: Vector


def prepare(params: Params, period: float) -> Numbers:
    """Return the numbers that equations take. Raise ValueError for impossible panels."""
    panels = tuple(_panel(k, row) for k, row in enumerate(params.panels, 1))
    if not panels:
        raise ValueError("there is no panel")
    if not sum(panel.mass for panel in panels) < params.mass:
        raise ValueError(f"the panels together must have less than the craft's mass of {params.mass:g} kg")
    still = Numbers(panels, params.mass, 1.0 / params.mass, _NONE)
    return still._replace(rest=_whole(*_swung(State((0.0,) * len(panels), (0.0,) * len(panels)), still), still))


def check(params: Numbers, craft: Craft) -> None:
    """Raise ValueError if the hub, the craft without these panels, would have a negative inertia."""
    masses = np.array([panel.mass for panel in params.panels])
    places = np.array([np.array(panel.hinge) + panel.length * np.array(panel.out) for panel in params.panels])
    hub = params.mass - masses.sum()
    centre = vector(-(masses @ places) / hub)
    try:
        check_inertia(tensor(total_inertia(craft)) - np.array(combine(1.0, params.rest, 1.0, _point(hub, centre))))
    except ValueError as error:
        raise ValueError(f"without its panels the craft of {params.mass:g} kg is no body: {error}") from None


def _panel(number: int, row: tuple[float, ...]) -> Panel:
    mass, *places, about, along, across, stiffness, damping, angle = row
    point, axis, centre = np.array(places).reshape(3, 3)
    if not (mass > 0.0 and min(about, along, across) >= 0.0 and stiffness >= 0.0 and damping >= 0.0):
        raise ValueError(f"panel {number} needs a mass above 0, and moments, stiffness and damping of at least 0")
    if not axis.any():
        raise ValueError(f"the hinge of panel {number} has no direction")
    a = axis / np.linalg.norm(axis)
    out = centre - a * (a @ centre)
    length = float(np.linalg.norm(out))
    if not length > 1e-9 * np.linalg.norm(centre):
        raise ValueError(f"the centre of mass of panel {number} lies on its hinge")
    e = out / length
    return Panel(
        mass,
        vector(point + centre - out),
        vector(a),
        vector(e),
        vector(np.cross(a, e)),
        length,
        (about, along, across),
        1.0 / (about + mass * length**2),
        stiffness,
        damping,
        angle,
    )


def remember(params: Numbers) -> State:
    """Return the initial state: panels at rest at their angles."""
    return State(tuple(panel.angle for panel in params.panels), (0.0,) * len(params.panels))


def _swung(state: State, params: Numbers) -> tuple[list[_Swung], Vector]:
    """Return the panels at their angles, and the shift of the craft's centre of mass (m)."""
    shift: Vector = ZERO
    placed: list[tuple[Vector, Vector, Vector]] = []
    for panel, angle in zip(params.panels, state.angle, strict=True):
        cosine, sine = cosine_sine(angle * (0.5 / math.pi))
        out = add(scale(cosine, panel.out), scale(sine, panel.normal))
        normal = subtract(scale(cosine, panel.normal), scale(sine, panel.out))
        shift = add(shift, scale(panel.mass * panel.length * params.inverse, subtract(out, panel.out)))
        placed.append((out, normal, add(panel.hinge, scale(panel.length, out))))
    panels: list[_Swung] = []
    for panel, angle, rate, (out, normal, place) in zip(params.panels, state.angle, state.rate, placed, strict=True):
        place, pushed = subtract(place, shift), scale(panel.mass * panel.length, normal)
        turned = add(scale(panel.moments[0], panel.axis), cross(place, pushed))
        panels.append(_Swung(panel, angle, rate, out, normal, place, pushed, turned))
    return panels, shift


def _whole(swung: list[_Swung], shift: Vector, params: Numbers) -> Matrix:
    """Return the panels' contribution to the inertia about the craft's present centre of mass (kg m2), up to a constant."""
    total = _point(-params.mass, shift)
    for one in swung:
        axes = (one.panel.axis, one.out, one.normal)
        parts = [_outer(size, axis, axis) for size, axis in zip(one.panel.moments, axes, strict=True)]
        for part in (*parts, _point(one.panel.mass, add(one.place, shift))):
            total = combine(1.0, total, 1.0, part)
    return total


def _outer(c: Scalar, a: Vector, b: Vector) -> Matrix:
    """Return c a b^T."""
    x, y, z = scale(c, a)
    return (scale(x, b), scale(y, b), scale(z, b))


def _point(mass: Scalar, place: Vector) -> Matrix:
    """Return the inertia of a point mass (kg m2)."""
    square = dot(place, place)
    return combine(mass, diagonal((square, square, square)), -mass, _outer(1.0, place, place))


def _moving(swung: list[_Swung], params: Numbers) -> Vector:
    """Return the velocity of the centre of mass due to the panels (m/s)."""
    total = ZERO
    for one in swung:
        total = add(total, scale(one.rate * params.inverse, one.pushed))
    return total


def _moments(swung: list[_Swung], rate: Vector, params: Numbers) -> list[Scalar]:
    """Return the moments about the hinges (N m) due to springs, dampers and rates."""
    moving, pulled = _moving(swung, params), ZERO
    for one in swung:
        pulled = add(pulled, scale(one.panel.mass * one.panel.length * params.inverse * one.rate * one.rate, one.out))
    moments: list[Scalar] = []
    for one in swung:
        panel = one.panel
        turning = (panel.moments[1] - panel.moments[2]) * (dot(one.out, rate) * dot(one.normal, rate))
        carried = add(cross(rate, subtract(cross(rate, one.place), scale(2.0, moving))), pulled)
        spring = panel.stiffness * one.angle + panel.damping * one.rate
        moments.append(turning - dot(one.pushed, carried) - spring)
    return moments


def _shared(swung: list[_Swung], params: Numbers) -> Matrix:
    """Return the inverse of the hinges' coupling through the centre of mass, 1 - sum p p^T / (mass D)."""
    coupling: Matrix = diagonal((1.0, 1.0, 1.0))
    for one in swung:
        coupling = combine(1.0, coupling, -1.0, _outer(params.inverse * one.panel.inverse, one.pushed, one.pushed))
    return inverse(coupling)


def _accelerations(swung: list[_Swung], moments: list[Scalar], params: Numbers) -> list[Scalar]:
    """Return the hinges' accelerations (rad/s2) under these moments (N m), coupled by the acceleration of the centre."""
    pushing = ZERO
    for one, moment in zip(swung, moments, strict=True):
        pushing = add(pushing, scale(moment * one.panel.inverse, one.pushed))
    centre = scale(params.inverse, apply(_shared(swung, params), pushing))
    pairs = zip(swung, moments, strict=True)
    return [one.panel.inverse * (moment + dot(one.pushed, centre)) for one, moment in pairs]


def reaction(state: State, command: Any, body: Any, params: Numbers) -> Vector:
    """Return the torque of the panels on the body (N m)."""
    swung, shift = _swung(state, params)
    w, moving = body.rate, _moving(swung, params)
    carried = add(apply(inertia_change(state, params), w), momentum(state, params))
    # The rate of change of the inertia times w, and of the hinges' momentum.
    given = scale(-params.mass, _swept(shift, moving, w))
    for one, speeding in zip(swung, _accelerations(swung, _moments(swung, w, params), params), strict=True):
        panel = one.panel
        along, across = dot(one.out, w), dot(one.normal, w)
        given = add(given, scale(panel.mass, _swept(add(one.place, shift), _speed(one), w)))
        turned = add(scale(along, one.normal), scale(across, one.out))
        given = add(given, scale((panel.moments[1] - panel.moments[2]) * one.rate, turned))
        given = subtract(given, scale(panel.mass * panel.length * one.rate * one.rate, cross(one.place, one.out)))
        given = add(given, scale(speeding, one.turned))
    return scale(-1.0, add(cross(w, carried), given))


def _speed(one: _Swung) -> Vector:
    return scale(one.rate * one.panel.length, one.normal)


def _swept(place: Vector, speed: Vector, rate: Vector) -> Vector:
    """Return the rate of change of the inertia of a moving unit mass, times a rate."""
    twice = scale(2.0 * dot(place, speed), rate)
    return subtract(twice, add(scale(dot(place, rate), speed), scale(dot(speed, rate), place)))


def inertia(state: State, params: Numbers) -> Matrix:
    """Return the inertia (kg m2) to add to the body's own in its angular acceleration."""
    swung, _ = _swung(state, params)
    total, coupled = inertia_change(state, params), _NONE
    for one in swung:
        share = one.panel.inverse
        total = combine(1.0, total, -1.0, _outer(share, one.turned, one.turned))
        coupled = combine(1.0, coupled, 1.0, _outer(share, one.pushed, one.turned))
    through = multiply(transpose(coupled), multiply(_shared(swung, params), coupled))
    return combine(1.0, total, -params.inverse, through)


def inertia_change(state: State, params: Numbers) -> Matrix:
    """Return the inertia of the whole minus that with the panels in their rest positions (kg m2)."""
    return combine(1.0, _whole(*_swung(state, params), params), -1.0, params.rest)


def rates(state: State, command: Any, body: Any, acceleration: Vector, params: Numbers) -> State:
    """Return d(angles, rates)/dt."""
    swung, _ = _swung(state, params)
    moments = _moments(swung, body.rate, params)
    left = [moment - dot(one.turned, acceleration) for one, moment in zip(swung, moments, strict=True)]
    return State(state.rate, tuple(_accelerations(swung, left, params)))


def momentum(state: State, params: Numbers) -> Vector:
    """Return the panels' angular momentum relative to the body (N m s)."""
    total = ZERO
    for one in _swung(state, params)[0]:
        total = add(total, scale(one.rate, one.turned))
    return total


def record(state: State, command: Any, body: Any, params: Numbers) -> Sample:
    """Return the recorded quantities."""
    return Sample(state.angle, state.rate)


def fastest(params: Params) -> float:
    """Return the fastest rate (1/s) at which a panel swings, or its damper stops it, on a hub that moves freely but does
    not turn."""
    largest = 0.0
    for panel in prepare(params, 1.0).panels:
        swung = 1.0 / panel.inverse - (panel.mass * panel.length) ** 2 / params.mass
        largest = max(largest, math.sqrt(panel.stiffness / swung), panel.damping / swung)
    return largest


def examples() -> list[Params]:
    """Return two wings with different hinges, one of them deflected, and one panel that swings freely."""
    wing = (0.4, 0.5, 0.1, 0.0, 0.0, 1.0, 0.1, 0.6, 0.1, 0.0, 0.01, 0.005, 0.015, 0.2, 0.01)
    other = (0.3, -0.5, 0.0, 0.1, 0.1, 1.0, 0.0, -0.7, 0.0, 0.05, 0.012, 0.005, 0.016, 0.3, 0.0)
    return [Params(30.0, ((*wing, 0.15), (*other, 0.0))), Params(30.0, ((*wing[:-2], 0.0, 0.0, -0.1),))]
