"""The theorems on invariant sets as claims: what each has to show, and the largest level at which it is shown.

M is a compact set, V its indicator: continuous, zero on M and positive elsewhere near it. V <= 0 counts as zero.

* `stable` (theorem 1): V' <= 0 near M.
* `attracts` (theorem 2): and no motion can stay where V' = 0 but in M.
* `region` (its corollary): all motions that start in {V <= level} stay there and come to M.
* `unstable` (theorem 3): V' > 0 wherever V > 0 in a neighbourhood; V need be positive somewhere in every neighbourhood only.
* `intersection` (theorem 4): M is where none of several V_k is positive, and each falls outside. Their maximum is a V.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import reduce
from typing import Any, NamedTuple

from starhold.algebra.polynomial import exact
from starhold.algebra.scalar import maximum
from starhold.certification.certificate import EXACT, Claim, Obligation, Outcome
from starhold.certification.invariant import enclosure, search
from starhold.certification.invariant.continuity import continuous
from starhold.certification.invariant.descent import Candidate, bounded, falls, jumps, leaves, positive, switches
from starhold.certification.invariant.measure import volume
from starhold.certification.invariant.system import Poly, System
from starhold.certification.matrices import number

INTERVALS = "interval arithmetic"
VERIFIED = "exact inequality"
THEOREMS = ("stable", "attracts", "region", "unstable", "intersection")
LESS = (1e-4, 1e-3, 3e-3, 1e-2, 3e-2, 0.1, 0.2, 0.3, 0.6, 0.9, 0.99)
"""How far below the level that floats suggest a proof is tried."""
PATIENCE = 4
"""Levels at which V falls that are tried for the rest of what has to be shown."""
SLIDES = "a motion may slide on a surface where the right-hand side jumps, and V is not shown to change there as it must"
STAYS = "no function is shown to grow where V' = 0: try another `escape`"
ASSUMPTIONS = (
    "the equations exactly as given",
    "where the right-hand side jumps, motions in the sense of Filippov: x' is any mean of what it is on the sides and on "
    "the surface",
)


@dataclass(frozen=True)
class WantedSet:
    """One claim to be shown. `V`: a polynomial or piecewise one, for `intersection` several; `box`: where, in the order of
    variables and parameters; `equilibrium`: the point that M is, a number for every variable, else None, and M is {V <= 0};
    `level`: the level to be shown, None: the largest that is found; `escape`: a function that grows wherever V' = 0 outside
    of M; `squares`: functions such that V' is a sum of their squares with negative factors; `known`: the area (or
    volume) of the true region, if somebody knows it."""

    theorem: str
    V: Any
    box: tuple[tuple[float, float], ...]
    equilibrium: tuple[Any, ...] | None = None
    level: float | None = None
    escape: Any = None
    squares: tuple[Any, ...] = ()
    known: float | None = None
    name: str = ""


@dataclass
class _Proof:
    """Obligations and numbers, gathered on the way to a claim."""

    wanted: WantedSet
    what: Candidate
    found: list[Obligation] = field(default_factory=list[Obligation])
    numbers: dict[str, Any] = field(default_factory=dict[str, Any])
    limit: dict[str, float] | None = None
    """The state that stops the level."""

    def add(self, name: str, how: str, holds: bool | None, evidence: dict[str, Any] | None = None) -> bool:
        outcome: Outcome = "proved" if holds else "undecided" if holds is None else "refuted"
        self.found.append(Obligation(name, how, outcome, evidence or {}))
        return bool(holds)

    def perhaps(self, name: str, holds: bool, reason: str) -> bool:
        """Add an obligation that is proved or else undecided."""
        return self.add(name, INTERVALS, True if holds else None, {} if holds else {"reason": reason})

    def claim(self) -> Claim:
        witness: dict[str, Any] = {"name": self.wanted.name, "box": [list(side) for side in self.wanted.box]}
        if self.limit is not None:
            witness["limit"] = self.limit
        told = {"theorem": self.wanted.theorem} | self.numbers
        assumptions = ASSUMPTIONS if jumps(self.what.pieces) else ASSUMPTIONS[:1]
        return Claim(f"invariant-{self.wanted.theorem}", told, witness, assumptions, tuple(self.found))


def indicator(wanted: WantedSet) -> Any:
    """The V of a claim; of several functions the largest, or zero."""
    return reduce(maximum, (*wanted.V, 0)) if wanted.theorem == "intersection" else wanted.V


def prove(system: System, wanted: WantedSet) -> Claim:
    """The claim with what was shown of it."""
    if wanted.theorem not in THEOREMS:
        raise ValueError(f"no theorem {wanted.theorem}")
    if len(wanted.box) != len(system.names):
        raise ValueError(f"a box of {len(wanted.box)} sides for {len(system.names)} variables and parameters")
    if wanted.equilibrium is not None and len(wanted.equilibrium) != len(system.variables):
        raise ValueError(f"an equilibrium of {len(wanted.equilibrium)} numbers for {len(system.variables)} variables")
    point = None if wanted.equilibrium is None else (*map(exact, wanted.equilibrium), *(None for _ in system.parameters))
    proof = _Proof(wanted, Candidate(system, indicator(wanted), wanted.box, point, wanted.squares))
    # In this order: what comes later makes no sense without what comes before.
    steps = [_equilibrium, _continuous, _member]
    steps += [_unstable] if wanted.theorem == "unstable" else [_positive, _falling]
    with enclosure.allowed(enclosure.ALL):
        for step in steps:
            if not step(proof):
                break
        return proof.claim()


def _equilibrium(proof: _Proof) -> bool:
    """That the point can be stayed at."""
    equilibrium, what = proof.what.equilibrium, proof.what
    if equilibrium is None:
        return True
    if not all(x is None or low < number(x) < high for x, (low, high) in zip(equilibrium, what.box, strict=True)):
        return proof.add("equilibrium", EXACT, None, {"reason": "the equilibrium is not inside the box"})
    cells = search.cells_at(what, equilibrium)
    rates = [[search.at(rate, equilibrium) for rate in cell.rates] for cell in cells]
    # A mean of two rates is zero where one is a negative multiple of the other: then a motion can stay by sliding.
    if any(all(rate.is_zero() for rate in own) for own in rates) or any(
        _balanced(one, other) for one in rates for other in rates
    ):
        return proof.add("equilibrium", EXACT, True)
    if len(cells) > 1:
        return proof.add("equilibrium", EXACT, None, {"reason": "no mean of the rates of two sides is zero there"})
    evidence = {"state": search.named(what, equilibrium), "rates": [str(rate) for rate in rates[0]]}
    return proof.add("equilibrium", EXACT, False, evidence)


def _balanced(one: list[Poly], other: list[Poly]) -> bool:
    """Whether the rates of two cells, not zero and without parameters, are opposite."""
    if not all(rate.is_constant() for rate in one + other):
        return False
    a, b = ([0 if rate.is_zero() else rate.leading_coefficient() for rate in own] for own in (one, other))
    place = next((k for k, x in enumerate(b) if x != 0), None)
    return (
        place is not None
        and a[place] / b[place] < 0
        and all(x == y * (a[place] / b[place]) for x, y in zip(a, b, strict=True))
    )


def _continuous(proof: _Proof) -> bool:
    how, holds, evidence = continuous(proof.what)
    return proof.add("continuous", how, holds, evidence)


def _member(proof: _Proof) -> bool:
    what = proof.what
    if what.equilibrium is not None:
        found = [search.at(cell.V, what.equilibrium) for cell in search.cells_at(what, what.equilibrium)]
        holds = all(V.is_zero() for V in found)
        evidence = {} if holds else {"state": search.named(what, what.equilibrium), "V": [str(V) for V in found]}
        return proof.add("set", EXACT, holds, evidence)
    if proof.wanted.theorem not in ("stable", "unstable"):
        # Shown by any state of {V <= level}, for the least V of that set cannot be positive where V falls.
        return True
    return _inhabited(proof, 0.0)


def _inhabited(proof: _Proof, level: float) -> bool:
    state = search.member(proof.what, level)
    if state is None:
        return proof.add("set", VERIFIED, None, {"reason": "no state with V <= 0 was found in the box"})
    return proof.add("set", VERIFIED, True, {"state": search.named(proof.what, state)})


def _positive(proof: _Proof) -> bool:
    """V > 0 outside of M: by definition, unless M is told to be an equilibrium."""
    what = proof.what
    if what.equilibrium is not None and not positive(what):
        refuted = search.not_positive(what)
        return proof.add("positive", INTERVALS, False if refuted else None, refuted or _exhausted())
    if what.equilibrium is not None:
        return proof.add("positive", INTERVALS, True)
    if bounded(what, 0.0):
        return True
    refuted = search.reaching(what, 0.0)
    return proof.add("bounded", INTERVALS, False if refuted else None, refuted or _exhausted())


def _unstable(proof: _Proof) -> bool:
    what = proof.what
    if what.equilibrium is None:
        holds = bounded(what, 0.0)
        refuted = None if holds else search.reaching(what, 0.0)
        near = proof.add("bounded", INTERVALS, True if holds else False if refuted else None, refuted or {})
    else:
        found = search.ray(what, lambda V, slope: V)
        reason = {"reason": "no direction was found in which V > 0"}
        near = proof.add("positive nearby", VERIFIED, True if found else None, found or reason)
    if not near:
        return False
    weak = falls(what, math.inf, -1)
    if weak is not None and not weak:
        proof.add("grows", INTERVALS, True)
        return not jumps(what.pieces) or proof.perhaps("switching", switches(what, math.inf, -1), SLIDES)
    refuted = search.rising(what, math.inf, -1)
    return proof.add("grows", INTERVALS, False if refuted else None, refuted or _exhausted())


class _Shown(NamedTuple):
    """A level at which V is shown to fall, and whether the rest is shown there too; `left` is None where nothing need be."""

    level: float
    crossed: bool
    left: bool | None


def _falling(proof: _Proof) -> bool:
    """The set {V <= level}: bounded, V falls on it. The largest level at which all is shown, unless one is given."""
    what, wanted = proof.what, proof.wanted
    if wanted.level is not None:
        shown = _at(proof, wanted.level)
        if shown is None:
            return _not_at(proof, wanted.level)
    else:
        if _refuted_near(proof):
            return False
        shown = _largest(proof)
        if shown is None:
            hint = "" if what.equilibrium is not None else "; where M is one point, say so by `equilibrium`"
            return proof.add("falls", INTERVALS, None, {"reason": _exhausted()["reason"] + hint})
    if what.equilibrium is None and wanted.theorem != "stable":
        _inhabited(proof, shown.level)
    proof.add("bounded", INTERVALS, True)
    proof.add("falls", INTERVALS, True)
    proof.numbers["level"] = shown.level
    if jumps(what.pieces):
        proof.perhaps("switching", shown.crossed, SLIDES)
    if shown.crossed and shown.left is not None:
        proof.perhaps("leaves", shown.left, STAYS)
    if what.equilibrium is None and shown.crossed:
        # Where V cannot rise it cannot become positive.
        proof.add("invariant", INTERVALS, True)
    _tell(proof, shown.level)
    return True


def _at(proof: _Proof, level: float) -> _Shown | None:
    """Try a level; None where V is not shown to fall."""
    what = proof.what
    weak = falls(what, level) if bounded(what, level) else None
    if weak is None:
        return None
    crossed = not jumps(what.pieces) or switches(what, level)
    if proof.wanted.theorem == "stable" or not crossed or not weak:
        return _Shown(level, crossed, None)
    escape = None if proof.wanted.escape is None else what.polynomial(proof.wanted.escape)
    return _Shown(level, crossed, leaves(what, weak, level, escape))


def _largest(proof: _Proof) -> _Shown | None:
    """At the largest level that is tried and shows all; else at the largest that shows that V falls."""
    # Where the set has to be stable only, motions may stay in it anywhere.
    guess, first, others = search.ceiling(proof.what, proof.wanted.theorem != "stable"), None, 0
    for less in LESS:
        shown = _at(proof, guess * (1.0 - less)) if guess > 0.0 else None
        if shown is not None and shown.crossed and shown.left is not False:
            return shown
        first = first or shown
        others += shown is not None
        if others == PATIENCE:
            break
    return first


def _not_at(proof: _Proof, level: float) -> bool:
    """A level that was asked for and is not shown."""
    proof.numbers["level"] = level
    reaching = search.reaching(proof.what, level)
    if reaching is not None:
        return proof.add("bounded", INTERVALS, False, reaching)
    rising = search.rising(proof.what, level)
    if rising is not None and (rising["V'"] > 0.0 or proof.wanted.theorem != "stable"):
        return proof.add("falls", INTERVALS, False, rising)
    return proof.add("falls", INTERVALS, None, _exhausted())


def _refuted_near(proof: _Proof) -> bool:
    """Whether motions are found to leave M, or V to rise however near M, so that there is no level."""
    leaving = search.leaving(proof.what) if proof.what.equilibrium is None else None
    if leaving is not None:
        proof.add("invariant", INTERVALS, False, leaving)
        return True
    ray = search.ray(proof.what, lambda V, slope: slope)
    if ray is not None:
        proof.add("falls", VERIFIED, False, ray)
    return ray is not None


def _tell(proof: _Proof, level: float) -> None:
    """How near the level is to what refutes, and how large the set."""
    what, numbers = proof.what, proof.numbers
    if proof.wanted.theorem in ("region", "intersection") and proof.wanted.level is None:
        rising, border = (find(what, math.inf, digits=search.NEAR) for find in (search.rising, search.reaching))
        kinds = {"V rises": rising, "border": border}
        above = {kind: float(found["V"]) for kind, found in kinds.items() if found}
        if above:
            numbers["limited_by"] = min(above, key=lambda kind: above[kind])
            numbers["refuted_level"] = above[numbers["limited_by"]]
            proof.limit = (kinds[numbers["limited_by"]] or {})["state"]
    if len(what.box) <= 3 and not what.system.parameters:
        numbers["size"] = volume(what, level)
        if proof.wanted.known is not None:
            numbers["known"] = proof.wanted.known


def _exhausted() -> dict[str, Any]:
    return {"reason": "neither shown with the boxes that were allowed nor refuted by a state"}
