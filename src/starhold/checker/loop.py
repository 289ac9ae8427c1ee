"""The closed loop a certificate speaks of, as its checker reads it: from the law's and the models' own equations, in exact
polynomials.

Variables: q0..q3 error attitude, w1..w3 rate relative to the target, r and a the target's rate and acceleration, e the
torque the models know, m one that nobody knows, t what the actuators give, h the momentum of the whole, wheels included
(body axes; of which J w_abs is the body's), z the reciprocal of
1 + |q|2, by which laws divide.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from itertools import combinations
from typing import Any

from starhold.algebra.polynomial import Monomial, Polynomial, constants, jointly, reciprocal
from starhold.algebra.quaternion import derivative, vector_part
from starhold.algebra.structure import leaves
from starhold.algebra.vector import add, apply, cross, dot, subtract
from starhold.checker.exact import (
    ONE,
    ZERO,
    CheckError,
    Dual,
    Interval,
    Rows,
    Truths,
    demand,
    dual,
    falls,
    intervals,
    inverse,
    replaced,
)
from starhold.checker.subject import LoopSubject, named, variables
from starhold.laws.interface import Measurement
from starhold.parts.bodies.rigid_body import angular_acceleration, kinetic_energy
from starhold.parts.craft import Craft

TURN, RATE, ATTITUDE = named("q"), named("w"), named("q", 0)
W = variables(RATE)
QUOTIENT = "z"


class ExactLoop:
    """The loop of a subject. `stiffness`: V is the kinetic energy and 2 stiffness (1 - q0); None: the law's own. `quotient`:
    whether a claim takes a law that divides by 1 + |q|2, the reciprocal of which is a variable then."""

    def __init__(self, subject: LoopSubject, stiffness: Any | None = None, quotient: bool = False) -> None:
        self.subject, self.stiffness, self.quotient = subject, stiffness, quotient
        self.inertia, self.still = subject.inertia, not subject.moving

    @cached_property
    def craft(self) -> Craft:
        """The craft that moves, which the law knows."""
        limit: Any = self.subject.torque_limit
        return Craft(
            constants(tuple(map(tuple, self.inertia))),
            constants(tuple(map(tuple, inverse(self.inertia)))),
            variables(("limit",))[0] if limit is None else constants(limit),
            constants(self.subject.gravity),
        )

    @cached_property
    def measurement(self) -> Measurement:
        """The measurement that the law gets."""
        still = constants((0, 0, 0))
        turning, spinning = (still, still) if self.still else (variables(named("r")), variables(named("a")))
        rate, relative = add(W, turning), subtract(spinning, cross(W, turning))
        stored = still
        if self.subject.wheels is not None:
            stored = subtract(variables(named("h")), apply(self.craft.inertia, rate))
        outside, position, period = variables(named("e")), variables(named("p")), Polynomial.variable("period")
        told: Any = (turning, relative, outside, position, period, stored, variables(named("b")))
        return Measurement(variables(ATTITUDE), W, rate, *told)

    @cached_property
    def moving(self) -> Measurement:
        """The measurement with derivatives under a torque t, without that of the wheels' momentum, which is not in V."""
        measurement = self.measurement
        torque = add(variables(named("t")), add(measurement.external_torque, variables(named("m"))))
        turned_by = subtract(torque, cross(measurement.body_rate, measurement.wheel_momentum))
        absolute = angular_acceleration(measurement.body_rate, turned_by, self.craft)
        swing = subtract(absolute, measurement.target_acceleration)  # pyright: ignore
        spin = derivative(measurement.attitude, measurement.rate)
        told = dual(measurement)
        attitude = tuple(Dual(q, change) for q, change in zip(measurement.attitude, spin, strict=True))
        rate = tuple(Dual(w, change) for w, change in zip(measurement.rate, swing, strict=True))
        return told._replace(attitude=attitude, rate=rate, body_rate=add(rate, told.target_rate))  # pyright: ignore

    @cached_property
    def pieces(self) -> list[tuple[Truths, dict[str, Polynomial]]]:
        """The law's torque on each of its pieces."""
        subject = self.subject
        demand(not any(True for _ in leaves(subject.memory)), "the law keeps a memory")
        q: Any = vector_part(self.measurement.attitude)
        with reciprocal(1 + dot(q, q), QUOTIENT):
            found = jointly(subject.law.command(self.measurement, subject.gains, self.craft, subject.memory)[0])
        switches = {name for truths, _ in found for c, _ in truths for name in c.positive.variables()}
        read = {name for _, parts in found for p in parts for name in p.variables()} | switches
        demand(QUOTIENT not in switches, "the law switches on a quotient")
        demand(self.quotient or QUOTIENT not in read, "the law divides by 1 + |q|2, which such a claim does not take")
        read.discard(QUOTIENT)
        demand(
            all(name[0] in "qwraemh" for name in read),
            "the torque depends on more than attitude, rate, target, torque and stored momentum",
        )
        return [(truths, dict(zip(named("t"), parts, strict=True))) for truths, parts in found]

    def resting(self, sign: int = 1) -> tuple[Truths, dict[str, Polynomial]]:
        """The piece around the equilibrium at attitude (sign, 0, 0, 0)."""
        around = [
            (truths, torque)
            for truths, torque in self.pieces
            if all((value := at_rest(c.positive, sign)) != 0 and (value > 0) == truth for c, truth in truths)
        ]
        demand(len(around) == 1, "the law switches at rest on target")
        return around[0]

    @cached_property
    def reach(self) -> Any | None:
        """The rate up to which the piece around the equilibrium holds; None for any."""
        found = intervals(self.resting()[0], W) or []
        return min((abs(end) for ends in found for end in ends if end is not None), default=None)

    def linear(self, sign: int = 1) -> tuple[Rows, Rows]:
        """K_rate and K_attitude of the torque -K_rate w - K_attitude q near rest at (sign, 0, 0, 0), target at rest."""
        gains: list[Rows] = [[], []]
        for whole in self.resting(sign)[1].values():
            # 1/(1 + |q|2) is 1 there, and its slope -2 q/(1 + |q|2)2 zero.
            component = whole.given({QUOTIENT: ONE})
            own = component.only(lambda m: all(name in ATTITUDE or name in RATE for name in m))
            demand(at_rest(own, sign) == 0, "the torque at rest on target is not zero")
            for gain, names in zip(gains, (RATE, TURN), strict=True):
                gain.append([-at_rest(_factor(own, name), sign) for name in names])
        return gains[0], gains[1]

    @cached_property
    def lyapunov(self) -> Dual:
        """V, and its derivative under a torque t."""
        measurement, craft = self.moving, dual(self.craft)
        if self.stiffness is not None:
            return kinetic_energy(measurement.rate, craft) + 2 * dual(self.stiffness) * (1 - measurement.attitude[0])  # pyright: ignore
        function = self.subject.law.lyapunov
        if function is None:
            raise CheckError("the law declares no V")
        return function(measurement, dual(self.subject.gains), craft)

    def slope(self, torque: Mapping[str, Polynomial]) -> Polynomial:
        """V' on a piece of the law; of a target's motion nothing may be left in it."""
        return replaced(self.lyapunov.slope, torque)

    def accelerations(self, torque: Mapping[str, Polynomial]) -> list[Polynomial]:
        """The derivative of the rate on a piece of the law."""
        return [replaced(w.slope, torque) for w in self.moving.rate]  # pyright: ignore

    @cached_property
    def swayed(self) -> bool:
        """Whether the motion relative to the target depends on the momentum of wheels."""
        found = (w for _, torque in self.pieces for w in self.accelerations(torque))
        return any("h" in letters(m) for w in found for m in w.terms)

    @cached_property
    def falls(self) -> bool:
        """Whether, on every piece of a law of several, V' is a sum of polynomials of one rate each that are negative except
        at rest, the torque having no jumps; torque from outside is left aside."""
        boxes = [(found, torque) for t, torque in self.pieces if (found := intervals(t, W)) is not None]
        for (first, one), (second, other) in combinations(boxes, 2):
            border = _border(first, second)
            jumps = border is not None and any(replaced(one[name] - other[name], border).terms for name in one)
            if jumps:
                return False
        return all(self._falls(truths, torque) for truths, torque in self.pieces)

    def _falls(self, truths: Truths, torque: Mapping[str, Polynomial]) -> bool:
        found = intervals(truths, W)
        slope = self.slope(torque).only(lambda m: letters(m) not in ("ew", "mw"))
        terms = slope.terms
        allowed = {(name,) * power for name in RATE for power in (1, 2)}
        return found is None or (
            set(terms) <= allowed
            and all(
                falls(terms.get((name,), ZERO), terms.get((name, name), ZERO), ends)
                for name, ends in zip(RATE, found, strict=True)
            )
        )


def _border(first: Sequence[Interval], second: Sequence[Interval]) -> dict[str, Polynomial] | None:
    """The rates that are fixed where two boxes have points in common; None where they have none."""
    fixed: dict[str, Polynomial] = {}
    for name, one, other in zip(RATE, first, second, strict=True):
        low = max((end for end in (one[0], other[0]) if end is not None), default=None)
        high = min((end for end in (one[1], other[1]) if end is not None), default=None)
        if low is not None and high is not None:
            if low > high:
                return None
            if low == high:
                fixed[name] = constants(low)
    return fixed


def at_rest(polynomial: Polynomial, sign: int) -> Any:
    """The value at rest at attitude (sign, 0, 0, 0)."""
    terms = polynomial.terms.items()
    return sum((c * sign ** len(m) for m, c in terms if all(name == "q0" for name in m)), ZERO)


def _factor(polynomial: Polynomial, name: str) -> Polynomial:
    """The factor of a variable in the terms where it occurs once."""
    return Polynomial({without(m, name): c for m, c in polynomial.terms.items() if m.count(name) == 1})


def without(monomial: Monomial, name: str) -> Monomial:
    """A monomial with a variable left out."""
    return tuple(other for other in monomial if other != name)


def letters(monomial: Monomial) -> str:
    """The kinds of variables in a monomial in the state; o is q0."""
    return "".join(sorted("o" if name == "q0" else name[0] for name in monomial if name[0] != "d"))


def by_kind(polynomial: Polynomial) -> dict[str, Polynomial]:
    """The terms by the kinds of their variables."""
    return {kind: polynomial.only(lambda m, k=kind: letters(m) == k) for kind in {letters(m) for m in polynomial.terms}}
