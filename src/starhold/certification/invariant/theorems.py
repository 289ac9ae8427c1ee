"""The theorems on invariant sets as claims: the obligations of each, and the largest level for which they are proved.

M is a compact set, V its indicator: continuous, zero on M and positive elsewhere near it. V <= 0 counts as zero.

* `stable` (theorem 1): V' <= 0 near M.
* `attracts` (theorem 2): and no motion can stay where V' = 0 except in M.
* `region` (its corollary): all motions that start in {V <= level} stay there and come to M.
* `unstable` (theorem 3): V' > 0 wherever V > 0 in a neighbourhood; V need be positive somewhere in every neighbourhood only.
* `intersection` (theorem 4): M is where none of several V_k is positive, and each decreases outside. Their maximum is a V.
* `avoids`: no motion from one set comes to another. V <= 0 on the one, V > 0 on the other, V' <= c V with a polynomial c.
"""

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import reduce
from typing import Any

from starhold.algebra.polynomial import pieces
from starhold.algebra.scalar import maximum, minimum
from starhold.certification.certificate import Claim, Obligation
from starhold.certification.evidence.finding import certificate
from starhold.certification.invariant import search
from starhold.certification.invariant.prover import Attempt, proved, scales
from starhold.certification.invariant.search import Candidate
from starhold.certification.invariant.system import System, program, turned
from starhold.certification.matrices import fraction, unlimited
from starhold.kernel.check import prove as kernel_proves
from starhold.kernel.numbers import RefusedError
from starhold.kernel.polynomials import Poly as Exact
from starhold.kernel.polynomials import var
from starhold.kernel.reading import Claim as KernelClaim
from starhold.kernel.reading import read_certificate

SQUARES, VERIFIED = "sums of squares", "exact inequality"
KERNEL = {"stable": "is stable", "unstable": "is unstable", "avoids": "avoids"}
"""The kernel's theorems; the others are about what attracts."""
THEOREMS = ("stable", "attracts", "region", "unstable", "intersection", "avoids")
ATTRACTING = ("attracts", "region")
"""The theorems that may have a core, and a set from which motions start."""
STEPS = {
    "positive": "positive", "border": "bounded", "changes": "falls", "agree": "switching", "continuous": "continuous",
    "never": "falls", "start": "start", "unsafe": "unsafe", "barrier": "barrier",
}  # fmt: skip
"""The steps of a theorem, by the words with which the names of the kernel's obligations begin."""
ASSUMPTIONS = "equations-as-given", "filippov"
NEAR = 1e-6
"""An increase of V below this share of the largest V leaves no level."""


@dataclass(frozen=True)
class WantedSet:
    """One claim to be shown. `V`: a polynomial or piecewise one, for `intersection` several; `box`: where, in the order of
    variables and parameters; `equilibrium`: the point that M is, a number for every variable, else None, and M is {V <= 0};
    `level`: the level to be shown, None: the largest that is found; `escape`: a function that grows wherever V' = 0 outside
    of M; `squares`: functions that vanish on M, of whose multiples squares are made; `core`: in place of V an indicator of
    M, which is shown to attract from a set that holds {V <= 0}; `start` and, for `avoids`, `unsafe`: functions of which none
    is negative in these sets; `known`: the area (or volume) of the true region, if somebody knows it; `published`: the
    largest level that somebody has shown."""

    theorem: str
    V: Any
    box: tuple[tuple[float, float], ...]
    equilibrium: tuple[Any, ...] | None = None
    level: float | None = None
    escape: Any = None
    squares: tuple[Any, ...] = ()
    core: Any = None
    start: tuple[Any, ...] = ()
    unsafe: tuple[Any, ...] = ()
    known: float | None = None
    published: float | None = None
    name: str = ""


@dataclass(frozen=True)
class Shown:
    """A claim with what was shown of it, and as the kernel reads it with its programs, where that is proved or refuted."""

    claim: Claim
    kernel: dict[str, Any] | None
    programs: tuple[dict[str, Any], ...]


def indicator(wanted: WantedSet) -> Any:
    """Return the V of a claim; of several functions the largest, or zero."""
    return reduce(maximum, (*wanted.V, 0)) if wanted.theorem == "intersection" else wanted.V


def common(functions: Sequence[Any]) -> Any:
    """Return the function that is not negative where none of several is."""
    return reduce(minimum, functions)


def a_state(system: System, wanted: WantedSet, functions: Sequence[Any]) -> tuple[Any, ...]:
    """Return an exact state at which none of these functions is negative; ValueError where none is found in the box."""
    state = search.member(Candidate(system, 0 - common(functions), wanted.box), 0.0) if functions else None
    if state is None:
        raise ValueError("a set without a state in the box")
    return state


def prove(system: System, wanted: WantedSet) -> Claim:
    """Return the claim with what was shown of it."""
    return show(system, wanted).claim


def show(system: System, wanted: WantedSet) -> Shown:
    """Prove a claim as far as possible."""
    if wanted.theorem not in THEOREMS:
        raise ValueError(f"no theorem {wanted.theorem}")
    if len(wanted.box) != len(system.names):
        raise ValueError(f"a box of {len(wanted.box)} sides for {len(system.names)} variables and parameters")
    if wanted.equilibrium is not None and len(wanted.equilibrium) != len(system.variables):
        raise ValueError(f"an equilibrium of {len(wanted.equilibrium)} numbers for {len(system.variables)} variables")
    if system.angles and (wanted.equilibrium is None or wanted.theorem == "unstable"):
        raise ValueError(f"{wanted.theorem} with angles: sets and states with a sine or cosine have no exact values")
    if wanted.theorem == "avoids" and wanted.equilibrium is not None:
        raise ValueError("a claim of avoidance has no equilibrium")
    if any(wanted.equilibrium[system.variables.index(x)] for x in system.angles if wanted.equilibrium):
        raise ValueError("an equilibrium at which an angle is not zero")
    attracting = not system.angles and wanted.theorem in ATTRACTING
    if wanted.core is not None and not attracting:
        raise ValueError("a core is only for claims of attraction, in a system without angles")
    if wanted.start and wanted.theorem != "avoids" and (not attracting or wanted.level is None):
        raise ValueError("a start set is only for avoidance, or attraction at a given level in a system without angles")
    return _Proof(wanted, candidate(system, wanted)).shown()


def candidate(system: System, wanted: WantedSet) -> Candidate:
    """Return the function V of a claim with its box; of the point that M is if no core is about that."""
    point = None
    if wanted.core is None and wanted.equilibrium is not None:
        point = tuple(map(fraction, wanted.equilibrium))
    return Candidate(system, indicator(wanted), wanted.box, point)


class _Proof:
    """One claim on its way to the kernel."""

    def __init__(self, wanted: WantedSet, what: Candidate) -> None:
        self.wanted, self.what = wanted, what
        system = what.system
        self.programs = {"rates": program(system.rates, system.inputs)}
        self.states: dict[str, tuple[Any, ...]] = {}
        avoids = wanted.theorem == "avoids"
        for role, functions in (("start", wanted.start), ("unsafe", wanted.unsafe)):
            if avoids:
                self.states[role] = a_state(system, wanted, functions)
            if functions:
                self.programs[role] = program([common(functions)], system.inputs)
        self.programs["V"] = program([what.V], system.inputs)
        if wanted.core is not None:
            self.programs["core"] = program([wanted.core], system.inputs)
        self.unstable = wanted.theorem == "unstable"
        self.numbers: dict[str, Any] = {"theorem": wanted.theorem}
        if wanted.level is not None and not self.unstable:
            self.numbers["level"] = wanted.level
        self.witness: dict[str, Any] = {"name": wanted.name, "box": [list(side) for side in wanted.box]}
        self.witness |= {"equilibrium": wanted.equilibrium is not None, "start": bool(wanted.start)}

    def shown(self) -> Shown:
        """Return the claim with its outcome."""
        kernel = self.avoided() if self.states else self.proof()
        if not isinstance(kernel, str):
            statement = kernel_proves(claim_of(kernel, self.programs)).statement
            if "level" in kernel["numbers"]:
                self.numbers["level"] = float(Fraction(kernel["numbers"]["level"]))
            self.tell()
            return self.made(Obligation("proof", SQUARES, "proved"), kernel, "filippov" in statement.assumptions)
        for role in ("core", "start"):
            self.programs.pop(role, None)
        for name, word, find in self.refutations():
            state = find()
            if state is not None:
                return self.made(Obligation(name, VERIFIED, "refuted", state), self.against(word, state))
        step = next((what for word, what in STEPS.items() if f": {word}" in kernel), "falls")
        name = "grows" if self.unstable and step == "falls" else step
        return self.made(Obligation(name, SQUARES, "undecided", {"reason": kernel}), None)

    def made(self, obligation: Obligation, kernel: dict[str, Any] | None, jumps: bool = False) -> Shown:
        """Return the claim."""
        assumptions = ASSUMPTIONS if jumps else ASSUMPTIONS[:1]
        claim = Claim(f"invariant-{self.wanted.theorem}", self.numbers, self.witness, assumptions, (obligation,))
        return Shown(claim, kernel, tuple(self.programs.values()))

    def attempt(
        self, theorem: str, numbers: dict[str, Fraction], taken: tuple[str, ...] = (), within: bool = True
    ) -> Attempt:
        """Return a claim still without evidence, about the states of the box (`within`) or about all states."""
        wanted, system = self.wanted, self.what.system
        box = dict(zip(system.names, wanted.box, strict=True))
        subject = search.sides(system.names, wanted.box)
        if not within:
            subject = {f"box.{x}.{k}": subject[f"box.{x}.{k}"] for x in system.parameters for k in (0, 1)}
        point: dict[str, Any] = {}
        if wanted.equilibrium is not None:
            point = dict(zip(system.variables, map(fraction, wanted.equilibrium), strict=True))
        all_numbers = {f"equilibrium.{x}": v for x, v in point.items()} | numbers
        sizes = scales(box, {x: float(v) for x, v in point.items()})
        for x in system.angles:
            sizes |= {turned("sin", x): min(sizes[x], 1.0), turned("cos", x): min(sizes[x] ** 2 / 2.0, 2.0)}
        basis = [self.polynomial(h) for h in wanted.squares] or None
        return Attempt(
            theorem, self.programs, subject, {x: str(v) for x, v in all_numbers.items()}, sizes, basis, taken=taken
        )

    def polynomial(self, function: Any) -> Exact:
        """Return a function that is not piecewise in the kernel's form: relative to the equilibrium, with 1 - cos for a
        cosine."""
        system = self.what.system
        first, *more = pieces(function)
        if more:
            raise ValueError("the function has to be one polynomial")
        point = zip(system.variables, self.wanted.equilibrium or (), strict=False)
        about = {x: var(x) + fraction(at) for x, at in point}
        about |= {cosine: 1 - var(cosine) for cosine in (turned("cos", x) for x in system.angles)}
        return Exact({tuple(sorted(m)): fraction(c) for m, c in first.value.terms.items()}).at(about)

    def proof(self) -> dict[str, Any] | str:
        """Return the claim with evidence that the kernel accepts, or why there is none."""
        wanted, what, numbers = self.wanted, self.what, dict[str, Fraction]()
        levelled = wanted.level is not None and not self.unstable
        top = math.inf if self.unstable or levelled else search.ceiling(what, wanted.theorem != "stable")
        if top <= 0.0:
            return "V is not positive on the border of the box, or V increases at arbitrarily small values: border"
        if levelled:
            numbers["level"] = Fraction(wanted.level or 0.0)
        given = dict[str, Any]()
        if wanted.core is not None:
            inner = self.inner()
            if isinstance(inner, str):
                return inner
            inherited = {"core.level" if name == "level" else name: Fraction(x) for name, x in inner["numbers"].items()}
            numbers |= {name: x for name, x in inherited.items() if not name.startswith("equilibrium")}
            given = {f"{name[:-1]}core": hint for name, hint in inner["evidence"].items() if name.endswith(" of V")}
            self.numbers["core"] = float(numbers["core.level"])
        if what.equilibrium is None and not any(name.startswith("member") for name in numbers):
            decreasing = wanted.theorem not in ("stable", "unstable")
            member = search.member(what, min(wanted.level or math.inf, 0.1 * top) if decreasing else 0.0)
            if member is None:
                return "no state with V <= 0 was found in the box: member"
            numbers |= {f"member.{x}": v for x, v in zip(what.system.names, member, strict=True)}
        elif self.unstable and what.equilibrium is not None:
            way = search.ray(what)
            if way is None:
                return "no direction was found in which V > 0: direction"
            numbers |= {f"direction.{x}": v for x, v in way.items()}
        escape = None if wanted.escape is None else self.polynomial(wanted.escape)
        attempt = self.attempt(KERNEL.get(wanted.theorem, "attracts"), numbers)
        attempt.given = given
        return proved(attempt, top, escape)

    def inner(self) -> dict[str, Any] | str:
        """Return the claim of the core alone, or why there is no evidence of it."""
        alone = replace(self.wanted, V=self.wanted.core, core=None, start=(), level=None)
        return _Proof(alone, candidate(self.what.system, alone)).proof()

    def avoided(self) -> dict[str, Any] | str:
        """Return the claim that one set avoids another with its evidence: of all states, or else in the box."""
        names = self.what.system.names
        numbers = {f"{role}.{x}": v for role, at in self.states.items() for x, v in zip(names, at, strict=True)}
        for self.numbers["within"] in (False, True):
            proof = proved(self.attempt("avoids", numbers, within=self.numbers["within"]), math.inf, None)
            if not isinstance(proof, str):
                break
        return proof

    def refutations(self) -> list[tuple[str, str, Callable[[], dict[str, Any] | None]]]:
        """Return what may refute the claim: the names of what is needed and of how V fails, and a search for a state."""
        what, level = self.what, self.wanted.level
        if what.system.angles or self.states:
            return []
        sense, word = (-1, "does not grow") if self.unstable else (1, "does not decrease")
        attempts: list[tuple[str, str, Callable[[], dict[str, Any] | None]]] = []
        attempts.append(("continuous", "jumps", lambda: search.jump(what)))
        if what.equilibrium is not None and not self.unstable:
            attempts.append(("positive", "is not positive", lambda: search.not_positive(what)))
        if not self.unstable or what.equilibrium is None:
            border = 0.0 if level is None or self.unstable else level
            attempts.append(("bounded", "reaches the border", lambda: search.reaching(what, border)))
        least = math.inf if self.unstable else level if level is not None else self.near()
        name = "grows" if self.unstable else "falls"

        def changes() -> dict[str, Any] | None:
            state = search.rising(what, least, sense)
            weak = self.wanted.theorem == "stable" and state is not None and state["V'"] <= 0.0
            return None if weak else state

        return [*attempts, (name, word, changes)]

    def near(self) -> float:
        """Return a V so small that no level can be claimed if it increases there."""
        values = search.Values(self.what, search.grid(self.what.box)).V
        return NEAR * float(abs(values[values == values]).max(initial=0.0))

    def against(self, word: str, state: dict[str, Any]) -> dict[str, Any] | None:
        """Return the claim that V fails at a state, where the kernel accepts it."""
        numbers = {f"state.{x}": Fraction(v) for x, v in state["state"].items()}
        refutation = self.attempt("fails", numbers, (word,)).claim()
        try:
            kernel_proves(claim_of(refutation, self.programs))
        except RefusedError:
            return None
        return refutation

    def tell(self) -> None:
        """Say how near the level is to what refutes, and about how large the set."""
        what, numbers = self.what, self.numbers
        if self.wanted.theorem in ("region", "intersection") and self.wanted.level is None and not what.system.angles:
            rising, border = (find(what, math.inf, digits=search.NEAR) for find in (search.rising, search.reaching))
            kinds = {"V rises": rising, "border": border}
            above = {kind: float(state["V"]) for kind, state in kinds.items() if state}
            if above:
                numbers["limited_by"] = min(above, key=lambda kind: above[kind])
                numbers["refuted_level"] = above[numbers["limited_by"]]
                self.witness["limit"] = (kinds[numbers["limited_by"]] or {})["state"]
        if len(what.box) <= 3 and not what.system.parameters and "level" in numbers:
            # In the middles of equal parts of the box.
            count = search.POINTS[len(what.box)]
            parts = [(low + (high - low) / count / 2.0, high - (high - low) / count / 2.0) for low, high in what.box]
            inside = numbers["level"] >= search.Values(what, search.grid(parts)).V
            numbers["size"] = float(inside.mean() * math.prod(high - low for low, high in what.box))
            if self.wanted.known is not None:
                numbers["known"] = self.wanted.known


def claim_of(claim: dict[str, Any], programs: dict[str, dict[str, Any]]) -> KernelClaim:
    """Return a claim as the kernel reads it in a certificate."""
    unlimited()
    return read_certificate(json.dumps(certificate([*programs.values()], [claim])))[0]
