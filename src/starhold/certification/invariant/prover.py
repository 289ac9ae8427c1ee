"""Finds evidence for the kernel's theorems on a function V: hints, the largest level, sums of squares. Nothing here is
trusted: evidence counts once the kernel has accepted it."""

from collections.abc import Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from itertools import product
from typing import Any

from starhold.certification.evidence.finding import by_digests, read, unproved
from starhold.certification.evidence.squares import text
from starhold.certification.evidence.sums import Guess, find, monomials
from starhold.kernel.numbers import RefusedError, rational
from starhold.kernel.polynomials import Poly
from starhold.kernel.programs import digest
from starhold.kernel.reading import Claim
from starhold.kernel.rules import Sum
from starhold.kernel.theorems import THEOREMS
from starhold.kernel.theorems.invariant import Function, System

LESS = (1e-5, 1e-4, 1e-3, 3e-3, 1e-2, 3e-2, 0.1)
"""How far below the largest level that floats find exact evidence is tried."""
HALVINGS = 18
CLOSE, FAR = 1e-5, 5e-4
"""How nearly floats find the largest level, for one cell and for more."""
DEGREES = {False: (0, 2), True: (0, 2, 4)}
"""Degrees above that of the obligation. Angles need more, because of their series, and so does a core that contains {V <=
0}, because of V."""
SLOPES = (0, 1, -1, 8, -8, 64, -64)
"""Multiples of a surface by which V is bent where it is crossed."""


@dataclass
class Attempt:
    """A claim for the kernel without its evidence: `programs` by role, `numbers` and `subject` as the kernel reads them;
    `given`: hints about other functions than V."""

    theorem: str
    programs: dict[str, dict[str, Any]]
    subject: dict[str, str]
    numbers: dict[str, str]
    scales: dict[str, float]
    basis: list[Poly] | None = None
    given: dict[str, Any] = field(default_factory=dict[str, Any])
    hints: dict[str, Any] = field(default_factory=dict[str, Any])
    taken: tuple[str, ...] = ()
    _done: dict[Any, Any] = field(default_factory=dict[Any, Any])

    def claim(self, evidence: Mapping[str, Any] | None = None) -> dict[str, Any]:
        """Return the claim as a certificate has it."""
        roles = {role: digest(program) for role, program in self.programs.items()}
        claim = unproved(self.theorem, roles, self.subject, self.numbers, self.taken)
        return claim | {"evidence": self.hints | dict(evidence or {})}

    def read(self) -> Claim:
        """Return the claim as the kernel has it, without a limit on work."""
        return read(deepcopy(self.claim()), by_digests(self.programs.values()))

    @cached_property
    def system(self) -> System:
        """The system with its functions, cut into cells."""
        return System(self.read(), *(role for role in self.programs if role != "rates"))

    def obligations(self) -> Mapping[str, Sum]:
        """Return what has to be shown; RefusedError where the claim is none."""
        return dict(THEOREMS[self.theorem](self.read()))  # pyright: ignore[reportReturnType]

    def missing(self, exact: bool = False, every: bool = False) -> tuple[list[str], dict[str, Any]]:
        """Return the names of obligations without evidence (the first, or every one), and the evidence of the others."""
        evidence, lacking = dict[str, Any](), list[str]()
        for name, o in self.obligations().items():
            key = (exact, name, str(o))
            if key not in self._done:
                shown = None if not exact and self._done.get((True, *key[1:]), 0) is None else self.shown(o, exact, name)
                self._done[key] = shown
            if self._done[key] is None:
                lacking.append(name)
                if not every:
                    break
            else:
                evidence[name] = self._done[key]
        return lacking, evidence

    def holds(self, surface: int) -> bool:
        """Return whether there is evidence for the obligations on a surface that is crossed."""
        return all(self.shown(o, name=name) for name, o in self.obligations().items() if f" on {surface}" in name)

    def shown(self, o: Sum, exact: bool = True, name: str = "") -> dict[str, Any] | None:
        """Return evidence for a sum, None where none was found."""
        basis = self.basis if name.startswith("changes") else None
        return find(o, self.scales, basis, DEGREES[bool(self.system.angles) or name.startswith("inside")], exact)


def proved(attempt: Attempt, top: float, escape: Poly | None) -> dict[str, Any] | str:
    """Return the claim with evidence, at the largest level up to `top` where none is given, or why none was found."""
    levelled = attempt.theorem in ("attracts", "is stable") and "level" not in attempt.numbers and top < float("inf")
    try:
        if levelled:
            attempt.numbers["level"] = written(0.5 * top)
        why = hinted(attempt, escape)
        if why and levelled:
            for share in (0.1, 0.01):
                attempt.numbers["level"] = written(share * top)
                why = hinted(attempt, escape)
                if not why:
                    break
        if why:
            return why
        if not levelled:
            lacking, evidence = attempt.missing(exact=True)
            return f"no exact evidence was found: {lacking[0]}" if lacking else attempt.claim(evidence)
        lacking: list[str] = []
        best = largest(attempt, float(rational(attempt.numbers["level"])), top)
        for less in LESS:
            attempt.numbers["level"] = written(best * (1.0 - less))
            lacking, evidence = attempt.missing(exact=True)
            if not lacking:
                return attempt.claim(evidence)
        return f"no exact evidence was found: {lacking[0]}"
    except RefusedError as reason:
        return str(reason)


def written(x: float) -> str:
    """Return a level with six digits, not above the number."""
    short = Fraction(f"{x:.6g}")
    return str(short if short <= Fraction(x) else Fraction(f"{x * (1.0 - 5e-6):.6g}"))


def largest(attempt: Attempt, low: float, top: float) -> float:
    """Return about the largest level for which floats have evidence."""
    high = top
    attempt.numbers["level"] = written(top * (1.0 - LESS[1]))
    if not attempt.missing()[0]:
        return top
    close = CLOSE if attempt.basis is None and len(attempt.system.cells) == 1 else FAR
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        attempt.numbers["level"] = written(middle)
        low, high = (low, middle) if attempt.missing()[0] else (middle, high)
        if high - low < close * high:
            break
    return low


def hinted(attempt: Attempt, escape: Poly | None) -> str:
    """Find hints with which floats have evidence for all obligations; return why there are none, or nothing."""
    system, role = attempt.system, "V"
    V = Function(system, system.roles.index(role), None)
    never = [i for i in system.cells if not V.on(i).terms]
    if attempt.theorem in ("avoids", "fails"):
        lacking, _ = attempt.missing()
        return f"no evidence was found: {lacking[0]}" if lacking else ""
    if not V.at_point or attempt.theorem == "is unstable":
        never += [i for i in system.cells if i not in never and attempt.shown(system.sum(-V.on(i), (i,)))]
    given = attempt.given | ({f"never of {role}": never} if never else {})
    if V.at_point and attempt.theorem != "is unstable":
        given[f"shape of {role}"] = shape([V.on(i) for i in system.cells], system.names)
    reason = ""
    for powers in candidates(attempt, V):
        attempt.hints = dict(given)
        if powers is not None:
            attempt.hints[f"powers of {role}"] = powers
        if attempt.basis and escape is not None:
            weakened(attempt, role, [f"changes 0 {i} {i}" for i in system.cells], escape)
        lacking = completed(attempt, role, escape)
        if not lacking:
            return ""
        reason = reason or lacking[0]
        if not lacking[0].startswith(("changes", "agree")):
            break
    return f"no evidence was found: {reason}"


def candidates(attempt: Attempt, V: Function) -> Iterator[Any]:
    """Yield what V' may be compared with: powers of the distance from the equilibrium, or powers of V."""
    if attempt.theorem == "is stable":
        yield None
        return
    system = V.system
    if V.at_point and attempt.theorem == "attracts":
        slopes = [-system.slope(V.on(i), system.all[i].rates) for i in system.cells]
        powers = shape(slopes, system.names)
        yield powers
        yield 1
        if powers != [1] * len(powers):
            yield [max(2, n) for n in powers]
        yield 2
        return
    yield from (1, 2, 3)


def shape(functions: Sequence[Poly], names: Sequence[str]) -> list[int]:
    """Return halves of the least even powers that variables have alone in all of some functions."""
    powers: list[int] = []
    for x in names:
        alone = [[len(m) for m, c in p.terms.items() if set(m) == {x} and len(m) % 2 == 0 and c > 0] for p in functions]
        powers.append(max(max((min(exponents, default=2) for exponents in alone), default=2) // 2, 1))
    return powers


def completed(attempt: Attempt, role: str, escape: Poly | None) -> list[str]:
    """Add hints about pairs of cells where V does not decrease strictly, and where rates jump; return what is unproved."""
    lacking: list[str] = []
    for _ in range(6):
        lacking, _ = attempt.missing(every=True)
        agree = [name for name in lacking if name.startswith("agree")]
        decreasing = [name for name in lacking if name.startswith("changes") and not name.endswith("escapes")]
        if len(agree) + len(decreasing) < len(lacking) or not lacking:
            return lacking
        changed = False
        if decreasing and attempt.theorem == "attracts":
            changed = weakened(attempt, role, decreasing, escape)
        elif agree:
            changed = crossed(attempt, role, agree[0])
        if not changed:
            return lacking
    return lacking


def pair(name: str) -> list[int]:
    """Return the cells of the name of an obligation."""
    words = name.split()
    return [int(words[1]), int(words[2])] if words[0] == "agree" else [int(words[2]), int(words[3])]


def weakened(attempt: Attempt, role: str, names: list[str], escape: Poly | None) -> bool:
    """Let V be non-increasing for some pairs, and find a function that grows there."""
    hint = f"weakly of {role}"
    pairs = [*attempt.hints.get(hint, []), *(pair(name) for name in names)]
    pairs = [cells for k, cells in enumerate(pairs) if cells not in pairs[:k]]
    if pairs == attempt.hints.get(hint, []):
        return False
    attempt.hints[hint] = pairs
    tried = [escape, -escape] if escape is not None else [escaping(attempt, role, cells) for cells in pairs[:1]]
    before = len(names) + 1
    for E in tried:
        if E is None:
            continue
        attempt.hints[f"escape of {role}"] = text(E)
        lacking = [name for name in attempt.missing(every=True)[0] if name.startswith("changes")]
        if len(lacking) < before:
            return True
    return False


def escaping(attempt: Attempt, role: str, cells: list[int]) -> Poly | None:
    """Return a function of low degree that grows where V' vanishes; None where none was found."""
    attempt.hints[f"escape of {role}"] = {}
    name = next(n for n in attempt.obligations() if n.endswith("escapes") and pair(n) == cells)
    o, system = attempt.obligations()[name], attempt.system
    for degree in (2, 3, 4):
        guess = Guess(o, attempt.scales, max(degree + 2, *(len(m) for m in o.p.terms or [()]), 4), [], attempt.basis)
        made = {next(iter(q.terms)): system.slope(q, system.all[cells[1]].rates) for q in monomials(system.names, degree, 1)}
        grown = guess.freed(made)
        if grown is not None:
            return grown
    return None


def crossed(attempt: Attempt, role: str, name: str) -> bool:
    """Find a surface on which V decreases for all means of the rates; whether there is one."""
    system, across, weakly = attempt.system, f"across of {role}", f"weakly of {role}"
    j, k = pair(name)
    known = deepcopy(attempt.hints)
    for c in SLOPES:
        places = [m for m, surface in enumerate(system.surfaces) if system.all[j].on(surface, system.all[k])]
        for m, i in product(places, (j, k)):
            attempt.hints = deepcopy(known)
            attempt.hints[across] = [*known.get(across, []), [m, i, {"": str(c)} if c else {}]]
            if attempt.holds(m):
                return True
            if weakly in known:
                attempt.hints[weakly] = [*known[weakly], *([i, n] for n in system.cells if [i, n] not in known[weakly])]
                if attempt.holds(m):
                    return True
    attempt.hints = known
    return False


def scales(box: Mapping[str, tuple[float, float]], point: Mapping[str, float]) -> dict[str, float]:
    """Return about how large variables become, counted from the equilibrium."""
    return {x: max(abs(low - point.get(x, 0.0)), abs(high - point.get(x, 0.0))) for x, (low, high) in box.items()}
