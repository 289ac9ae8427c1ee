"""The theorems on invariant sets of a small system x' = f(x), by functions V. Proofs: docs/kernel.md, section 7.

M is {V <= 0}, or an equilibrium. Where f jumps, x' is any convex combination of the values in the adjacent cells (Filippov).
Parameters are constant inputs, with all values in their intervals.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import combinations
from typing import Any

from ..cells import System, power
from ..numbers import RefusedError, demand, read_list
from ..polynomials import Poly, minus, poly, read_poly, var
from ..reading import Claim
from ..rules import Proof, Shown
from ..sentences import Statement, below


@dataclass(frozen=True)
class Function:
    """A function V of a system (its index), the level up to which it is considered (None: all), and the required sense of
    change: it decreases (1) or grows (-1)."""

    system: System
    place: int
    level: Fraction | None
    sense: int = 1

    def hint(self, name: str) -> Any:
        """Return the evidence's entry about this function, or None."""
        return self.system.claim.evidence.get(f"{name} of {self.system.roles[self.place]}")

    def hints(self, name: str) -> list[Any]:
        """Return a list of the evidence."""
        return read_list(self.hint(name) or [])

    @property
    def at_point(self) -> bool:
        """Tell whether M is the equilibrium."""
        return self.system.at_point and self.place == len(self.system.roles) - 1

    def on(self, i: int) -> Poly:
        """Return the function in a cell."""
        return self.system.all[i].V[self.place]

    def positive(self, name: str, i: int) -> list[Poly]:
        """Return polynomials that are together positive where V is: even powers of all variables, or a power of V."""
        powers = self.hint(name)
        if name != "shape" and type(powers) is int:
            return [power(self.on(i), powers)]
        demand(self.at_point and 0 not in read_list(powers, len(self.system.names)), "a power is not stated")
        return [power(var(x) * var(x), n) for x, n in zip(self.system.names, powers, strict=True)]

    def confined(self, most: Fraction | int = 0) -> Shown:
        """{V <= l} is compact and inside the box for each l < level, and M is as stated and nonempty: V >= level on the
        whole boundary or, without a boundary, V exceeds even powers. If V decreases while it is positive, M is nonempty if
        any state has V < level: it contains the minimiser of V."""
        system = self.system
        demand(self.level is None or self.level > 0, "a level is not positive")
        if self.at_point:
            demand(all(not cell.V[self.place].at(system.origin).terms for cell in system.around_point), "V is not zero")
            for i in system.cells:
                yield f"positive {self.place} {i}", system.sum(self.on(i), (i,), strict=self.positive("shape", i))
        else:
            demand(all(x in system.box for x in system.names), "a variable has no bounds")
            cell, state = system.state("member")
            least = cell.V[self.place].at(state).number
            demand(least <= 0 or least < most, "V is too large at the member of M")
        bordered = any(x in system.box for x in system.names)
        demand(self.level is not None or not bordered, "V has no level, but the box has a border")
        yield from self.border(self.level or 0)

    def border(self, least: Fraction | int, strict: Sequence[Poly] = ()) -> Shown:
        """V >= least on the whole boundary of the box (strict: larger)."""
        system = self.system
        for x in (name for name in system.names if name in system.box):
            for k, end in enumerate(system.box[x]):
                for i in system.cells:
                    yield f"border {self.place} {i} {x} {k}", system.sum(self.on(i) - least, (i,), (), strict, face={x: end})

    def changes(self, strictly: bool = True) -> Shown:
        """V decreases wherever 0 < V < level, or (not strictly) is non-increasing there; or where it is weakly decreasing a
        function E grows. Given are pairs of cells where it is weakly so, cells without a state with V > 0, and surfaces
        across which rates differ, each with a cell i and the multiple of the surface by which V_i is smaller."""
        system, surfaces = self.system, self.system.surfaces
        escape, weakly = self.hint("escape"), [tuple(read_list(pair, 2)) for pair in self.hints("weakly")]
        across: list[tuple[Any, ...]] = [tuple(read_list(entry, 3)) for entry in self.hints("across")]
        never = self.hints("never")
        demand(system.are_cells([*never, *(i for _, i, _ in across)]), "there are no such cells")
        demand(all(type(m) is int and 0 <= m < len(surfaces) for m, _, _ in across), "there are no such surfaces")
        for i in never:
            yield f"never {self.place} {i}", system.sum(-self.on(i), (i,))
        cells = [i for i in system.cells if i not in never]
        every = [(i, i, "", poly(0), poly(0)) for i in cells]
        every += [
            (i, j, f" on {m}", Poly(dict(surfaces[int(m)])), read_poly(c)) for m, i, c in across for j in cells if i in cells
        ]
        for i, j, on, m, c in every:
            if not system.meet(i, j):
                continue
            V, rates = self.on(i), system.all[j].rates
            rise = system.slope(V, rates) - c * system.slope(m, rates)
            room = [V] if self.level is None else [V, self.level - V]
            weak, zero, name = not strictly or (i, j) in weakly, [m] if on else [], f"changes {self.place} {i} {j}{on}"
            gap = self.positive("powers", i) if strictly else []
            yield name, system.sum(rise * -self.sense, (i, j), room, [] if weak else gap, zero)
            if weak and strictly:
                demand(escape is not None and self.sense == 1, "no function that grows is stated")
                yield f"{name} escapes", system.sum(system.slope(read_poly(escape), rates), (i, j), [*room, rise], gap, zero)
        for j, k in combinations(cells, 2):
            one, other = system.all[j], system.all[k]
            crossed = any(one.on(surfaces[int(m)], other) for m, i, _ in across if i in (j, k))
            if not crossed and system.meet(j, k):
                for n, p in enumerate(minus(one.rates, other.rates)):
                    yield from system.equal(f"agree {j} {k} {n}", p, (j, k))

    def where(self) -> str:
        """Write the set of starts of motions."""
        return "everywhere" if self.level is None else self.inside(f"{self.system.roles[self.place]} < {below(self.level)}")

    def inside(self, condition: str) -> str:
        """Write the set of states of the box where a condition holds."""
        return f"{{{condition}}}" + " of the box" * bool(self.system.box)

    def limit(self) -> str:
        """Write the limit set of motions."""
        return "the equilibrium" if self.at_point else f"{{{self.system.roles[self.place]} <= 0}}"


def stated(text: str, system: System) -> Statement:
    """Return a statement about a system with its assumptions."""
    jumps = any(name.startswith("across") for name in system.claim.evidence.content)
    whatever = ", whatever the parameters in their intervals" if system.parameters else ""
    return Statement(text + whatever, ("equations-as-given", *(["filippov"] if jumps else [])))


def attracts(claim: Claim) -> Proof:
    """All motions from {V < level} stay there and converge to M, which is stable (Lyapunov, LaSalle). With a `core`, a
    function with its own level that shows this for {core < core.level}, and with {V <= 0} inside that, they converge to its
    M. With a `start` the statement is about the motions from {start >= 0}, which lies in {V < level}."""
    start, core = "start" in claim.programs, "core" in claim.programs
    system = System(claim, *["start"] * start, "V", *["core"] * core)
    yield from system.sound()
    functions = [Function(system, int(start), claim.numbers.get("level"))]
    functions += [Function(system, 1 + start, claim.numbers["core.level"])] if core else []
    for V in functions:
        yield from V.confined(V.level or 0)
        yield from V.changes()
    for i in system.cells if core else ():
        *_, outer, inner = system.all[i].V
        yield f"inside {i}", system.sum(claim.numbers["core.level"] - inner, (i,), [-outer], [poly(1)])
    for i in system.cells if start else ():
        yield f"start {i}", system.sum(claim.numbers["level"] - functions[0].on(i), (i,), [system.all[i].V[0]], [poly(1)])
    where = functions[0].where()
    text = f"{functions[0].inside('start >= 0')} stay in {where}" if start else f"{where} stay there"
    return stated(f"all motions that start in {text} and come to {functions[-1].limit()}", system)


def stays(claim: Claim) -> Proof:
    """M is stable: no motion leaves {V <= l}, for any l < level (Lyapunov)."""
    system = System(claim, "V")
    yield from system.sound()
    V = Function(system, 0, claim.numbers["level"])
    yield from V.confined()
    yield from V.changes(strictly=False)
    return stated(f"{V.limit()} is stable: no motion leaves {V.where()}, nor any smaller such set", system)


def leaves(claim: Claim) -> Proof:
    """M is unstable: V is positive at states arbitrarily near to it, and grows wherever it is positive, so motions from
    these leave the box, in which V is bounded (Chetaev)."""
    system = System(claim, "V")
    yield from system.sound()
    V = Function(system, 0, None, -1)
    demand(all(x in system.box for x in system.names), "a variable has no bounds")
    if V.at_point:
        demand(not system.angles and not system.parameters, "a way out of the equilibrium is not exact")
        around = system.around_point
        demand(all(not cell.V[0].at(system.origin).terms for cell in around), "V is not zero at the equilibrium")
        still = (all(not rate.at(system.origin).terms for rate in cell.rates) for cell in around)
        demand(any(still), "the equilibrium is none")
        way = {x: var("t") * claim.numbers.coordinate(f"direction.{x}") for x in system.names}

        def leads(p: Poly) -> bool:
            # The first coefficient along the way is positive.
            terms = p.at(way).terms
            return bool(terms) and terms[min(terms, key=len)] > 0

        grows = ([c.V[0], *(Poly(dict(m)) * sign for m, sign in c.signs.items())] for c in around)
        demand(any(all(map(leads, parts)) for parts in grows), "V is not positive on the way")
    else:
        cell, state = system.state("member")
        demand(cell.V[0].at(state).number <= 0, "V is positive at the member of M")
        yield from V.border(0, [poly(1)])
    yield from V.changes()
    return stated(f"{V.limit()} is unstable: every motion that starts in the box where V > 0 leaves the box", system)


def avoids(claim: Claim) -> Proof:
    """No motion from {start >= 0} reaches {unsafe >= 0} (a barrier V): V <= 0 on the one and V > 0 on the other, both
    nonempty, and V' <= c V with a polynomial c, so V <= 0 for all time (Gronwall)."""
    system = System(claim, "start", "unsafe", "V")
    yield from system.sound()
    demand(not system.at_point, "there is no equilibrium in it")
    for k, place in enumerate(("start", "unsafe")):
        cell, state = system.state(place)
        demand(cell.V[k].at(state).number >= 0, f"the {place} is not shown to hold a state")
    for i in system.cells:
        start, unsafe, V = system.all[i].V
        yield f"start {i}", system.sum(-V, (i,), [start])
        yield f"unsafe {i}", system.sum(V, (i,), [unsafe], [poly(1)])
        for j in (j for j in system.cells if system.meet(i, j)):
            yield f"barrier {i} {j}", system.sum(-system.slope(V, system.all[j].rates), (i, j), zero=[V])
    within = " while it stays in the box" if any(x in system.box for x in system.names) else ""
    return stated(f"no motion that starts in {{start >= 0}} comes to {{unsafe >= 0}}{within}", system)


def fails(claim: Claim) -> Proof:
    """V violates a condition of one of the theorems at a state; the word of the claim names the condition."""
    system = System(claim, "V")
    cell, state = system.state("state")
    around = [cell for cell in system.all if cell.holds(state)]
    V, slope = cell.V[0].at(state).number, system.slope(cell.V[0], cell.rates).at(state).number
    inside = V > 0 and all(Poly(dict(surface)).at(state).number for surface in system.surfaces)
    away = system.at_point and any(state[x] for x in system.names)
    border = any(state[x] in system.box.get(x, ()) for x in system.names)
    still = slope == 0 and not any(rate.at(state).number for rate in cell.rates)
    falls_not = f"V rises, or the state is an equilibrium, where it is {below(V)}"
    ways = {
        "does not fall": (inside and (slope > 0 or still), falls_not),
        "does not grow": (inside and slope <= 0, f"V does not grow at a state where it is {below(V)}"),
        "reaches the border": (border, f"V is {below(V)} on the border of the box"),
        "is not positive": (away and V <= 0, "V is not positive at a state that is not the equilibrium"),
        "jumps": (any(c.V[0].at(state).number != V for c in around), "V jumps at a state"),
    }
    for word, (holds, text) in ways.items():
        if claim.taken.get(word):
            demand(holds, f"V is not shown to fail: {word}")
            return stated(text, system)
    raise RefusedError("how V fails is not stated")
    yield  # pragma: no cover
