"""Floats guess how large a level may be, and states that refute. The latter are verified in exact rationals."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import islice
from typing import Any

import numpy as np
from flint import fmpq
from numpy.typing import NDArray

from starhold.algebra.polynomial import exact
from starhold.certification.invariant.system import Cell, Cells, Poly, System, along, solve, split
from starhold.certification.matrices import number


@dataclass(frozen=True)
class Candidate:
    """A system, a function V and a box; M is {V <= 0} in it. `equilibrium`: the point that M is told to be, its
    coordinates, None for parameters; else None."""

    system: System
    V: Any
    box: tuple[tuple[float, float], ...]
    equilibrium: tuple[Any, ...] | None = None

    @cached_property
    def pieces(self) -> Cells:
        """Return the cells of rates and V together."""
        return split(self.system, self.V)


class Floats:
    """A polynomial is evaluated in floats."""

    def __init__(self, polynomial: Poly) -> None:
        self._terms = [(tuple(int(power) for power in powers), number(c)) for powers, c in polynomial.to_dict().items()]

    def at(self, points: Any) -> Any:
        """Return its values at points (n, ...)."""
        total = np.zeros(np.shape(points)[1:])
        for powers, c in self._terms:
            term = c
            for x, power in zip(points, powers, strict=True):
                term = term * x**power if power else term
            total = total + term
        return total


Array = NDArray[np.float64]
POINTS = {1: 4001, 2: 301, 3: 61, 4: 23, 7: 5, 8: 3, 9: 3}
"""Points of a grid along each side, by the number of sides."""
TRIES = 40
"""States that are verified exactly before one gives up."""


class Values:
    """V and V' in floats at points (n, N); NaN where no cell is. `cell`: its number at each point."""

    def __init__(self, what: Candidate, points: Array) -> None:
        count = points.shape[1]
        self.points = points
        self.V, self.slope = np.full(count, np.nan), np.full(count, np.nan)
        self.cell = np.full(count, -1)
        points = what.system.with_angles(points)
        surfaces = [Floats(s).at(points) for s in what.pieces.surfaces]
        for place, cell in enumerate(what.pieces.cells):
            here = self.cell < 0
            for side, values in zip(cell.signs, surfaces, strict=True):
                here &= side * values >= 0.0
            self.cell[here] = place
            self.V[here] = Floats(cell.V).at(points[:, here])
            self.slope[here] = Floats(cell.slope).at(points[:, here])


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
    found = [_refined(what, start, sense, spread, points_each, (floor, tolerance)) for start in starts]
    return sorted(found, key=lambda x: float(Values(what, x[:, None]).V[0]))


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
    """Rests of single cells with V > 0, by Newton's method from a coarse grid."""
    found: list[Array] = []
    moving, ring = what.pieces.moving, what.pieces.context
    units = ([ring.constant(int(j == k)) for j in range(len(what.box))] for k in range(moving))
    ways = [what.system.rates_with_angles(unit, ring) for unit in units]
    for place, cell in enumerate(what.pieces.cells):
        rates = [Floats(rate) for rate in cell.rates[:moving]]
        slopes = [[Floats(along(rate, way)) for way in ways] for rate in cell.rates[:moving]]
        points = grid(what.box, 7 if len(what.box) < 6 else 3)
        for _ in range(12):
            turned = what.system.with_angles(points)
            f = np.array([rate.at(turned) for rate in rates])
            jacobian = np.moveaxis(np.array([[s.at(turned) for s in row] for row in slopes]), -1, 0)
            with np.errstate(all="ignore"):
                steps = np.linalg.pinv(np.nan_to_num(jacobian, posinf=0.0, neginf=0.0)) @ np.nan_to_num(f.T)[:, :, None]
            points[:moving] -= steps[:, :, 0].T
            points = np.clip(points, *np.array(what.box).T[:, :, None])
        values = Values(what, points)
        size = np.max(np.abs([rate.at(what.system.with_angles(points)) for rate in rates]), axis=0)
        for k in np.flatnonzero((size < 1e-9) & (values.cell == place) & (values.V > 1e-9)):
            if all(np.max(np.abs(points[:, k] - other)) > 1e-6 for other in found):
                found.append(points[:, k])
    return found


def ceiling(what: Candidate, equilibria: bool = True) -> float:
    """The least V that points of a grid give for a state that no set may hold: on the border of the box, where V rises, or
    (if `equilibria`) at an equilibrium. Infinite if there is none."""
    least = math.inf
    for k in range(what.pieces.moving):
        for end in what.box[k]:
            face = [(end, end) if j == k else side for j, side in enumerate(what.box)]
            count = POINTS.get(len(face) - 1, 9)
            least = min(least, float(np.nanmin(Values(what, grid(face, count)).V)))
    states = [*wrong(what, 1, 3), *(stuck(what) if equilibria else ())]
    return min([least, *(float(Values(what, x[:, None]).V[0]) for x in states)])


SIMPLE, NEAR = (2, 3, 4, 6, 9, 12, 17), (6, 9, 12, 17, 4, 3, 2)
"""Digits of states that are tried: those a reader likes best first, or those nearest to a guess."""


def rounded(point: Array, digits: Sequence[int] = SIMPLE) -> Iterator[tuple[Any, ...]]:
    """Exact states near a point, all of them floats too."""
    for count in digits:
        # What is zero up to rounding is taken for zero.
        yield tuple(exact(float(f"{round(float(x), 12):.{count}g}")) for x in point)


def in_box(what: Candidate, state: Sequence[Any]) -> bool:
    """Whether the box holds an exact state."""
    return all(exact(low) <= x <= exact(high) for x, (low, high) in zip(state, what.box, strict=True))


def cell_of(what: Candidate, state: Sequence[Any]) -> Cell | None:
    """The cell whose interior holds an exact state of the box; None for states on a surface or outside."""
    if not in_box(what, state):
        return None
    sides = [surface(*state) for surface in what.pieces.surfaces]
    return next((c for c in what.pieces.cells if all(not s or s * v > 0 for s, v in zip(c.signs, sides, strict=True))), None)


def closed_cells(what: Candidate, state: Sequence[Any]) -> list[Cell]:
    """All the cells, thin ones too, whose closures hold an exact state."""
    sides = [surface(*state) for surface in what.pieces.surfaces]
    cells = [c for c in (*what.pieces.cells, *what.pieces.thin) if all(sides[k] == 0 for k in c.on)]
    return [c for c in cells if all(s * v >= 0 for s, v in zip(c.signs, sides, strict=True))]


def at(polynomial: Poly, equilibrium: Sequence[Any]) -> Poly:
    """A polynomial at an equilibrium: one of the parameters."""
    context = polynomial.context()
    pairs = zip(context.gens(), equilibrium, strict=True)
    return polynomial.compose(*(g if x is None else context.constant(x) for g, x in pairs))


def value(what: Candidate, state: Sequence[Any]) -> Any:
    """V at an exact state, None where its cells do not agree."""
    found = [cell.V(*state) for cell in closed_cells(what, state)]
    return found[0] if found and all(v == found[0] for v in found) else None


def rising(what: Candidate, level: float, sense: int = 1, digits: Sequence[int] = SIMPLE) -> dict[str, Any] | None:
    """A state with 0 < V <= level, verified, where V rises (sense -1: does not grow) or that is an equilibrium; or None."""
    for point in islice([*wrong(what, sense), *stuck(what)], TRIES):
        for state in rounded(point, digits):
            cell = cell_of(what, state)
            if cell is None:
                continue
            V, slope = cell.V(*state), cell.slope(*state)
            still = slope == 0 and (sense < 0 or not any(rate(*state) != 0 for rate in cell.rates))
            if V > 0 and at_most(V, level) and (sense * slope > 0 or still):
                return {"state": named(what, state), "V": number(V), "V'": number(slope)}
    return None


def reaching(what: Candidate, level: float, digits: Sequence[int] = SIMPLE) -> dict[str, Any] | None:
    """A state on the border of the box with V <= level, of those found the one of the least V, verified; or None."""
    best: tuple[Any, tuple[Any, ...]] | None = None
    for k in range(what.pieces.moving):
        for end in what.box[k]:
            face = [(end, end) if j == k else side for j, side in enumerate(what.box)]
            values = Values(what, grid(face, POINTS.get(len(face) - 1, 9)))
            for state in rounded(values.points[:, int(np.nanargmin(values.V))], digits):
                on_face = tuple(exact(end) if j == k else x for j, x in enumerate(state))
                V = value(what, on_face) if in_box(what, on_face) else None
                if V is not None and at_most(V, level):
                    best = (V, on_face) if best is None or best[0] > V else best
                    break
    return None if best is None else {"state": named(what, best[1]), "V": number(best[0])}


def not_positive(what: Candidate) -> dict[str, Any] | None:
    """A state of the box that is not the equilibrium and has V <= 0, verified; None if none is found."""
    values = Values(what, grid(what.box))
    for place in np.argsort(values.V, kind="stable")[:TRIES]:
        for state in rounded(values.points[:, place]):
            V = value(what, state)
            point = what.equilibrium
            there = point is not None and all(p is None or p == x for p, x in zip(point, state, strict=True))
            if V is not None and V <= 0 and not there and closed_cells(what, state):
                return {"state": named(what, state), "V": number(V)}
    return None


def member(what: Candidate, level: float) -> tuple[Any, ...] | None:
    """An exact state with V <= level, None if none is found."""
    values = Values(what, grid(what.box))
    for place in np.argsort(values.V, kind="stable")[:TRIES]:
        for state in rounded(values.points[:, place]):
            V = value(what, state)
            if V is not None and at_most(V, level):
                return state
    return None


def jump(what: Candidate) -> dict[str, Any] | None:
    """A state of two closed cells at which their V differ, verified, on a linear surface; None if none is found."""
    every = (*what.pieces.cells, *what.pieces.thin)
    for place, one in enumerate(every):
        for other in every[place + 1 :]:
            linear = ((m, solve(m)) for m in (what.pieces.surfaces[k] for k in one.apart(other)))
            surface, solved = next((found for found in linear if found[1] is not None), (None, None))
            if solved is None or what.pieces.agree(one, other, [(one.V, other.V)]):
                continue
            free, instead = solved
            points = grid([(0.0, 0.0) if k == free else side for k, side in enumerate(what.box)], 41)
            gaps = np.abs(Floats(what.pieces.reduced(one.V - other.V, [surface])).at(points))
            for k in np.argsort(-gaps, kind="stable"):
                state = list(next(rounded(points[:, k])))
                state[free] = instead(*state)
                cells = closed_cells(what, state)
                if in_box(what, state) and one in cells and other in cells and one.V(*state) != other.V(*state):
                    sides = [number(one.V(*state)), number(other.V(*state))]
                    return {"state": named(what, state), "V from both sides": sides}
    return None


def from_equilibrium(q: Poly, equilibrium: Sequence[Any]) -> Poly:
    """The polynomial in the distance from an equilibrium."""
    generators = q.context().gens()
    return q.compose(*(g if x is None else g + x for g, x in zip(generators, equilibrium, strict=True)))


def lowest(q: Poly, moving: Sequence[int]) -> int:
    """The lowest degree in the moving variables among a polynomial's terms."""
    return min((sum(powers[k] for k in moving) for powers in q.to_dict()), default=0)


def ray(what: Candidate, wanted: Callable[[Poly, Poly], Poly | None]) -> dict[str, Any] | None:
    """A direction from the equilibrium in which a polynomial that `wanted` makes of V and V' of the cell there is positive
    however near, by its terms of the lowest degree; None if none is found."""
    equilibrium = what.equilibrium
    if equilibrium is None or any(x is None for x in equilibrium):
        return None
    moving = range(what.pieces.moving)
    random = np.random.default_rng(0)
    choices = [*np.eye(len(equilibrium)), *-np.eye(len(equilibrium)), *random.integers(-9, 10, size=(300, len(equilibrium)))]
    directions = [tuple(fmpq(int(x)) for x in choice) for choice in choices]
    for cell in what.pieces.cells:
        asked = wanted(cell.V, cell.slope)
        if asked is None or asked.is_zero():
            continue
        leading = [_lowest_part(q, equilibrium, moving) for q in (asked, *what.pieces.guards(cell))]
        for d in directions:
            if all(part(*d) > 0 for part in leading):
                return {"direction": dict(zip(what.pieces.names, map(number, d), strict=True))}
    return None


def _lowest_part(q: Poly, equilibrium: Sequence[Any], moving: Sequence[int]) -> Poly:
    about = from_equilibrium(q, equilibrium)
    degree = lowest(about, moving)
    return q.context().from_dict({p: c for p, c in about.to_dict().items() if sum(p[k] for k in moving) == degree})


def at_most(V: Any, level: float) -> bool:
    """Whether an exact value is at most a float, which may be infinite."""
    return math.isinf(level) or exact(level) >= V


def named(what: Candidate, state: Sequence[Any]) -> dict[str, float]:
    """A state by the names of its variables."""
    pairs = zip(what.pieces.names, state, strict=True)
    return {name: number(x) for name, x in pairs if x is not None}
