"""Shows what has to hold on {0 < V <= level} in a box, by branch and bound over the cells of a piecewise polynomial system.

Motions are those in the sense of Filippov, and more: where the right-hand side jumps, x' is any mean of what it is on the
sides and on the surface itself. V(x(t)) has a derivative almost always. Inside a cell it is the cell's V'. The times on a
surface across which the rates agree need nothing of their own: x' is the same from both sides, and so falls V. Of the other
surfaces each place has to be crossed (all rates there lead through it to the same side, so that only single times are spent
there), or V of one side has to fall for all of these rates, and thus for each mean of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from starhold.algebra.intervals import Intervals
from starhold.certification.invariant.enclosure import Boxes, EnclosedPolynomial, Mask, determinant, everywhere
from starhold.certification.invariant.signs import Positive, is_sum, sign_between, squares
from starhold.certification.invariant.system import Cell, Cells, Poly, System, along, plain, solve, split
from starhold.certification.matrices import number

FEW = 4_000
"""Boxes for what is tried by the way."""


@dataclass(frozen=True)
class Candidate:
    """A system, a function V and a box; M is {V <= 0} in it. `equilibrium`: the point that M is told to be, its
    coordinates, None for parameters; else None. `squares`: functions such that -V' is told to be a sum of their squares."""

    system: System
    V: Any
    box: tuple[tuple[float, float], ...]
    equilibrium: tuple[Any, ...] | None = None
    squares: tuple[Any, ...] = ()

    @cached_property
    def pieces(self) -> Cells:
        """The cells of rates and V together."""
        return split(self.system, self.V)

    def polynomial(self, function: Any) -> Poly:
        """A function that is not piecewise, as the pieces are."""
        return plain(self.system, function)

    @cached_property
    def guarded(self) -> tuple[Guarded, ...]:
        """The cells, ready to be enclosed."""
        return tuple(Guarded.of(cell, self.pieces) for cell in self.pieces.cells)

    @cached_property
    def thin(self) -> tuple[Guarded, ...]:
        """The thin cells."""
        return tuple(Guarded.of(cell, self.pieces) for cell in self.pieces.thin)


@dataclass(frozen=True)
class Guarded:
    """A cell with its surfaces and V made ready; `guards` are not negative in it. `never`: V is not positive in it."""

    cell: Cell
    guards: tuple[EnclosedPolynomial, ...]
    V: EnclosedPolynomial
    never: bool

    @classmethod
    def of(cls, cell: Cell, pieces: Cells, onto: Sequence[Poly] = ()) -> Guarded:
        """Make it of a cell, or of its part where polynomials vanish."""
        guards = pieces.guards(cell, onto)
        V = pieces.reduced(cell.V, onto)
        never = V.is_zero() or sign_between(V, guards) < 0
        return cls(cell, tuple(EnclosedPolynomial(guard) for guard in guards), EnclosedPolynomial(V), never)

    @property
    def known(self) -> list[Poly]:
        """The polynomials that are not negative in it."""
        return [guard.polynomial for guard in self.guards]

    def inside(self, boxes: Boxes) -> Mask:
        """Boxes that may meet the closed cell."""
        found = np.ones(boxes.count, dtype=bool)
        for guard in self.guards:
            found &= guard.on(boxes).high >= 0.0
        return found

    def active(self, boxes: Boxes, level: float) -> Mask:
        """Boxes that may hold points of the closed cell with 0 < V <= level."""
        if self.never:
            return np.zeros(boxes.count, dtype=bool)
        values = self.V.on(boxes)
        found = (values.high > 0.0) & (values.low <= level)
        return found & self.inside(boxes) if found.any() else found


def bounded(what: Candidate, level: float) -> bool:
    """Whether V > level all over the border of the box, parameters at all their values."""
    for k in range(what.pieces.moving):
        for end in what.box[k]:
            face = [(end, end) if j == k else side for j, side in enumerate(what.box)]

            def above(boxes: Boxes) -> Mask:
                low = np.zeros(boxes.count, dtype=bool)
                for cell in what.guarded:
                    low |= (cell.V.on(boxes).low <= level) & cell.inside(boxes)
                return ~low

            if not everywhere(face, above):
                return False
    return True


def positive(what: Candidate) -> bool:
    """Whether V > 0 in the whole box but at the equilibrium."""
    nothing = what.pieces.cells[0].V * 0
    for cell in what.guarded:
        test = Positive(cell.cell.V, nothing, what.equilibrium, cell.known)
        if not everywhere(what.box, lambda boxes, cell=cell, test=test: ~cell.inside(boxes) | test.on(boxes)):
            return False
    return True


class Weak(NamedTuple):
    """A cell in which V' <= 0 only, and where it may vanish: where all the functions of one of these sets do at once, so
    everywhere for an empty set."""

    guarded: Guarded
    zeros: tuple[tuple[Poly, ...], ...]


def falls(what: Candidate, level: float, sense: int = 1) -> list[Weak] | None:
    """Whether V' < 0 (sense -1: V' > 0) wherever 0 < V <= level, but where the answer says. None: not shown."""
    weak: list[Weak] = []
    told = [what.polynomial(h) for h in what.squares]
    for cell in what.guarded:
        q = cell.cell.slope * -sense
        left, zeros = squares(q, cell.cell.V)
        if cell.never:
            continue
        if told and is_sum(q, told):
            weak.append(Weak(cell, (tuple(told),)))
        elif q.is_zero():
            if not everywhere(what.box, lambda boxes, cell=cell: ~cell.active(boxes, level), most=FEW):
                weak.append(Weak(cell, ((),)))
        elif not zeros:
            if not _positive_on(what, cell, q, level):
                return None
        elif not _positive_on(what, cell, q, level, FEW):
            # Not strictly, or not shown to be so soon.
            weak.append(Weak(cell, tuple((h,) for h in zeros)))
            if not _positive_on(what, cell, left, level):
                return None
    return weak


def _positive_on(what: Candidate, cell: Guarded, q: Poly, level: float, most: int | None = None) -> bool:
    """Whether q > 0 where 0 < V <= level in a cell."""
    test = Positive(q, cell.cell.V, what.equilibrium, cell.known)

    def shown(boxes: Boxes) -> Mask:
        done = ~cell.active(boxes, level)
        return done if done.all() else done | test.on(boxes)

    value = EnclosedPolynomial(q)

    def against(points: Any) -> Mask:
        V, values = cell.V.at(points), value.at(points)
        # Clear of rounding, which is a small share of what the terms are on the box.
        found = (V > 1e-9) & (level > V) & (values < -1e-9)
        for guard in cell.guards:
            found &= guard.at(points) > 1e-9
        return found

    return everywhere(what.box, shown, most, against=against)


def jumps(pieces: Cells) -> list[int]:
    """Surfaces across which the rates are not shown to agree."""
    found: set[int] = set()
    several: list[set[int]] = []
    for place, one in enumerate((*pieces.cells, *pieces.thin)):
        for other in pieces.cells[place + 1 :] if place < len(pieces.cells) else pieces.cells:
            between = one.apart(other)
            if pieces.agree(one, other, list(zip(one.rates, other.rates, strict=True))):
                continue
            if len(between) == 1:
                found.add(between[0])
            else:
                several.append(set(between))
    for between in several:
        found |= set() if found & between else between
    return sorted(found)


def switches(what: Candidate, level: float, sense: int = 1) -> bool:
    """Whether surfaces at which the rates jump are crossed, or V falls (sense -1: grows) on them, where 0 < V <= level."""
    return all(_switch(what, surface, level, sense) for surface in jumps(what.pieces))


def _equilibrium_on(what: Candidate, zeros: Sequence[Poly]) -> tuple[Any, ...] | None:
    """The equilibrium, if polynomials vanish there, without the variables that they eliminate; else None."""
    if what.equilibrium is None or any(not h.compose(*_at(what.pieces, what.equilibrium)).is_zero() for h in zeros):
        return None
    instead = zip(what.equilibrium, what.pieces.instead(zeros), what.pieces.context.gens(), strict=True)
    return tuple(x if found == g else None for x, found, g in instead)


def _switch(what: Candidate, place: int, level: float, sense: int) -> bool:
    pieces = what.pieces
    surface = pieces.surfaces[place]
    solved = solve(surface)
    onto = [surface]
    equilibrium = _equilibrium_on(what, onto)
    cells = [Guarded.of(cell, pieces, onto) for cell in (*pieces.cells, *pieces.thin)]
    whole = range(len(pieces.cells))
    # The cells of one side fill it near the surface; where this may have a side only, those of all sides are looked at.
    sides = [[i for i in whole if cells[i].cell.signs[place] != -side] for side in (1, -1)]
    lying = [k for k, cell in enumerate(cells) if place in cell.cell.on]
    sides.append(list(whole))
    gradient = [EnclosedPolynomial(surface.derivative(k)) for k in range(len(pieces.names))]

    def test(q: Poly, cell: Guarded) -> Positive:
        return Positive(pieces.reduced(q, onto), cell.V.polynomial, equilibrium, cell.known)

    through = [along(surface, cell.cell.rates) for cell in cells]
    ways = [[test(q * way, cell) for q, cell in zip(through, cells, strict=True)] for way in (1, -1)]
    # For each V of a side the rates of every cell.
    falling = [[test(along(cells[i].cell.V, c.cell.rates) * -sense, cells[i]) for c in cells] for i in whole]

    def two_sided(boxes: Boxes) -> Mask:
        return np.any([_not_zero(slope.on(boxes)) for slope in gradient], axis=0)

    eliminated = None if solved is None else (EnclosedPolynomial(solved[1]), what.box[solved[0]])

    def shown(boxes: Boxes) -> Mask:
        active = [cell.active(boxes, level) for cell in cells]
        both = np.ones(boxes.count, dtype=bool)
        for side in (1, -1):
            both &= np.any([active[i] for i in whole if cells[i].cell.signs[place] == side], axis=0)
        for k in lying:
            both |= active[k]
        if eliminated is None:
            values = EnclosedPolynomial(surface).on(boxes)
            both &= (values.low <= 0.0) & (values.high >= 0.0)
        else:
            values, (low, high) = eliminated[0].on(boxes), eliminated[1]
            both &= (values.high >= low) & (values.low <= high)
        done = ~both
        for tests in ways:
            if not done.all():
                done |= _all(~a | t.on(boxes) for a, t in zip(active, tests, strict=True))
        for own in sides:
            if not done.all():
                falls = _all(~active[i] | ~active[j] | q.on(boxes) for i in own for j, q in enumerate(falling[i]))
                done |= falls if len(own) == len(whole) else falls & two_sided(boxes)
        return done

    box = [(0.0, 0.0) if solved is not None and k == solved[0] else side for k, side in enumerate(what.box)]
    return everywhere(box, shown)


def _at(pieces: Cells, equilibrium: Sequence[Any] | None) -> list[Poly]:
    assert equilibrium is not None
    gens = pieces.context.gens()
    return [g if x is None else pieces.context.constant(x) for g, x in zip(gens, equilibrium, strict=True)]


def _all(masks: Any) -> Mask:
    found: Any = True
    for mask in masks:
        found = found & mask
    return found


def leaves(what: Candidate, weak: Sequence[Weak], level: float, escape: Poly | None) -> bool:
    """Whether no motion can stay where V > 0 does not change: by a function that grows all the time there, or by the
    derivatives of what vanishes there, which cannot vanish all at once."""
    where = [(cell.guarded.cell, zeros) for cell in weak for zeros in cell.zeros]
    if escape is not None:
        for way in (1, -1):
            if all(_grows(what, cell, zeros, level, escape * way) for cell, zeros in where):
                return True
    return all(zeros and _not_for_long(what, cell, zeros, level) for cell, zeros in where)


def _grows(what: Candidate, cell: Cell, zeros: Sequence[Poly], level: float, escape: Poly) -> bool:
    """Whether a function grows where others vanish in a cell."""
    pieces = what.pieces
    there = Guarded.of(cell, pieces, zeros)
    q = pieces.reduced(along(escape, cell.rates), zeros)
    test = Positive(q, there.V.polynomial, _equilibrium_on(what, zeros), there.known)
    left = [EnclosedPolynomial(h) for h in (pieces.reduced(zero, zeros) for zero in zeros) if not h.is_zero()]

    def shown(boxes: Boxes) -> Mask:
        done = ~there.active(boxes, level)
        for h in left:
            done |= _not_zero(h.on(boxes))
        return done if done.all() else done | test.on(boxes)

    gone = [found != g for found, g in zip(pieces.instead(zeros), pieces.context.gens(), strict=True)]
    return everywhere([(0.0, 0.0) if out else side for out, side in zip(gone, what.box, strict=True)], shown)


def _not_for_long(what: Candidate, cell: Cell, zeros: Sequence[Poly], level: float) -> bool:
    """Whether functions and their derivatives along the motion have no common zero with 0 < V <= level."""
    moving = what.pieces.moving
    chain = [h for h in zeros if not h.is_zero()]
    for _ in range(moving - 1):
        chain += [along(h, cell.rates) for h in chain[-len(zeros) :]]
    guarded = Guarded.of(cell, what.pieces)
    forms = [EnclosedPolynomial(g) for g in chain]
    signed = [Positive(g * way, cell.V) for g in chain for way in (1, -1) if not g.is_zero()]
    rows: list[list[EnclosedPolynomial]] = []
    if what.equilibrium is not None and all(g.compose(*_at(what.pieces, what.equilibrium)).is_zero() for g in chain):
        # Where the Jacobian is regular all over a box that holds the equilibrium, they vanish together nowhere else in it.
        rows = _independent([[g.derivative(k) for k in range(moving)] for g in chain], what.equilibrium)

    def shown(boxes: Boxes) -> Mask:
        done = ~guarded.active(boxes, level)
        for form in forms:
            done |= _not_zero(form.on(boxes))
        for test in signed:
            if not done.all():
                done |= test.on(boxes)
        if rows and not done.all():
            around = _with(boxes, what.equilibrium)
            done |= _not_zero(determinant([[entry.on(around) for entry in row] for row in rows]))
        return done

    return everywhere(what.box, shown)


def _independent(rows: list[list[Poly]], equilibrium: Sequence[Any]) -> list[list[EnclosedPolynomial]]:
    """As many rows as there are columns, independent at the equilibrium (parameters at zero); none if there are too few."""
    point = [x if x is not None else 0 for x in equilibrium]
    found: list[list[Poly]] = []
    for row in rows:
        numbers = np.array([[number(entry(*point)) for entry in own] for own in [*found, row]])
        if np.linalg.matrix_rank(numbers) > len(found):
            found.append(row)
    return [[EnclosedPolynomial(entry) for entry in row] for row in found] if found and len(found) == len(found[0]) else []


def _with(boxes: Boxes, equilibrium: Any) -> Boxes:
    """Each box made as large as it takes to hold the equilibrium."""
    sides: list[Intervals] = []
    for side, x in zip(boxes.sides, equilibrium, strict=True):
        if x is None:
            sides.append(side)
        else:
            near = float(number(x))
            low, high = np.minimum(side.low, np.nextafter(near, -np.inf)), np.maximum(side.high, np.nextafter(near, np.inf))
            sides.append(Intervals(low, high))
    return Boxes(tuple(sides))


def _not_zero(values: Intervals) -> Mask:
    return (values.low > 0.0) | (values.high < 0.0)
