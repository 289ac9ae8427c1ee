"""Systems of few variables, wired from programs as cells on which rates and functions are polynomials."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import combinations
from math import factorial
from typing import Any

from .numbers import demand, read_list
from .polynomials import Poly, minus, poly, total, var
from .programs import Condition, Exactly, Guards, joined, known
from .reading import Claim
from .rules import Shown, Sum

CELLS, VARIABLES, POWER, TAYLOR = 64, 9, 6, 8
State = dict[str, Fraction]


@dataclass(frozen=True)
class Cell:
    """A cell is the set where its surfaces times their signs are nonnegative (sign 0: where a surface vanishes)."""

    signs: dict[Condition, int]
    rates: list[Poly]
    V: list[Poly]

    def on(self, surface: Condition, other: Cell) -> bool:
        """Tell whether the two cells meet only on a surface."""
        ends = [cell.signs.get(surface, 2) for cell in (self, other)]
        return 0 in ends or ends[0] == -ends[1]

    def holds(self, state: State) -> bool:
        """Tell whether the cell contains a state, for some values of the free parameters."""
        sides = [(Poly(dict(surface)).at(state), sign) for surface, sign in self.signs.items()]
        return all(x.names or (x.number * sign >= 0 if sign else x.number == 0) for x, sign in sides)


class System:
    """x' = f(x) with functions V, divided into cells. Variables are relative to the equilibrium, if there is one; the last
    function is about it."""

    def __init__(self, claim: Claim, *roles: str) -> None:
        self.claim, rates = claim, claim.programs["rates"]
        count, self.roles = len(rates.outputs), roles
        self.names, others = rates.inputs[:count], rates.inputs[count:]
        demand(1 <= count <= len(rates.inputs), "there is not a variable for each rate")
        self.angles = [name for name in self.names if f"sin.{name}" in others or f"cos.{name}" in others]
        turning = {f"{f}.{name}" for name in self.angles for f in ("sin", "cos")}
        self.parameters = [name for name in others if name not in turning]
        demand(not any(name.startswith(("sin.", "cos.")) for name in (*self.names, *self.parameters)), "an angle is none")
        demand(len(self.names) + len(self.parameters) <= VARIABLES, "there are too many variables")
        self.at_point = any(f"equilibrium.{name}" in claim.numbers for name in self.names)
        self.shift: State = {
            name: claim.numbers.coordinate(f"equilibrium.{name}") if self.at_point else Fraction(0) for name in self.names
        }
        demand(not any(self.shift[name] for name in self.angles), "an angle is not zero at the equilibrium")
        self.box: dict[str, tuple[Fraction, Fraction]] = {}
        for name in (*self.names, *self.parameters):
            if f"box.{name}.0" in claim.subject or name in self.parameters:
                low, high = (claim.subject[f"box.{name}.{k}"] - self.shift.get(name, 0) for k in (0, 1))
                demand(low < high, "an interval is empty")
                self.box[name] = low, high
        given = {name: known(var(name) + self.shift.get(name, 0)) for name in {*rates.inputs, *turning}}
        # The variable of a cosine is 1 - cos, so that all variables vanish at the equilibrium.
        given |= {f"cos.{x}": known(1 - var(f"cos.{x}")) for x in self.angles}
        outputs = rates.run(given, Exactly(), count)
        for role in roles:
            demand(set(claim.programs[role].inputs) <= set(given), "a function depends on more than the state")
            outputs += claim.programs[role].run(given, Exactly(), 1)
        cases = joined(outputs, CELLS)
        self.all = [Cell(signs(case.guards), case.value[:count], case.value[count:]) for case in cases]
        self.surfaces: list[Condition] = sorted({surface for cell in self.all for surface in cell.signs})

    @cached_property
    def facts(self) -> list[Poly]:
        """Return nonnegative polynomials: the sides of the box, and for an angle the remainders of Taylor's series, times x
        for the sine. (Each is the integral of the one before, and so they alternate for x > 0.)"""
        sides = [side for name, (low, high) in self.box.items() for side in (var(name) - low, high - var(name))]
        for name in self.angles:
            series, term = {"cos": poly(0), "sin": poly(0)}, poly(1)
            for n in range(TAYLOR):
                f, sign = ("cos", "sin")[n % 2], (1, 1, -1, -1)[n % 4]
                series[f], term = series[f] + term * Fraction(sign, factorial(n)), term * var(name)
                turned = 1 - var(f"cos.{name}") if f == "cos" else var(f"sin.{name}")
                left = (series[f] - turned) * sign
                sides.append(left * var(name) if f == "sin" else left)
        return sides

    def slope(self, V: Poly, rates: Sequence[Poly]) -> Poly:
        """Return V' for these rates."""
        along = dict(zip(self.names, rates, strict=True))
        for x in self.angles:
            along[f"sin.{x}"] = along[x] * (1 - var(f"cos.{x}"))
            along[f"cos.{x}"] = along[x] * var(f"sin.{x}")
        return total(V.slope(name) * rate for name, rate in along.items())

    def sum(
        self, p: Poly, cells: Sequence[int], more: Sequence[Poly] = (), strict: Sequence[Poly] = (),
        zero: Sequence[Poly] = (), face: dict[str, Fraction] | None = None,
    ) -> Sum:  # fmt: skip
        """Return that p is not negative (strict: positive where they are) where cells meet, with more that is not negative
        and what is zero, or on a face of the box."""
        sides = dict[Poly, int]()
        surfaces = {surface: Poly(dict(surface)) for k in cells for surface in self.all[k].signs}
        for surface, q in surfaces.items():
            ends = {self.all[k].signs[surface] for k in cells if surface in self.all[k].signs}
            sides[q] = ends.pop() if len(ends) == 1 else 0
        turned = [(var(f"sin.{x}"), 1 - var(f"cos.{x}")) for x in self.angles]
        known = [*more, *(q * sign for q, sign in sides.items() if sign), *self.facts]
        zero = [*zero, *(q for q, sign in sides.items() if not sign), *(s * s + c * c - 1 for s, c in turned)]
        if face:
            p, known, zero, strict = p.at(face), *([q.at(face) for q in part] for part in (known, zero, strict))
        return Sum(p, known, zero, strict)

    @cached_property
    def apart(self) -> list[tuple[int, ...]]:
        """Return the cells declared empty, and the pairs declared disjoint."""
        groups = [tuple(read_list(group)) for group in read_list(self.claim.evidence.get("apart") or [])]
        demand(all(len(group) in (1, 2) and self.are_cells(group) for group in groups), "there are no such cells")
        return groups

    def are_cells(self, places: Sequence[Any]) -> bool:
        """Tell whether these are indices of cells."""
        return all(type(k) is int and 0 <= k < len(self.all) for k in places)

    @cached_property
    def cells(self) -> list[int]:
        """Return the indices of the nonempty cells."""
        return [k for k in range(len(self.all)) if (k,) not in self.apart]

    def meet(self, i: int, j: int) -> bool:
        """Tell whether two cells may meet."""
        return (min(i, j), max(i, j)) not in self.apart

    def sound(self) -> Shown:
        """Show that each function is well defined: its values agree where cells meet."""
        for group in self.apart:
            yield f"apart {' '.join(map(str, group))}", self.sum(poly(-1), group)
        for i, j in combinations(self.cells, 2):
            for k, p in enumerate(minus(self.all[i].V, self.all[j].V) if self.meet(i, j) else ()):
                yield from self.equal(f"continuous {k} {i} {j}", p, (i, j))

    def equal(self, name: str, p: Poly, cells: Sequence[int]) -> Shown:
        """Show that p is zero where cells meet."""
        yield from ((f"{name} {sign:+d}", self.sum(p * sign, cells)) for sign in (1, -1) if p.terms)

    @property
    def origin(self) -> State:
        """Substitute the equilibrium for the state."""
        turned = [f"{f}.{x}" for x in self.angles for f in ("sin", "cos")]
        return dict.fromkeys((*self.names, *turned), Fraction(0))

    @property
    def around_point(self) -> list[Cell]:
        """Return the cells that may contain the equilibrium."""
        sides = (self.box.get(name, (-1, 1)) for name in self.names)
        demand(all(low < 0 < high for low, high in sides), "the equilibrium is not inside of the box")
        return [cell for cell in self.all if cell.holds(self.origin)]

    def state(self, place: str) -> tuple[Cell, State]:
        """Return the state with the numbers place.x, and a cell that contains it; refuse a state outside the box."""
        demand(not self.angles, "a state with an angle has no exact values")
        coordinates = {x: self.claim.numbers.coordinate(f"{place}.{x}") for x in (*self.names, *self.parameters)}
        state = {x: at - self.shift.get(x, 0) for x, at in coordinates.items()}
        demand(all(low <= state[x] <= high for x, (low, high) in self.box.items()), "a state is outside of the box")
        holding = [cell for cell in self.all if cell.holds(state)]
        demand(bool(holding), "no cell holds a state")
        return holding[0], state


def signs(guards: Guards) -> dict[Condition, int]:
    """Return the side of each surface; p and -p are one surface, on which neither p > 0 nor -p > 0."""
    sides = dict[Condition, int]()
    for p, truth in sorted(guards):
        turn = 1 if p[0][1] > 0 else -1
        surface, sign = tuple((m, c * turn) for m, c in p), turn if truth else -turn
        sides[surface] = sign if sides.get(surface, sign) == sign else 0
    return sides


def power(x: Poly, n: Any) -> Poly:
    """Return x^n."""
    demand(type(n) is int and 0 <= n <= POWER, "a power is too high, or none")
    return power(x, n - 1) * x if n else poly(1)
