"""The subject of a certificate, as its checker reads it: numbers at their exact values, and bounds that must hold over the
whole orbit.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from flint import arb

from starhold.algebra.polynomial import Monomial, Polynomial, constants
from starhold.algebra.vector import cross, dot, scale, subtract
from starhold.checker.exact import (
    ONE,
    ZERO,
    CheckError,
    Rows,
    definite,
    demand,
    down,
    floating,
    identity,
    plus,
    radius_of,
    rational,
    root_above,
    transpose,
    up,
)
from starhold.checker.spline import moves_within
from starhold.checker.wheels import SubjectWheels, read_wheels
from starhold.laws.catalogue import Law, catalogue
from starhold.parts.craft import EARTH, Craft, check_inertia, compact
from starhold.parts.environments.gravity_gradient import gravity_gradient


def named(letter: str, first: int = 1) -> tuple[str, ...]:
    """The three variables of a vector, or the four of a quaternion."""
    return tuple(f"{letter}{k}" for k in range(first, 4))


def variables(names: Sequence[str]) -> Any:
    """Polynomials of these names."""
    return tuple(Polynomial.variable(name) for name in names)


@dataclass(frozen=True)
class LoopSubject:
    """The subject of a certificate, its numbers exact; `memory` is what the law starts with, `whole` the inertia with that
    of rotors about their axes, `perigee` the orbit's where the gravity gradient is felt."""

    law: Law
    gains: Any
    memory: Any
    sign_policy: str
    width: Any
    inertia: Rows
    whole: Rows
    limit: str
    torque_limit: Any | None
    gravity: Any
    moving: bool
    target_rate: Any
    target_acceleration: Any
    modelled: list[Any]
    modelled_norm: Any
    disturbance: Any
    period: Any
    wheels: SubjectWheels | None
    perigee: Any | None


def read_subject(given: Mapping[str, Any]) -> LoopSubject:
    """The subject in a certificate whose keys and types are in order; a CheckError where it says what cannot be."""
    law = catalogue().get(given["law"])
    if law is None:
        raise CheckError(f"there is no law {given['law']}")
    fields = {item.name: item.gain for item in law.fields()}
    demand(set(given["gains"]) == set(fields), "the gains are not those of the law")
    gains = law.gains(**{name: gain.check(given["gains"][name]) for name, gain in fields.items()})
    wheels = None if given["wheels"] is None else read_wheels(given["wheels"])
    tensor, inertia = np.array(given["inertia"], dtype=float), [[rational(x) for x in row] for row in given["inertia"]]
    demand(inertia == transpose(inertia) and definite(inertia), "the inertia is not symmetric and positive definite")
    # Without its rotors' moments the inertia need not be that of a body.
    whole = inertia if wheels is None else plus(inertia, wheels.moments)
    check_inertia([[floating(x) for x in row] for row in whole])
    limit, orbit = given["torque_limit"], given["orbit"]
    gravity = orbit["gravitational_parameter"] if orbit else EARTH
    demand(gravity > 0, "the gravitational parameter is not positive")
    demand(limit is None or limit > 0, "the torque limit is not positive")
    limited = math.inf if limit is None else float(limit)
    craft = Craft(compact(tensor), compact(np.linalg.inv(tensor)), limited, float(gravity))
    demand(given["control_period"] > 0, "the control period is not positive")
    for name in ("target_rate", "target_acceleration", "modelled_torque_norm", "disturbance"):
        demand(given[name] >= 0, f"{name} is negative")
    width = given["hysteresis_width"]
    demand((width is not None) == (given["quaternion_sign"] == "hysteresis"), "a width is for a hysteresis")
    demand(width is None or width >= 0, "hysteresis_width is negative")
    memory = law.remember(gains, craft, given["control_period"])
    perigee = _check_bounds(given, whole)
    exact = {name: rational(given[name]) for name in ("target_rate", "target_acceleration", "disturbance")}
    return LoopSubject(
        law=law,
        gains=constants(gains),
        memory=memory,
        sign_policy=given["quaternion_sign"],
        width=rational(width or 0),
        inertia=inertia,
        whole=whole,
        limit=given["limit"],
        torque_limit=None if limit is None else rational(limit),
        gravity=rational(gravity),
        moving=given["target_rate"] > 0 or given["target_acceleration"] > 0,
        modelled=[rational(x) for x in given["modelled_torque"]],
        modelled_norm=rational(given["modelled_torque_norm"]),
        period=rational(given["control_period"]),
        wheels=wheels,
        perigee=perigee,
        **exact,
    )


def gradient(whole: Rows) -> Any:
    """The gravity-gradient torque at a position p over its strength 3 mu/|p|5."""
    inertia: Any = constants(tuple(map(tuple, whole)))
    return gravity_gradient(variables(named("p")), 1, Craft(inertia, inertia, 0.0, 0.0))  # pyright: ignore


def _check_bounds(given: Mapping[str, Any], whole: Rows) -> Any | None:
    """That the bounds of the target's motion and of the modelled torque hold over the whole orbit; its least distance, from
    above, where a gravity gradient is felt."""
    demand(min(given["modelled_torque"]) >= 0, "a bound of the modelled torque is negative")
    demand(
        given["orbit"] is not None or not (given["gravity_gradient"] or given["target"] == "orbital"), "there is no orbit"
    )
    demand((given["history"] is not None) == (given["target"] == "history"), "a history is for a target that follows one")
    motion = [rational(given[name]) for name in ("target_rate", "target_acceleration")]
    if given["target"] == "inertial":
        demand(not any(motion), "a target at rest has no rate")
    if given["history"] is not None:
        moves_within(given["history"], *motion)
    if not given["gravity_gradient"]:
        demand(not any([*given["modelled_torque"], given["modelled_torque_norm"]]), "nothing models a torque")
    if given["orbit"] is None:
        return None
    r, v = ([arb(rational(x)) for x in given["orbit"][key]] for key in ("position", "velocity"))
    mu = arb(rational(given["orbit"]["gravitational_parameter"]))
    h = cross(tuple(r), tuple(v))  # pyright: ignore
    distance, momentum = arb(dot(r, r)).sqrt(), arb(dot(h, h))  # pyright: ignore
    # The eccentricity vector, v x h/mu - r/|r|; the perigee is at p/(1 + e) also of a parabola or hyperbola.
    apse = subtract(scale(1 / mu, cross(tuple(v), h)), scale(1 / distance, tuple(r)))  # pyright: ignore
    square = arb(dot(apse, apse))  # pyright: ignore
    eccentricity = arb(root_above(up(square)))
    perigee = arb(down(momentum / mu / (1 + eccentricity)))
    demand(bool(perigee > 0), "the orbit falls into the centre")
    if given["target"] == "orbital":
        turning, swinging = momentum.sqrt() / perigee**2, 2 * mu * eccentricity / perigee**3
        demand(rational(given["target_rate"]) >= up(turning), "the target turns faster")
        demand(rational(given["target_acceleration"]) >= up(swinging), "the target's rate changes faster")
    if given["gravity_gradient"]:
        strength = up(3 * mu / perigee**3)
        for component, bound in zip(gradient(whole), given["modelled_torque"], strict=True):
            largest = radius_of(quadratic(component.terms, named("p")))
            demand(rational(bound) >= strength * largest, "the modelled torque is larger")
        # |n x Jn| is how far the moments deviate from their mean in direction n: at most half their range.
        half = rational(given["modelled_torque_norm"]) / strength
        moments = np.linalg.eigvalsh([[floating(x) for x in row] for row in whole])
        mean = rational(float(moments[0] + moments[2]) / 2)
        demand(radius_of(plus(whole, identity(3, mean), -ONE)) <= half, "the norm of the modelled torque is larger")
        return up(momentum / mu / (1 + square.nonnegative_part().sqrt()))
    return None


def quadratic(terms: Mapping[Monomial, Any], names: Sequence[str]) -> Rows:
    """The symmetric matrix of a quadratic form."""
    table = mixed(terms, names, names)
    return [[c if i == j else c / 2 for j, c in enumerate(row)] for i, row in enumerate(table)]


def mixed(terms: Mapping[Monomial, Any], rows: Sequence[str], columns: Sequence[str]) -> Rows:
    """The coefficients of the products of two variables."""
    return [[terms.get(tuple(sorted((a, b))), ZERO) for b in columns] for a in rows]
