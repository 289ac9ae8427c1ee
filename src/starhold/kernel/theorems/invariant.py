"""The theorems on invariant sets of a small system x' = f(x), by functions V. Proofs: docs/kernel.md, 7.

Rates f and V are piecewise polynomials, each piece (cell) taken with its border. Where f jumps, motions are those in
the sense of Filippov, and more: x' is any mean of what the cells have there. M is {V <= 0}, or an equilibrium. A
variable x may come with its sine and cosine, inputs `sin.x` and `cos.x`; parameters are inputs that stay, and have all
values of their intervals.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from itertools import combinations
from typing import Any

from ..cells import Shows, System, power
from ..numbers import RefusedError, demand, read_list
from ..polynomials import Poly, poly, read_poly, var
from ..programs import Condition
from ..reading import Claim
from ..rules import Shown
from ..sentences import Statement, below

CELLS, VARIABLES, POWER, TAYLOR = 64, 9, 6, 8


@dataclass(frozen=True)
class Function:
    """A function V of a system (its place among them), the level up to which it is looked at (None: all of them), and the
    sense in which it has to change: it falls (1) or grows (-1)."""

    system: System
    place: int
    level: Fraction | None
    sense: int = 1

    def hint(self, name: str) -> Any:
        """Return what the evidence tells about this function, None if nothing."""
        return self.system.claim.evidence.get(f"{name} of {self.system.roles[self.place]}")

    @property
    def at_point(self) -> bool:
        """Tell whether M is the equilibrium."""
        return self.system.at_point and self.place == len(self.system.roles) - 1

    def on(self, i: int) -> Poly:
        """Return the function in a cell."""
        return self.system.all[i].V[self.place]

    def positive(self, name: str, i: int) -> list[Poly]:
        """Return what is positive together where V is: even powers of all variables, or a power of V."""
        told = self.hint(name)
        if name != "shape" and type(told) is int:
            return [power(self.on(i), told)]
        demand(self.at_point and 0 not in read_list(told, len(self.system.names)), "a power is not told")
        return [power(var(x) * var(x), n) for x, n in zip(self.system.names, told, strict=True)]

    def confined(self, most: Fraction | int = 0) -> Shown:
        """{V <= l} is compact and inside of the box for each l < level, and M is as told and not empty: V >= level all
        over the border, and where there is none V is larger than even powers. Where V decreases as long as it is positive,
        M is not empty if any state has V < level: it has what the least V is reached at."""
        system = self.system
        demand(self.level is None or self.level > 0, "a level is not positive")
        if self.at_point:
            demand(all(not cell.V[self.place].at(system.origin).terms for cell, _ in system.around_point()), "V is not zero")
            for i in system.cells:
                yield f"positive {self.place} {i}", system.sum(self.on(i), (i,), strict=self.positive("shape", i))
        else:
            demand(all(x in system.box for x in system.names), "a variable has no bounds")
            cell, state = system.state("member")
            least = cell.V[self.place].at(state).number
            demand(least <= 0 or least < most, "V is too large at the member of M")
        for x in (name for name in system.names if name in system.box):
            for k, end in enumerate(system.box[x]):
                demand(self.level is not None, "V has no level, but the box has a border")
                for i in system.cells:
                    above = system.sum(self.on(i) - (self.level or 0), (i,), face={x: end})
                    yield f"border {self.place} {i} {x} {k}", above

    def changes(self, strictly: bool = True) -> Shown:
        """V decreases all the time where 0 < V < level, or (not strictly) does not grow there.

        Almost always V' = grad V_i.v for every cell i that holds the state, with a mean v of the rates of all that do,
        and v is along each surface m that does. So it is enough that (grad V_i - c grad m).f_j < 0 for one i and every j,
        whatever c is. Where it is only <= 0, E is to grow where it vanishes: then E - LV does for a large L on {l <= V},
        for any l > 0."""
        system, escape = self.system, self.hint("escape")
        E = None if escape is None else read_poly(escape)
        weakly = [tuple(read_list(pair, 2)) for pair in read_list(self.hint("weakly") or [])]
        across = [tuple(read_list(entry, 3)) for entry in read_list(self.hint("across") or [])]
        demand(all(system.are_cells((i,)) and type(m) is int for m, i, _ in across), "there are no such cells")
        demand(all(0 <= m < len(system.surfaces) for m, _, _ in across), "there are no such surfaces")
        chosen: set[tuple[Condition, int]] = {(system.surfaces[m], i) for m, i, _ in across}
        every = [(i, i, None, poly(0)) for i in system.cells]
        every += [(i, j, system.surfaces[m], read_poly(c)) for m, i, c in across for j in system.cells]
        never = read_list(self.hint("never") or [])
        for i in never:
            demand(system.are_cells([i]), "there are no such cells")
            yield f"never {self.place} {i}", system.sum(-self.on(i), (i,))
        for i, j, surface, c in every:
            V, rates, m = self.on(i), system.all[j].rates, Poly(dict(surface or ()))
            if i in never or j in never or not system.meet(i, j):
                continue
            rise = system.slope(V, rates) - c * system.slope(m, rates)
            room = [V] if self.level is None else [V, self.level - V]
            name = f"changes {self.place} {i} {j}" + (f" on {system.surfaces.index(surface)}" if surface else "")
            weak, zero = not strictly or (i, j) in weakly, [m] if surface else []
            gap = [] if weak else self.positive("powers", i)
            yield name, system.sum(rise * -self.sense, (i, j), room, gap, zero)
            if weak and strictly:
                demand(E is not None and self.sense == 1, "no function is told that grows")
                grows = system.slope(E or poly(0), rates)
                yield f"{name} escapes", system.sum(grows, (i, j), [*room, rise], self.positive("powers", i), zero)
        for j, k in combinations(system.cells, 2):
            one, other = system.all[j], system.all[k]
            if one.rates == other.rates or not system.meet(j, k) or j in never or k in never:
                continue
            if not any(one.on(surface, other) for surface, i in chosen if i in (j, k)):
                for n, (a, b) in enumerate(zip(one.rates, other.rates, strict=True)):
                    for sign in (1, -1) if (a - b).terms else ():
                        yield f"agree {j} {k} {n} {sign:+d}", system.sum((a - b) * sign, (j, k))

    def where(self) -> str:
        """Write the set that motions start from."""
        inside = "" if not self.system.box else " of the box"
        return "everywhere" if self.level is None else f"{{{self.system.roles[self.place]} < {below(self.level)}}}{inside}"

    def limit(self) -> str:
        """Write the set that motions come to."""
        return "the equilibrium" if self.at_point else f"{{{self.system.roles[self.place]} <= 0}}"


def stated(text: str, system: System) -> Statement:
    """Return a statement about a system with what it assumes."""
    jumps = any(name.startswith("across") for name in system.claim.evidence.content)
    whatever = ", whatever the parameters in their intervals" if system.parameters else ""
    return Statement(text + whatever, ("equations-as-given", *(["filippov"] if jumps else [])))


def attracts(claim: Claim) -> Shows:
    """All motions from {V < level} stay there and come to M, which is stable (Lyapunov, LaSalle). With a `core`, a function
    with a level of its own that shows this of {core < core.level}, and with {V <= 0} inside of that, they come to its M."""
    core = "core" in claim.programs
    system = System(claim, *(["V", "core"] if core else ["V"]))
    yield from system.sound()
    functions = [Function(system, 0, claim.numbers.get("level"))]
    functions += [Function(system, 1, claim.numbers["core.level"])] if core else []
    for V in functions:
        yield from V.confined(V.level or 0)
        yield from V.changes()
    for i in system.cells if core else ():
        outer, inner = system.all[i].V
        yield f"inside {i}", system.sum(claim.numbers["core.level"] - inner, (i,), [-outer], [poly(1)])
    return stated(f"all motions that start in {functions[0].where()} stay there and come to {functions[-1].limit()}", system)


def stays(claim: Claim) -> Shows:
    """M is stable: no motion leaves {V <= l}, for any l < level (Lyapunov)."""
    system = System(claim, "V")
    yield from system.sound()
    V = Function(system, 0, claim.numbers["level"])
    yield from V.confined()
    yield from V.changes(strictly=False)
    return stated(f"{V.limit()} is stable: no motion leaves {V.where()}, nor any smaller such set", system)


def leaves(claim: Claim) -> Shows:
    """M is unstable: V is positive at states as near to it as one likes, and grows wherever it is positive, so that motions
    from these leave the box, in which it is bounded (Chetaev)."""
    system = System(claim, "V")
    yield from system.sound()
    V = Function(system, 0, None, -1)
    demand(all(x in system.box for x in system.names), "a variable has no bounds")
    if V.at_point:
        demand(not system.angles and not system.parameters, "a way out of the equilibrium is not exact")
        around = [cell for cell, _ in system.around_point()]
        demand(all(not cell.V[0].at(system.origin).terms for cell in around), "V is not zero at the equilibrium")
        still = (all(not rate.at(system.origin).terms for rate in cell.rates) for cell in around)
        demand(any(still), "the equilibrium is none")
        way = {x: var("t") * claim.numbers.coordinate(f"direction.{x}") for x in system.names}

        def leading(p: Poly) -> Fraction:
            terms = p.at(way).terms
            return terms[min(terms, key=len)] if terms else Fraction(0)

        inside = (all(leading(Poly(dict(s))) * sign > 0 for s, sign in cell.signs.items()) for cell in around)
        demand(any(i and leading(c.V[0]) > 0 for i, c in zip(inside, around, strict=True)), "V is not positive on the way")
    else:
        cell, state = system.state("member")
        demand(cell.V[0].at(state).number <= 0, "V is positive at the member of M")
        for x in system.names:
            for k, end in enumerate(system.box[x]):
                for i in system.cells:
                    yield f"border 0 {i} {x} {k}", system.sum(V.on(i), (i,), (), [poly(1)], face={x: end})
    yield from V.changes()
    return stated(f"{V.limit()} is unstable: every motion that starts in the box where V > 0 leaves the box", system)


def avoids(claim: Claim) -> Shows:
    """No motion from {start >= 0} comes to {unsafe >= 0} (a barrier V): V <= 0 on the one and V > 0 on the other, neither of
    them empty, and V' <= c V with a polynomial c, so that V <= 0 for ever (Gronwall)."""
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


def fails(claim: Claim) -> Shows:
    """V is not as one of the theorems needs it, at a state. What of it is the word that the claim is taken with."""
    system = System(claim, "V")
    cell, state = system.state("state")
    at = {surface: Poly(dict(surface)).at(state).number for surface in system.surfaces}
    around = [c for c in system.all if all(at[m] * sign >= 0 if sign else at[m] == 0 for m, sign in c.signs.items())]
    V, slope = cell.V[0].at(state).number, system.slope(cell.V[0], cell.rates).at(state).number
    inside = V > 0 and all(at.values())
    away = system.at_point and any(state[x] for x in system.names)
    border = any(state[x] in system.box.get(x, ()) for x in system.names)
    still = slope == 0 and not any(rate.at(state).number for rate in cell.rates)
    ways = {
        "does not fall": (
            inside and (slope > 0 or still),
            f"V rises, or the state is an equilibrium, where it is {below(V)}",
        ),
        "does not grow": (inside and slope <= 0, f"V does not grow at a state where it is {below(V)}"),
        "reaches the border": (border, f"V is {below(V)} on the border of the box"),
        "is not positive": (away and V <= 0, "V is not positive at a state that is not the equilibrium"),
        "jumps": (any(c.V[0].at(state).number != V for c in around), "V jumps at a state"),
    }
    for word, (holds, text) in ways.items():
        if claim.taken.get(word):
            demand(holds, f"V is not shown to fail: {word}")
            return stated(text, system)
    raise RefusedError("it is not told how V fails")
    yield  # pragma: no cover
