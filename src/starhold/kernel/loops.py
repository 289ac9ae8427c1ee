"""An attitude loop, wired from programs by the kernel: a certificate cannot say what is connected with what.

The body is relative to its target: q turns the target's axes to the body's, w is the body's rate relative to the target,
r the target's rate and a its derivative as the target sees it, all in body axes:

    J w' = u + e - (w + r) x (J (w + r) + h) - J (a - w x r),    q' = q (0, w)/2,    |q| = 1,

with the law's torque u, a torque e from outside, and the momentum h of wheels, that makes H = J (w + r) + h with the body's.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from functools import cached_property
from itertools import combinations
from typing import TypeAlias

from .numbers import Rows, beside, demand, inverse, plus, scalar
from .polynomials import Poly, apply, cross, dot, minus, poly, total, var, variables
from .programs import Asking, Case, Exactly, Piecewise, joined, known, positive, single
from .reading import IS_VALID, Claim
from .rules import Definite, Shown, vanish

AXES = range(3)
RATES, TURNS, MOMENTA = ("w1", "w2", "w3"), ("q1", "q2", "q3"), ("h1", "h2", "h3")
OUTSIDE, MOVING, WHEELS = "outside torque", "moving target", "wheels"
"""A loop has these only where the claim takes it with them."""
SHORTEST, HYSTERESIS = "shortest sign", "hysteresis"
"""How the sign of the quaternion that is fed back is chosen: otherwise it never changes."""
REMEMBERS = "memory"
"""The law's memory, whatever is in it, adds a bounded torque to what it asks for without."""
HANDED = "handed over"
"""The loop takes over from another one in any of the states that the claim says its set holds."""
TOLD_TORQUE = "measurement.external_torque"
"""The torque from outside that a law is told."""
NONE = [Poly({})] * 3
Matrix: TypeAlias = Sequence[Sequence[Poly | Fraction]]
Wired: TypeAlias = Mapping[str, Poly]


def wired(name: str, value: Sequence[Poly]) -> dict[str, Poly]:
    """Return the input names of a vector: name.0, name.1, ..."""
    return {f"{name}.{k}": part for k, part in enumerate(value)}


def wired_matrix(name: str, value: Matrix) -> dict[str, Poly]:
    """Return the input names of a matrix: name.0.0, ..., and for a diagonal one also name.0, name.1, name.2."""
    wires = {f"{name}.{i}.{k}": poly(x) for i, row in enumerate(value) for k, x in enumerate(row)}
    plain = all(poly(value[i][k]).terms == {} for i in AXES for k in AXES if i != k)
    return wires | ({f"{name}.{i}": poly(value[i][i]) for i in AXES} if plain else {})


class Loop:
    """A loop reads its programs over one ring. `told` names the inputs of its programs, besides those wired in a single
    reading; `rates` has the derivatives that do not depend on the law, `driven` the variables of those that do."""

    inputs: Wired
    rates: Mapping[str, Poly]
    driven: Sequence[str]

    def __init__(self, claim: Claim, ring: Exactly) -> None:
        self.claim, self.ring = claim, ring

    def read(self, role: str, count: int, *tables: Wired) -> list[Piecewise]:
        """Return the outputs of a program. Of its inputs only the gains, the numbers of the craft (true, and as the law
        knows them) and the period are numbers, taken from the subject."""
        program, given = self.claim.programs[role], dict[str, Piecewise]()
        for name in program.inputs:
            wires = [table[name] for table in (self.inputs, *tables) if name in table]
            number = name.startswith(("gains.", "craft.", "plant.")) or name == "measurement.period"
            demand(bool(wires) or number, f"the {role} asks for {name}, which nothing gives")
            given[name] = known(wires[-1] if wires else self.claim.subject[name])
        return program.run(given, self.ring, count)

    def single(self, role: str, count: int, *tables: Wired) -> list[Poly]:
        """Return the outputs of a program that does not switch."""
        return [single(cases) for cases in self.read(role, count, *tables)]

    def slopes_along(self, p: Poly, acceleration: Sequence[Poly]) -> Poly:
        """Return the time derivative of a function of the state under an acceleration."""
        rates = {**self.rates, **dict(zip(self.driven, acceleration, strict=True))}
        return total(p.slope(name) * rate for name, rate in rates.items())


class AttitudeLoop(Loop):
    """A rigid body under a law. `any_inertia`: the entries of J are variables; the law's own numbers stay fixed. `near`:
    such a J near the given J0, with each entry within `tolerance` sqrt(J0_ii J0_kk). `quotients`: programs may divide by the
    state, but not by quotients, and take no roots of it. `remembers`: the law may have a memory."""

    driven = RATES

    def __init__(
        self, claim: Claim, any_inertia: bool = False, near: bool = False, quotients: bool = False, remembers: bool = False
    ) -> None:
        super().__init__(claim, Asking(nested=False) if quotients else Exactly())
        self.any_inertia, self.near = any_inertia or near, near
        self.q, self.w = variables("q", 0), variables("w")
        self.outside, self.moving, self.wheels = (claim.taken.get(word) is True for word in (OUTSIDE, MOVING, WHEELS))
        self.e = variables("e") if self.outside else NONE
        self.r, self.a = (variables(letter) if self.moving else NONE for letter in "ra")
        self.speeding = minus(self.a, cross(self.w, self.r))
        self.J, self.J_inverse = self._inertia()
        # dV/dw = J (w + lean q).
        self.lean = claim.numbers["lean"] if near else Fraction(0)
        # What the law's memory adds about each axis at most.
        self.added = claim.numbers["memory"] if remembers and claim.taken.get(REMEMBERS) else None
        self.leaning = [w + self.lean * q for w, q in zip(self.w, self.q[1:], strict=True)]
        self.rate = [w + r for w, r in zip(self.w, self.r, strict=True)]
        spin = apply(self.J, self.rate)
        self.H = variables("h") if self.wheels else spin
        self.stored = minus(self.H, spin)
        fields = {
            "attitude": self.q, "rate": self.w, "body_rate": self.rate, "target_rate": self.r,
            "target_acceleration": self.speeding, "external_torque": self.e, "position": variables("p"),
            "wheel_momentum": self.stored, "magnetic_field": variables("b"),
        }  # fmt: skip
        self.inputs = {
            name: p for field, value in fields.items() for name, p in wired(f"measurement.{field}", value).items()
        }
        # A statement about programs that read it says so.
        self.inputs[IS_VALID] = poly(1)
        self.sphere = dot(self.q, self.q) - 1
        self.still: dict[str, int] = dict.fromkeys(self.driven, 0)
        self.on_target, self.opposite = ({"q0": q0, "q1": 0, "q2": 0, "q3": 0} for q0 in (1, -1))
        # q' = q (0, w)/2.
        vector, half = self.q[1:], Fraction(1, 2)
        turned = [self.q[0] * w + c for w, c in zip(self.w, cross(vector, self.w), strict=True)]
        self.turning = [-half * dot(self.w, vector), *(half * part for part in turned)]
        self.rates = {f"q{k}": rate for k, rate in enumerate(self.turning)}

    def _inertia(self) -> tuple[Matrix, Matrix]:
        if self.any_inertia:
            pair = ([[var(f"{x}{min(i, k)}{max(i, k)}") for k in AXES] for i in AXES] for x in "ji")
            return next(pair), next(pair)
        return self.given, inverse(self.given)

    @cached_property
    def given(self) -> Rows:
        """Return the inertia in the claim."""
        return [[self.claim.subject[f"body.inertia.{min(i, k)}.{max(i, k)}"] for k in AXES] for i in AXES]

    @cached_property
    def off(self) -> Fraction:
        """Return a bound of |x.(J - J0) y| / (|x| |y|) for an inertia J near the given one, J0."""
        return self.claim.numbers["tolerance"] * sum(self.given[i][i] for i in AXES)

    def heaviest(self, x: Sequence[Poly]) -> list[Poly]:
        """Return expressions that are nonnegative for inertias near the given one, because x.Jx is at most the largest
        moment times |x|^2."""
        return [self.claim.numbers["inertia.most"] * dot(x, x) - dot(x, apply(self.J, x))] if self.near else []

    def shifted(self) -> list[Poly]:
        """Return expressions that are nonnegative for inertias near the given one, because |q0 w + w x q| <= |w|."""
        if not self.near:
            return []
        w, vector = self.w, self.q[1:]
        turned = [self.q[0] * x + c for x, c in zip(w, cross(w, vector), strict=True)]
        return [self.off * dot(w, w) - dot(turned, minus(apply(self.J, w), apply(self.given, w)))]

    @cached_property
    def signs(self) -> list[str]:
        """Return how the sign of the fed-back quaternion is updated; empty if it never changes."""
        words = [word for word in (SHORTEST, HYSTERESIS) if self.claim.taken.get(word)]
        demand(len(words) < 2, "the sign of the quaternion is chosen in two ways")
        return words

    @property
    def sign_assumed(self) -> str:
        """Return the assumption about that sign."""
        return "sign-at-once" if self.signs else "quaternion-as-fed"

    @property
    def untold(self) -> list[str]:
        """Return the assumption about a law that reads an external torque in a loop that has none."""
        reads = any(name.startswith(f"{TOLD_TORQUE}.") for name in self.claim.programs["law"].inputs)
        return ["untold-torque"] * (reads and not self.outside)

    @property
    def divisors(self) -> dict[str, Poly]:
        """Return the polynomials whose inverses are variables."""
        return {name: Poly(dict(terms)) for terms, name in self.ring.inverses.items()}

    @property
    def assumed(self) -> list[str]:
        """Return the assumptions about the body of this loop."""
        return [
            "rigid-body", "exact-measurement", "ideal-actuators",
            *(["inertia-near"] if self.near else [] if self.any_inertia else ["inertia-as-given"]),
            "known-outside-torque" if self.outside else "no-outside-torque",
            "known-target" if self.moving else "target-at-rest",
            "frictionless-wheels" if self.wheels else "no-wheels",
        ]  # fmt: skip

    @cached_property
    def law(self) -> list[Piecewise]:
        """Return the torque demanded by the law, case by case; for a law with a memory, without what the memory adds."""
        if self.added is None:
            return self.read("law", 3)
        program = self.claim.programs["law"]
        kept = [name for name in program.inputs if name.startswith("memory.")]
        memory = {name: var(f"m{k}") for k, name in enumerate(kept)}
        return [known(apart(cases, self.added)) for cases in self.read("law", len(program.outputs), memory)[:3]]

    @cached_property
    def sides(self) -> Piecewise:
        """Return the joint cases of the law's three torques, which are continuous."""
        demand(all(a.agrees(b) for cases in self.law for a, b in combinations(cases, 2)), "the law's torque jumps")
        return joined(self.law)

    @cached_property
    def quiet(self) -> Case:
        """Return the case that holds around all rests."""
        return around(self.sides, self.still)

    @cached_property
    def u(self) -> list[Poly]:
        """Return the torque of a law without switching."""
        return [single(cases) for cases in self.law]

    def balance(self, u: Sequence[Poly]) -> list[Poly]:
        """Return J w' under a torque of the law."""
        outside = minus(self.e, apply(self.J, self.speeding))
        return [torque + load for torque, load in zip(u, minus(outside, cross(self.rate, self.H)), strict=True)]

    @cached_property
    def acceleration(self) -> list[Poly]:
        """Return w' under a law without switching."""
        return apply(self.J_inverse, self.balance(self.u))

    @cached_property
    def lyapunov(self) -> Poly:
        """Return V minus its value at rest on target."""
        (V,) = self.single("lyapunov", 1, wired_matrix("craft.inertia", self.J))
        self.autonomous([V])
        return V - V.at(self.on_target | self.still)

    def autonomous(self, parts: Sequence[Poly], kept: str = "") -> None:
        """Refuse anything that depends on more than the state (and the inertia), and anything `kept`."""
        names = {name for part in parts for name in part.names if name[0] not in "qwj" + kept}
        demand(not names, f"the motion depends on more than the state: {', '.join(sorted(names))}")

    def expanded(self, p: Poly, rest: Mapping[str, int]) -> Poly:
        """Return p with the inverse of each divisor expanded to first order around a rest. No divisor of the program may
        vanish there, not even one that p does not use."""
        for z, divisor in self.divisors.items():
            d = divisor.at(rest).number
            demand(d != 0, "a program divides by zero at rest")
            p = p.at({z: (2 * d - divisor) * (1 / (d * d))})
        return p

    def sound(self) -> Shown:
        """Check that the inertia is valid and that the programs of the body's dynamics and kinematics are the equations
        above."""
        inverses = list[Poly]()
        if self.any_inertia:
            columns = list(zip(*self.J_inverse, strict=True))
            inverses = [dot(self.J[i], columns[k]) - (i == k) for i in AXES for k in AXES]
        if self.near or not self.any_inertia:
            yield "inertia", Definite(self.given)
        if self.near:
            most = self.claim.numbers["inertia.most"] - self.off
            yield "largest moment", Definite(plus(scalar(most), self.given, -1))
        pushed = variables("t")
        plant = wired_matrix("craft.inertia", self.J) | wired_matrix("craft.inverse_inertia", self.J_inverse)
        moved = self.single("body", 3, wired("rate", self.w), wired("torque", pushed), plant)
        wanted = minus(pushed, cross(self.w, apply(self.J, self.w)))
        yield from vanish("Euler's equation", minus(apply(self.J, moved), wanted), inverses)
        yield from vanish(
            "turning", minus(self.single("turning", 4, wired("q", self.q), wired("rate", self.w)), self.turning)
        )


def apart(cases: Piecewise, added: Fraction) -> Poly:
    """Return the mean of the two values that occur in cases without the memory; no case differs from it by more than the
    given number where that case holds."""
    ends = {
        tuple(sorted(p.terms.items())): p
        for p in (case.value for case in cases)
        if not any(name[0] == "m" for name in p.names)
    }
    demand(len(ends) == 2, "what a memory adds is not clipped on both sides")
    middle = total(ends.values()) * Fraction(1, 2)
    for case in cases:
        for beyond in (case.value - middle - added, middle - case.value - added):
            demand(positive(case.guards, beyond) is False, "a memory adds more torque than is stated")
    return middle


def around(cases: Piecewise, rest: Mapping[str, int]) -> Case:
    """Return the one case that holds in a neighbourhood of rest, with none of its conditions on its boundary."""
    sides = [[(Poly(dict(p)).at(rest).number, truth) for p, truth in case.guards] for case in cases]
    holds = [all(x != 0 and (x > 0) == truth for x, truth in guards) for guards in sides]
    demand(holds.count(True) == 1, "the law switches at rest")
    return cases[holds.index(True)]


def slopes(parts: Sequence[Poly], names: Sequence[str], at: Mapping[str, Poly | Fraction | int] | None = None) -> Rows:
    """Return the derivatives with respect to variables, at a point if one is given."""
    return [[(one.at(at) if at else one).number for one in map(p.slope, names)] for p in parts]


def over_period(feedback: Rows, h: Fraction) -> Rows:
    """Return the linear motion of (w, q) over a period in which the acceleration -feedback (w, q) is constant."""
    return plus(beside(scalar(1), scalar(0)), feedback, -h) + plus(beside(scalar(h / 2), scalar(1)), feedback, -h * h / 4)
