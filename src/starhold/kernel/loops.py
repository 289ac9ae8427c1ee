"""An attitude loop, wired from programs by the kernel: a certificate cannot say what is connected with what.

The body is relative to its target: q turns the target's axes to the body's, w is the body's rate relative to the target and
r the target's rate, both in body axes, a the derivative of r as the body sees it:

    J w' = u + e - (w + r) x (J (w + r) + h) - J a,    q' = q (0, w)/2,    |q| = 1,

with the law's torque u, a torque e from outside, and the momentum h of wheels, that makes H = J (w + r) + h with the body's.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from functools import cached_property
from typing import TypeAlias

from .numbers import RefusedError, Rows, demand, inverse
from .polynomials import Poly, apply, cross, dot, poly, total, var, variables
from .programs import Asking, Exactly, Piecewise, known, single
from .reading import Claim
from .rules import Definite, Shown, Vanishes

AXES = range(3)
OUTSIDE, MOVING, WHEELS = "outside torque", "moving target", "wheels"
"""A loop has these only where the claim takes it with them."""
SHORTEST, HYSTERESIS = "shortest sign", "hysteresis"
"""How the sign of the quaternion that is fed back is chosen: otherwise it never changes."""
NONE = [Poly({})] * 3
Matrix: TypeAlias = Sequence[Sequence[Poly | Fraction]]
Wired: TypeAlias = Mapping[str, Poly]


def wired(name: str, value: Sequence[Poly]) -> dict[str, Poly]:
    """Return the inputs of a vector: name.0, name.1, ..."""
    return {f"{name}.{k}": part for k, part in enumerate(value)}


def wired_matrix(name: str, value: Matrix) -> dict[str, Poly]:
    """Return the inputs of a matrix: name.0.0, ..., and of a diagonal one name.0, name.1, name.2 too."""
    found = {f"{name}.{i}.{k}": poly(x) for i, row in enumerate(value) for k, x in enumerate(row)}
    plain = all(poly(value[i][k]).terms == {} for i in AXES for k in AXES if i != k)
    return found | ({f"{name}.{i}": poly(value[i][i]) for i in AXES} if plain else {})


def read(claim: Claim, role: str, count: int, ring: Exactly, *tables: Wired) -> list[Piecewise]:
    """Return the outputs of a program over a ring, its inputs wired as the tables say; beside these only gains, numbers of
    the craft as the law knows it and as it is, and the period are numbers, those of the subject."""
    program, given, inputs = claim.programs[role], dict[str, Piecewise](), dict[str, Poly]()
    for table in tables:
        inputs |= table
    for name in program.inputs:
        if name in inputs:
            given[name] = known(inputs[name])
        elif name.startswith(("gains.", "craft.", "plant.")) or name == "measurement.period":
            given[name] = known(claim.subject[name])
        else:
            raise RefusedError(f"the {role} asks for {name}, which nothing gives")
    return program.run(given, ring, count)


class AttitudeLoop:
    """A rigid body under a law. `any_inertia`: J is made of variables; the law's own numbers stay what they are.
    `quotients`: programs may divide by the state, but not by quotients, and take no roots of it."""

    def __init__(self, claim: Claim, any_inertia: bool = False, quotients: bool = False) -> None:
        self.claim, self.any_inertia = claim, any_inertia
        self.ring = Asking() if quotients else Exactly()
        self.q, self.w = variables("q", 0), variables("w")
        self.outside, self.moving, self.wheels = (claim.taken.get(word) is True for word in (OUTSIDE, MOVING, WHEELS))
        self.e = variables("e") if self.outside else NONE
        self.r, self.a = (variables(letter) if self.moving else NONE for letter in "ra")
        self.J, self.J_inverse = self._inertia()
        self.rate = [w + r for w, r in zip(self.w, self.r, strict=True)]
        spin = apply(self.J, self.rate)
        self.H = variables("h") if self.wheels else spin
        self.stored = [h - own for h, own in zip(self.H, spin, strict=True)]
        self.told: Wired = {
            name: part
            for field, value in {
                "attitude": self.q, "rate": self.w, "body_rate": self.rate, "target_rate": self.r,
                "target_acceleration": self.a, "external_torque": self.e, "position": variables("p"),
                "wheel_momentum": self.stored, "magnetic_field": variables("b"),
            }.items()
            for name, part in wired(f"measurement.{field}", value).items()
        }  # fmt: skip
        self.sphere = dot(self.q, self.q) - 1
        self.still: dict[str, int] = dict.fromkeys(("w1", "w2", "w3"), 0)
        self.on_target, self.opposite = ({"q0": q0, "q1": 0, "q2": 0, "q3": 0} for q0 in (1, -1))
        # q' = q (0, w)/2.
        own, half = self.q[1:], Fraction(1, 2)
        turned = [self.q[0] * w + c for w, c in zip(self.w, cross(own, self.w), strict=True)]
        self.turning = [-half * dot(self.w, own), *(half * part for part in turned)]

    def _inertia(self) -> tuple[Matrix, Matrix]:
        if self.any_inertia:
            pair = ([[var(f"{x}{min(i, k)}{max(i, k)}") for k in AXES] for i in AXES] for x in "ji")
            return next(pair), next(pair)
        J = [[self.claim.subject[f"body.inertia.{min(i, k)}.{max(i, k)}"] for k in AXES] for i in AXES]
        return J, inverse(J)

    def read(self, role: str, count: int, *tables: Wired) -> list[Piecewise]:
        """Return the outputs of a program, its inputs wired as the tables say."""
        found = read(self.claim, role, count, self.ring, *tables)
        demand(not isinstance(self.ring, Asking) or not self.ring.roots, "a program takes a root of the state")
        nested = any(divisor.names & self.divisors.keys() for divisor in self.divisors.values())
        demand(not nested, "a program divides by a quotient")
        return found

    @property
    def divisors(self) -> dict[str, Poly]:
        """Return the polynomials that variables are inverses of."""
        found = self.ring.inverses if isinstance(self.ring, Asking) else {}
        return {name: Poly(dict(own)) for own, name in found.items()}

    @cached_property
    def law(self) -> list[Piecewise]:
        """Return the torque that the law asks for, case by case."""
        return self.read("law", 3, self.told)

    @cached_property
    def u(self) -> list[Poly]:
        """Return the torque of a law that does not switch."""
        return [single(cases) for cases in self.law]

    def balance(self, u: Sequence[Poly]) -> list[Poly]:
        """Return J w' under a torque of the law."""
        turning = cross(self.rate, self.H)
        columns = zip(u, self.e, turning, apply(self.J, self.a), strict=True)
        return [torque + outside - gyroscopic - moved for torque, outside, gyroscopic, moved in columns]

    @cached_property
    def acceleration(self) -> list[Poly]:
        """Return w' of a law that does not switch."""
        return apply(self.J_inverse, self.balance(self.u))

    @cached_property
    def lyapunov(self) -> Poly:
        """Return V, less what it is at rest on target."""
        plant = wired_matrix("craft.inertia", self.J)
        (cases,) = self.read("lyapunov", 1, self.told, plant)
        V = single(cases)
        self.autonomous([V])
        return V - V.at(self.on_target | self.still)

    def autonomous(self, parts: Sequence[Poly], kept: str = "") -> None:
        """Refuse what depends on more than the state (and the inertia), and what is `kept`."""
        names = {name for part in parts for name in part.names if name[0] not in "qwj" + kept}
        demand(not names, f"the motion depends on more than the state: {', '.join(sorted(names))}")

    def slopes_along(self, p: Poly, acceleration: Sequence[Poly]) -> Poly:
        """Return the derivative of a function of the state along the motion with an acceleration."""
        rates = zip((*(f"q{k}" for k in range(4)), *self.still), (*self.turning, *acceleration), strict=True)
        return total(p.slope(name) * rate for name, rate in rates)

    def expanded(self, p: Poly, rest: Mapping[str, int]) -> Poly:
        """Return p with the inverses in it as they are to the first order around a point, where no divisor of any program
        vanishes, used or not."""
        for z, divisor in self.divisors.items():
            d = divisor.at(rest).number
            demand(d != 0, "a program divides by zero at rest")
            p = p.at({z: (2 * d - divisor) * (1 / (d * d))})
        return p

    def sound(self) -> Shown:
        """The inertia is one, and the programs of the body and of its turning are the equations above."""
        if not self.any_inertia:
            yield "inertia", Definite([[Fraction(poly(x).number) for x in row] for row in self.J])
        pushed, inverses = variables("t"), list[Poly]()
        if self.any_inertia:
            columns = list(zip(*self.J_inverse, strict=True))
            inverses = [dot(self.J[i], columns[k]) - (i == k) for i in AXES for k in AXES]
        plant = wired_matrix("craft.inertia", self.J) | wired_matrix("craft.inverse_inertia", self.J_inverse)
        moved = [single(c) for c in self.read("body", 3, wired("rate", self.w), wired("torque", pushed), plant)]
        wanted = [t - g for t, g in zip(pushed, cross(self.w, apply(self.J, self.w)), strict=True)]
        for k, (found, p) in enumerate(zip(apply(self.J, moved), wanted, strict=True)):
            yield f"Euler's equation {k}", Vanishes(found - p, inverses)
        turned = self.read("turning", 4, wired("q", self.q), wired("rate", self.w))
        for k, (found, p) in enumerate(zip(turned, self.turning, strict=True)):
            yield f"turning {k}", Vanishes(single(found) - p)


def slopes(parts: Sequence[Poly], letter: str, at: Mapping[str, Poly | Fraction | int]) -> Rows:
    """Return the derivatives with respect to three variables at a point."""
    return [[p.slope(f"{letter}{k}").at(at).number for k in (1, 2, 3)] for p in parts]
