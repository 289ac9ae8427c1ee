"""Guesses the largest level, and refuting states, in floats. The states are verified in exact rationals."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import combinations, islice
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from starhold.certification.invariant.prover import Attempt
from starhold.certification.invariant.system import System, check_sizes, program
from starhold.certification.matrices import unlimited
from starhold.kernel.cells import Cell as Wired
from starhold.kernel.polynomials import Poly, poly, var

Array = NDArray[np.float64]
State: TypeAlias = tuple[Fraction, ...]
"""Exact values of variables and parameters."""
Found: TypeAlias = dict[str, Any] | None
POINTS = {1: 4001, 2: 301, 3: 61, 4: 23, 7: 5, 8: 3, 9: 3}
"""The number of grid points along each side, by the number of sides."""
TRIES = 40
"""The most states that are verified exactly."""


def sides(names: Sequence[str], box: Sequence[tuple[float, float]]) -> dict[str, str]:
    """The ends of a box as the kernel reads them."""
    return {f"box.{x}.{k}": str(Fraction(end)) for x, ends in zip(names, box, strict=True) for k, end in enumerate(ends)}


@dataclass(frozen=True)
class Cell:
    """A cell as the kernel has it, and V' in it."""

    wired: Wired
    slope: Poly

    @cached_property
    def sides(self) -> list[Poly]:
        """The polynomials that are not negative in it."""
        return [Poly(dict(surface)) * sign for surface, sign in self.wired.signs.items() if sign]

    @property
    def function(self) -> Poly:
        """V in it."""
        return self.wired.V[0]


@dataclass(frozen=True)
class Candidate:
    """A system, a function V and a box; M is {V <= 0} in it. `equilibrium`: the point that M is, a number for every
    variable; else None."""

    system: System
    V: Any
    box: tuple[tuple[float, float], ...]
    equilibrium: State | None = None

    @cached_property
    def wired(self) -> Any:
        """The system and V as the kernel wires them. ValueError where they are too large."""
        check_sizes(self.system, self.V)
        programs = {role: program(of, self.system.inputs) for role, of in (("rates", self.system.rates), ("V", [self.V]))}
        return Attempt("", programs, sides(self.system.names, self.box), {}, {}).system

    @cached_property
    def cells(self) -> list[Cell]:
        """All cells."""
        return [Cell(cell, self.wired.slope(cell.V[0], cell.rates)) for cell in self.wired.all]

    @cached_property
    def whole(self) -> list[Cell]:
        """The cells that lie in no surface."""
        return [cell for cell in self.cells if all(cell.wired.signs.values())]

    @cached_property
    def values(self) -> "Fields":
        """V and V' at points."""
        return Fields(self, lambda cell: (cell.function, cell.slope))

    @cached_property
    def rates(self) -> "Fields":
        """The rates of all variables at points."""
        return Fields(self, lambda cell: cell.wired.rates)

    def at(self, p: Poly, state: State) -> Fraction:
        """The value of a polynomial at an exact state."""
        unlimited()
        return p.at(self.named(state)).number

    def named(self, state: State) -> dict[str, Fraction]:
        """An exact state by the names of its variables."""
        return dict(zip(self.system.names, state, strict=True))

    def near(self, state: State) -> list[Cell]:
        """All the cells, thin ones too, whose closures hold an exact state."""
        unlimited()
        return [cell for cell in self.cells if cell.wired.holds(self.named(state))]

    def has(self, state: State) -> bool:
        """Whether the box holds an exact state."""
        return all(low <= x <= high for x, (low, high) in zip(state, self.box, strict=True))

    def value(self, state: State) -> Fraction | None:
        """V at an exact state, None where its cells do not agree."""
        values = {self.at(cell.function, state) for cell in self.near(state)}
        return values.pop() if len(values) == 1 else None


class Floats:
    """A polynomial is evaluated in floats."""

    def __init__(self, p: Poly, names: Sequence[str]) -> None:
        place = {x: k for k, x in enumerate(names)}
        self._terms = sorted((tuple(sorted(place[x] for x in m)), float(c)) for m, c in p.terms.items())

    def at(self, points: Any) -> Any:
        """Return its values at points (n, ...) of the names."""
        total, product, last = np.zeros(np.shape(points)[1:]), [1.0], tuple[int, ...]()
        for m, c in self._terms:
            # Terms in order share the products of their first factors.
            shared = next((n for n, (j, k) in enumerate(zip(m, last, strict=False)) if j != k), min(len(m), len(last)))
            del product[shared + 1 :]
            for k in m[shared:]:
                product.append(product[-1] * points[k])
            total, last = total + c * product[-1], m
        return total


class Fields:
    """Polynomials of each cell in floats, at points (n, N) of variables and parameters; NaN where no cell is."""

    def __init__(self, what: Candidate, of: Callable[[Cell], Sequence[Poly]]) -> None:
        self._system, self._names = what.system, what.system.inputs
        self._cells = [[[Floats(p, self._names) for p in part] for part in (cell.sides, of(cell))] for cell in what.whole]

    def __call__(self, points: Any) -> tuple[Array, NDArray[np.int64]]:
        """Return their values (k, N), and the number of the cell at each point."""
        points = self._system.with_angles(points)
        cell = np.full(points.shape[1], -1)
        values = np.full((len(self._cells[0][1]), points.shape[1]), np.nan)
        for place, (sides, fields) in enumerate(self._cells):
            here = cell < 0
            for side in sides:
                here &= side.at(points) >= 0.0
            cell[here] = place
            for k, field in enumerate(fields):
                values[k, here] = field.at(points[:, here])
        return values, cell


class Values:
    """V and V' in floats at points (n, N); NaN where no cell is. `cell`: its number at each point."""

    def __init__(self, what: Candidate, points: Array) -> None:
        self.points = points
        (self.V, self.slope), self.cell = what.values(points)


def grid(box: Sequence[tuple[float, float]], count: int | None = None) -> Array:
    """Points of a grid (n, N)."""
    count = POINTS.get(len(box), 9) if count is None else count
    axes = [np.linspace(low, high, count if high > low else 1) for low, high in box]
    return np.array([side.ravel() for side in np.meshgrid(*axes, indexing="ij")])


def wrong(what: Candidate, sense: int, count: int = 8) -> list[Array]:
    """States at which V is positive and does not decrease (sense -1: grow), those of the least V first, refined by grids
    that shrink around them."""
    values = Values(what, grid(what.box))
    tolerance = 1e-12 * float(np.nanmax(np.abs(values.slope), initial=0.0))
    floor = 1e-12 * float(np.nanmax(np.abs(values.V), initial=0.0))
    place = np.flatnonzero((floor < values.V) & (sense * values.slope > tolerance))
    starts: list[Array] = []
    spread = np.array([[high - low] for low, high in what.box])
    for k in place[np.argsort(values.V[place], kind="stable")]:
        point = values.points[:, k]
        if all(np.max(np.abs(point - other) / np.maximum(spread[:, 0], 1e-300)) > 0.1 for other in starts):
            starts.append(point)
        if len(starts) == count:
            break
    points_each = max(5 if len(what.box) < 7 else 3, round(4_000 ** (1.0 / len(what.box))))
    refined = [_refined(what, start, sense, spread, points_each, (floor, tolerance)) for start in starts]
    return sorted(refined, key=lambda x: float(Values(what, x[:, None]).V[0]))


def _refined(what: Candidate, start: Array, sense: int, spread: Array, count: int, least: tuple[float, float]) -> Array:
    best, width = start, 2.0 * spread[:, 0] / POINTS.get(len(what.box), 9)
    for _ in range(14):
        box = [(max(a, x - w), min(b, x + w)) for (a, b), x, w in zip(what.box, best, width, strict=True)]
        points = np.concatenate([grid(box, count), best[:, None]], axis=1)
        values = Values(what, points)
        values.V[~((least[0] < values.V) & (sense * values.slope > least[1]))] = np.inf
        best = points[:, int(np.argmin(values.V))]
        width = width * 0.4
    return best


def stuck(what: Candidate) -> list[Array]:
    """Equilibria of single cells with V > 0, by Newton's method from a coarse grid."""
    states: list[Array] = []
    system, moving = what.system, len(what.system.variables)
    units = [[poly(int(j == k)) for j in range(moving)] for k in range(moving)]
    for place, cell in enumerate(what.whole):
        rates = [Floats(rate, system.inputs) for rate in cell.wired.rates]
        slopes = [[Floats(what.wired.slope(rate, unit), system.inputs) for unit in units] for rate in cell.wired.rates]
        points = grid(what.box, 7 if len(what.box) < 6 else 3)
        for _ in range(12):
            turned = system.with_angles(points)
            f = np.array([rate.at(turned) for rate in rates])
            jacobian = np.moveaxis(np.array([[s.at(turned) for s in row] for row in slopes]), -1, 0)
            with np.errstate(all="ignore"):
                steps = np.linalg.pinv(np.nan_to_num(jacobian, posinf=0.0, neginf=0.0)) @ np.nan_to_num(f.T)[:, :, None]
            points[:moving] -= steps[:, :, 0].T
            points = np.clip(points, *np.array(what.box).T[:, :, None])
        values = Values(what, points)
        size = np.max(np.abs([rate.at(system.with_angles(points)) for rate in rates]), axis=0)
        for k in np.flatnonzero((size < 1e-9) & (values.cell == place) & (values.V > 1e-9)):
            if all(np.max(np.abs(points[:, k] - other)) > 1e-6 for other in states):
                states.append(points[:, k])
    return states


def ceiling(what: Candidate, equilibria: bool = True) -> float:
    """Return the least V, on a grid, of states that no set may contain: on the border of the box, where V increases, or (if
    `equilibria`) at an equilibrium. Infinite if there is none."""
    least = math.inf
    for k in range(len(what.system.variables)):
        for end in what.box[k]:
            face = [(end, end) if j == k else side for j, side in enumerate(what.box)]
            count = POINTS.get(len(face) - 1, 9)
            least = min(least, float(np.nanmin(Values(what, grid(face, count)).V)))
    states = [*wrong(what, 1, 3), *(stuck(what) if equilibria else ())]
    return min([least, *(float(Values(what, x[:, None]).V[0]) for x in states)])


SIMPLE, NEAR = (2, 3, 4, 6, 9, 12, 17), (6, 9, 12, 17, 4, 3, 2)
"""Digits of states that are tried: those a reader likes best first, or those nearest to a guess."""


def rounded(point: Array, digits: Sequence[int] = SIMPLE) -> Iterator[State]:
    """Exact states near a point, all of them floats too."""
    for count in digits:
        # A number that is zero up to rounding is taken as zero.
        yield tuple(Fraction(float(f"{round(float(x), 12):.{count}g}")) for x in point)


def rising(what: Candidate, level: float, sense: int = 1, digits: Sequence[int] = SIMPLE) -> Found:
    """Return a state with 0 < V <= level, verified, where V increases (sense -1: does not grow) or that is an equilibrium;
    or None."""
    for point in islice([*wrong(what, sense), *stuck(what)], TRIES):
        for state in rounded(point, digits):
            inside = (cell for cell in what.whole if all(what.at(p, state) > 0 for p in cell.sides))
            cell = next(inside, None) if what.has(state) else None
            if cell is None:
                continue
            V, slope = what.at(cell.function, state), what.at(cell.slope, state)
            still = slope == 0 and (sense < 0 or not any(what.at(rate, state) for rate in cell.wired.rates))
            if 0 < V <= level and (sense * slope > 0 or still):
                return {"state": named(what, state), "V": float(V), "V'": float(slope)}
    return None


def reaching(what: Candidate, level: float, digits: Sequence[int] = SIMPLE) -> Found:
    """Return the state on the border of the box with the least V found, verified to have V <= level; None without one."""
    best: tuple[Fraction, State] | None = None
    for k in range(len(what.system.variables)):
        for end in what.box[k]:
            face = [(end, end) if j == k else side for j, side in enumerate(what.box)]
            values = Values(what, grid(face, POINTS.get(len(face) - 1, 9)))
            for state in rounded(values.points[:, int(np.nanargmin(values.V))], digits):
                on_face = tuple(Fraction(end) if j == k else x for j, x in enumerate(state))
                V = what.value(on_face) if what.has(on_face) else None
                if V is not None and level >= V:
                    best = (V, on_face) if best is None or best[0] > V else best
                    break
    return None if best is None else {"state": named(what, best[1]), "V": float(best[0])}


def low(what: Candidate) -> Iterator[tuple[State, Fraction]]:
    """States of the box where V is least, with V, which is exact."""
    values = Values(what, grid(what.box))
    for place in np.argsort(values.V, kind="stable")[:TRIES]:
        for state in rounded(values.points[:, place]):
            V = what.value(state)
            if V is not None:
                yield state, V


def not_positive(what: Candidate) -> Found:
    """A state of the box that is not the equilibrium and has V <= 0, verified; None if none is found."""
    point = what.equilibrium or ()
    beside = ((state, V) for state, V in low(what) if V <= 0 and state[: len(point)] != point)
    return next(({"state": named(what, state), "V": float(V)} for state, V in beside), None)


def member(what: Candidate, level: float) -> State | None:
    """An exact state with V <= level, None if none is found."""
    return next((state for state, V in low(what) if level >= V), None)


def jump(what: Candidate) -> Found:
    """A state of two closed cells at which their V differ, verified, on a linear surface; None if none is found."""
    names = what.system.names
    for one, other in combinations(what.cells, 2):
        between = (Poly(dict(surface)) for surface in what.wired.surfaces if one.wired.on(surface, other.wired))
        surface = next((p for p in between if max(map(len, p.terms)) == 1), None)
        if surface is None:
            continue
        # The variable with the largest coefficient is what the others make it on the surface.
        slopes = {x: surface.terms[x,] for x in names if (x,) in surface.terms}
        free = max(slopes, key=lambda x: abs(slopes[x]))
        k, instead = names.index(free), var(free) - surface * (1 / slopes[free])
        gap = (one.function - other.function).at({free: instead})
        points = grid([(0.0, 0.0) if j == k else side for j, side in enumerate(what.box)], 41)
        for place in np.argsort(-np.abs(Floats(gap, names).at(points)), kind="stable") if gap.terms else ():
            state = next(rounded(points[:, place]))
            state = (*state[:k], what.at(instead, state), *state[k + 1 :])
            near = what.near(state) if what.has(state) else []
            if one in near and other in near and what.at(gap, state):
                return {
                    "state": named(what, state),
                    "V from both sides": [float(what.at(c.function, state)) for c in (one, other)],
                }
    return None


def ray(what: Candidate) -> dict[str, Fraction] | None:
    """A direction from the equilibrium in which V is positive however near, by its terms of the lowest degree; None if none
    is found."""
    if what.equilibrium is None or what.system.parameters:
        return None
    count, random = len(what.equilibrium), np.random.default_rng(0)
    for choice in [*np.eye(count), *-np.eye(count), *random.integers(-9, 10, size=(300, count))]:
        along = {x: var("t") * int(d) + e for x, d, e in zip(what.system.names, choice, what.equilibrium, strict=True)}
        for cell in what.whole:
            terms = [p.at(along).terms for p in (cell.function, *cell.sides)]
            if all(coefficients and coefficients[min(coefficients, key=len)] > 0 for coefficients in terms):
                return {x: Fraction(int(d)) for x, d in zip(what.system.names, choice, strict=True)}
    return None


def named(what: Candidate, state: State) -> dict[str, float]:
    """A state by the names of its variables, in floats."""
    return {name: float(x) for name, x in what.named(state).items()}
