"""The closed loop as exact polynomials: V and its derivative, read from the law's and the models' own equations.

Variables: q0..q3 error attitude, w1..w3 rate relative to the target, r1..r3 the target's rate and a1..a3 its acceleration
(body axes), e1..e3 the torque the models know, m1..m3 a torque nobody knows, with wheels h1..h3 the total momentum,
and z = 1/(1 + |q|2).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

from flint import fmpq

from starhold.algebra.polynomial import Condition, Polynomial, constants, jointly, pieces, reciprocal
from starhold.algebra.quaternion import derivative, vector_part
from starhold.algebra.vector import add, apply, cross, dot, subtract
from starhold.certification.matrices import Rows
from starhold.certification.subject import Subject, direction, exact_craft
from starhold.laws.interface import Measurement
from starhold.parts.bodies.rigid_body import angular_acceleration, kinetic_energy
from starhold.parts.craft import Craft

ATTITUDE, RATE = ("q0", "q1", "q2", "q3"), ("w1", "w2", "w3")
AXES = ATTITUDE[1:]
Truths = tuple[tuple[Condition, bool], ...]


class ShapeError(ArithmeticError):
    """An equation is not of the form that these proofs are about; the text says which term is in the way."""


@dataclass(frozen=True)
class Motion:
    """The closed loop of a subject. `stiffness`: V is the kinetic energy and 2 stiffness (1 - q0), in place of the law's
    own."""

    subject: Subject
    stiffness: Any | None = None

    @cached_property
    def craft(self) -> Craft:
        """The craft that moves, which the law knows."""
        craft = self.subject.loop.craft
        return exact_craft(craft.inertia, craft.torque_limit, craft.gravity)

    @cached_property
    def gains(self) -> Any:
        """The law's gains as constants."""
        return constants(self.subject.loop.gains)

    @cached_property
    def measurement(self) -> Measurement:
        """The law's measurement in variables."""
        zero: Any = (Polynomial.constant(0),) * 3
        still = not self.subject.moving
        rate, known = direction("w"), direction("e")
        turning = zero if still else direction("r")
        spinning = zero if still else direction("a")
        acceleration = subtract(spinning, cross(rate, turning))
        period: Any = Polynomial.constant(self.subject.loop.period)
        absolute, stored = add(rate, turning), zero
        if self.subject.loop.wheels is not None:
            stored = subtract(direction("h"), apply(self.craft.inertia, absolute))
        return Measurement(
            direction("q", 0, 4),
            rate,
            absolute,
            turning,
            acceleration,
            known,
            direction("p"),
            period,
            stored,
            direction("b"),
        )

    @cached_property
    def torque(self) -> Any:
        """The law's torque, piecewise."""
        memory = self.subject.law.remember(self.subject.loop.gains, self.subject.loop.craft, self.subject.loop.period)
        q: Any = vector_part(self.measurement.attitude)
        with reciprocal(1 + dot(q, q), "z"):
            return self.subject.law.command(self.measurement, self.gains, self.craft, memory)[0]

    @cached_property
    def acceleration(self) -> Any:
        """The derivative of the rate relative to the target."""
        outside = add(self.torque, add(self.measurement.external_torque, direction("m")))
        # Of the wheels' action on the body the torque is what is asked of them.
        outside = subtract(outside, cross(self.measurement.body_rate, self.measurement.wheel_momentum))
        absolute = angular_acceleration(self.measurement.body_rate, outside, self.craft)
        return subtract(absolute, self.measurement.target_acceleration)  # type: ignore

    @cached_property
    def turning(self) -> Any:
        """The derivative of the error attitude."""
        return derivative(self.measurement.attitude, self.measurement.rate)

    def along(self, function: Polynomial) -> Any:
        """The derivative of a polynomial of the state along the motion."""
        total: Any = Polynomial.constant(0)
        for name, rate in zip(ATTITUDE, self.turning, strict=True):
            total = total + function.slope(name) * rate
        for name, rate in zip(RATE, self.acceleration, strict=True):
            slope = function.slope(name)
            if slope.terms:
                total = total + rate * slope
        return total

    @cached_property
    def lyapunov(self) -> Polynomial | None:
        """V for the plant that moves; None where the law has none of its own and no other is asked for."""
        if self.stiffness is not None:
            energy: Any = kinetic_energy(self.measurement.rate, self.craft)
            return energy + 2 * self.stiffness * (1 - Polynomial.variable("q0"))
        function = self.subject.law.lyapunov
        return None if function is None else function(self.measurement, self.gains, self.craft)

    @cached_property
    def cross_term(self) -> Polynomial:
        """q.J w, which makes a strict Lyapunov function of V."""
        return dot(vector_part(self.measurement.attitude), apply(self.craft.inertia, self.measurement.rate))  # type: ignore

    def linear(self, sign: int = 1) -> tuple[Rows, Rows]:
        """K_rate and K_attitude of the law near attitude (sign, 0, 0, 0) at rest, u = -K_rate w - K_attitude q."""
        found = [at_rest(component)[1] for component in self.torque]
        still = {name: fmpq(0) for case in found for name in case.variables()} | {"q0": fmpq(sign), "z": fmpq(1)}
        # z = 1/(1 + |q|2) has no slope there.
        rate = [[-component.slope(name).at(still) for name in RATE] for component in found]
        attitude = [[-component.slope(name).at(still) for name in ATTITUDE[1:]] for component in found]
        return rate, attitude


def near_rest(truths: Truths) -> bool:
    """Whether a piece of a law holds around the equilibrium on target: none of its conditions is on its border there."""
    for condition, truth in truths:
        value = condition.positive.only(lambda monomial: all(name == "q0" for name in monomial))
        at_rest = value.at({"q0": fmpq(1)})
        if at_rest == 0 or (at_rest > 0) != truth:
            return False
    return True


def at_rest(value: Any) -> tuple[Truths, Polynomial]:
    """The piece that holds around the equilibrium on target, with its conditions; ShapeError where several meet there."""
    found = [(case.truths, case.value) for case in pieces(value) if near_rest(case.truths)]
    if len(found) != 1:
        raise ShapeError("the law switches at rest on target")
    return found[0]


def cases(value: Any) -> list[tuple[Truths, Polynomial]]:
    """The pieces of a piecewise polynomial."""
    return [(truths, parts[0]) for truths, parts in jointly([value])]
