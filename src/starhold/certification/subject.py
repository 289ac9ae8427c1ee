"""The loop a certificate speaks of, and bounds on what acts on it from outside."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from flint import arb, fmpq

from starhold.algebra.polynomial import Polynomial, constants, exact
from starhold.algebra.vector import Matrix, Vector
from starhold.certification.matrices import Rows, greatest, inverse, least, matrix_of, number, rows, scaled
from starhold.errors import InputError
from starhold.laws.catalogue import Law
from starhold.laws.interface import fields
from starhold.loop.closed_loop import ClosedLoop
from starhold.models.craft import Craft, tensor
from starhold.models.environment import gravity_gradient


@dataclass(frozen=True)
class Subject:
    """One law on one spacecraft, exact: floats stand for their exact values.

    modelled: bound on each axis of the torque the models know (N m); target_rate, target_acceleration: bounds on the
    target's motion (rad/s, rad/s2), zero for one at rest; disturbance: bound on the norm of any further torque (N m).
    """

    loop: ClosedLoop
    disturbance: Any
    modelled: tuple[Any, Any, Any]
    modelled_norm: Any
    target_rate: Any
    target_acceleration: Any

    @property
    def law(self) -> Law:
        """The law."""
        return self.loop.law

    @property
    def inertia(self) -> Rows:
        """The inertia tensor, kg m2."""
        return rows(tensor(self.loop.craft.inertia))

    @property
    def moving(self) -> bool:
        """Whether the target turns."""
        return self.target_rate != 0 or self.target_acceleration != 0


def make_subject(loop: ClosedLoop, disturbance: float = 0.0) -> Subject:
    """The subject of a closed loop, with bounds over the whole orbit."""
    rate, acceleration = _target_bounds(loop)
    axes, norm = (fmpq(0), fmpq(0), fmpq(0)), fmpq(0)
    if loop.gravity_gradient:
        axes, norm = _gravity_gradient_bounds(loop)
    return Subject(loop, exact(disturbance), axes, norm, rate, acceleration)


def described(subject: Subject) -> dict[str, Any]:
    """The subject as plain numbers and names, all that a checker needs to build it again."""
    loop = subject.loop
    gains: dict[str, Any] = {}
    for item, value in zip(fields(loop.law.gains), loop.gains, strict=True):
        gains[item.name] = item.gain.choices[value] if item.gain.choices else _plain(value)
    limit = loop.craft.torque_limit
    orbit = {
        "position": list(loop.start.position),
        "velocity": list(loop.start.velocity),
        "gravitational_parameter": loop.craft.gravity,
    }
    kind = loop.target if isinstance(loop.target, str) else "history" if isinstance(loop.target, np.ndarray) else "inertial"
    return {
        "law": loop.law.name,
        "gains": gains,
        "double_cover": loop.cover,
        "hysteresis_width": loop.hysteresis_width,
        "inertia": tensor(loop.craft.inertia).tolist(),
        "limit": loop.limit,
        "torque_limit": limit if np.isfinite(limit) else None,
        "orbit": orbit if loop.orbit else None,
        "gravity_gradient": loop.gravity_gradient,
        "target": kind,
        "target_rate": above(subject.target_rate),
        "target_acceleration": above(subject.target_acceleration),
        "modelled_torque": [above(m) for m in subject.modelled],
        "modelled_torque_norm": above(subject.modelled_norm),
        "disturbance": number(subject.disturbance),
        "control_period": loop.period,
    }


def above(x: Any) -> float:
    """A float not below a rational."""
    found = number(x)
    return found if exact(found) >= x else float(np.nextafter(found, np.inf))


def below(x: Any) -> float:
    """A float not above a rational."""
    return -above(-x)


def exact_craft(inertia: Any, torque_limit: Any, gravity: Any) -> Craft:
    """A craft of constant polynomials with the exact inverse of its inertia; a limit that is infinite stays a variable."""
    full = rows(tensor(inertia))
    limit = Polynomial.constant(torque_limit) if np.isfinite(torque_limit) else Polynomial.variable("limit")
    return Craft(as_tuple(full), as_tuple(inverse(full)), limit, Polynomial.constant(gravity))  # pyright: ignore


def as_tuple(matrix: Rows) -> Matrix | Vector:
    """Rows as the constant polynomials that equations take."""
    return constants(tuple(tuple(row) for row in matrix))


def _plain(value: Any) -> Any:
    return np.asarray(cast(Any, value)).tolist() if isinstance(value, tuple) else value


# --- bounds on the outside --------------------------------------------------------------------------------------------


def perigee(loop: ClosedLoop) -> tuple[arb, arb, arb, arb]:
    """Least distance (m), angular momentum (m2/s), eccentricity and gravitational parameter of two-body motion, as balls."""
    r = [arb(x) for x in loop.start.position]
    v = [arb(x) for x in loop.start.velocity]
    gravity = arb(loop.craft.gravity)
    h2 = sum(((r[i] * v[j] - r[j] * v[i]) ** 2 for i, j in ((0, 1), (1, 2), (2, 0))), arb(0))
    distance = sum((x * x for x in r), arb(0)).sqrt()
    energy = sum((x * x for x in v), arb(0)) / 2 - gravity / distance
    if not h2 > 0:
        raise InputError("orbit", "", "a path through the centre of attraction", "an orbit that passes beside it")
    squared = 1 + 2 * energy * h2 / gravity**2
    # Of a circle the ball of e2 may reach below zero, which e2 itself does not.
    eccentricity = squared.nonnegative_part().sqrt()
    return h2 / gravity / (1 + eccentricity), h2.sqrt(), eccentricity, gravity


def _gravity_gradient_bounds(loop: ClosedLoop) -> tuple[Any, Any]:
    """Bounds on the axes and on the norm of the gravity-gradient torque over the whole orbit (N m)."""
    nearest, _, _, gravity = perigee(loop)
    strength = upper(3 * gravity / nearest**3)
    craft = exact_craft(loop.craft.inertia, np.inf, loop.craft.gravity)
    torque: Any = gravity_gradient(direction("p"), cast(Any, Polynomial.constant(1)), craft)
    axes = [strength * _largest_form(component) for component in torque]
    full = rows(tensor(loop.craft.inertia))
    # |n x Jn| is the deviation of the moments about their mean in direction n, so at most half their range.
    return tuple(axes), strength * (greatest(full) - least(full)) / 2


def _largest_form(quadratic: Polynomial) -> Any:
    """A bound of |quadratic form| over the unit sphere."""
    names = ("p1", "p2", "p3")
    form = matrix_of(quadratic, names, names)
    return max(greatest(form), greatest(scaled(form, -1)), fmpq(0))


def direction(name: str, first: int = 1, count: int = 3) -> Any:
    """Variables name1, name2, ... as a tuple."""
    return tuple(Polynomial.variable(f"{name}{i}") for i in range(first, first + count))


def upper(ball: arb) -> Any:
    """A rational not below a ball."""
    return exact(above(exact(float(ball.abs_upper().mid())))) * exact(1.0 + 1e-15)


def _target_bounds(loop: ClosedLoop) -> tuple[Any, Any]:
    if isinstance(loop.target, np.ndarray):
        rate, acceleration = (float(np.linalg.norm(loop.target[:, c : c + 3], axis=1).max()) for c in (4, 7))
        return exact(rate * (1 + 1e-12)), exact(acceleration * (1 + 1e-12))
    if not isinstance(loop.target, str):
        return fmpq(0), fmpq(0)
    nearest, momentum, eccentricity, gravity = perigee(loop)
    # The orbital frame turns by h/r2, and this changes by -2 h r'/r3 with |r'| at most mu e/h.
    return upper(momentum / nearest**2), upper(2 * gravity * eccentricity / nearest**3)
