"""A system of few variables as cells: on each, its right-hand sides and V are polynomials with rational coefficients.

Where equations compare (`where`, `clip`, `min` and so on) the space splits along the surfaces on which what is compared is
equal. A cell is what certain sides of certain surfaces have in common; the cells leave nothing out. Where comparisons
single out a surface (`sign` gives 0 on one) that is a thin cell, whose V and rates count beside those of the sides.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np
from flint import Ordering, fmpq_mpoly_ctx

from starhold.algebra.polynomial import Condition, Polynomial, jointly

MOST_CELLS, MOST_TERMS = 64, 50_000
"""Cells, and terms that V' may have: beyond these a proof would not end."""
Poly: TypeAlias = Any
"""A polynomial of python-flint (`fmpq_mpoly`): exact, with division and factors."""


@dataclass(frozen=True)
class System:
    """x' = rates(x). `variables` move, `parameters` stay: whatever is shown holds for each of their values in the box.
    `angles`: those variables whose sines and cosines occur. Rates: polynomials over all of these, or piecewise ones."""

    variables: tuple[str, ...]
    rates: tuple[Any, ...]
    parameters: tuple[str, ...] = ()
    angles: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Variables, then parameters."""
        return self.variables + self.parameters

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names, then sine and cosine of each angle."""
        return self.names + tuple(turned(f, x) for x in self.angles for f in TURNED)

    @classmethod
    def of(
        cls, variables: Sequence[str], rates: Callable[..., Sequence[Any]], parameters: Sequence[str] = (),
        angles: Sequence[str] = (),
    ) -> System:  # fmt: skip
        """From an equation: a function of all variables, parameters, and sine and cosine of each angle that gives the
        derivative of every variable. It may use + - *, division by numbers, and `starhold.algebra.scalar`, whose `where`
        and `less` make pieces."""
        system = cls(tuple(variables), (), tuple(parameters), tuple(angles))
        found = tuple(system.function(rates))
        if len(found) != len(variables):
            raise ValueError(f"{len(found)} derivatives for {len(variables)} variables")
        return replace(system, rates=found)

    def function(self, equation: Callable[..., Any]) -> Any:
        """An equation over the same inputs, as polynomials."""
        return equation(*(Polynomial.variable(name) for name in self.inputs))

    def with_angles(self, points: Any) -> Any:
        """Points (n, N) of the names as points of the inputs."""
        turns = [points[self.variables.index(x)] for x in self.angles]
        return np.array([*points, *(f(turn) for turn in turns for f in (np.sin, np.cos))])

    def rates_with_angles(self, rates: Sequence[Poly], ring: Any) -> list[Poly]:
        """The derivatives of all inputs, of those of the names."""
        of, found = dict(zip(self.inputs, ring.gens(), strict=True)), list(rates)
        for x in self.angles:
            sine, cosine = (of[turned(f, x)] for f in TURNED)
            rate = rates[self.variables.index(x)]
            found += [cosine * rate, -sine * rate]
        return found


TURNED = ("sin", "cos")


def turned(f: str, name: str) -> str:
    """The input that is the sine or cosine of a variable."""
    return f"{f}.{name}"


@dataclass(frozen=True)
class Cell:
    """`signs`: which side of each surface, 0 where it does not matter. The closed cell is where surfaces times signs are
    not negative; rates of all inputs (of parameters zero) and V are polynomials on it, `slope` is V'. `on`: surfaces in
    which it lies, if it is a thin one."""

    signs: tuple[int, ...]
    rates: tuple[Poly, ...]
    V: Poly
    on: tuple[int, ...] = ()

    @property
    def slope(self) -> Poly:
        """V' along the motion in the cell."""
        return along(self.V, self.rates)

    def apart(self, other: Cell) -> list[int]:
        """The surfaces between two cells: in all of them lie the states that both have, when closed."""
        signs = enumerate(zip(self.signs, other.signs, strict=True))
        return [k for k, (a, b) in signs if a * b < 0 or k in self.on or k in other.on]


def along(function: Poly, rates: Sequence[Poly]) -> Poly:
    """The derivative of a polynomial along the motion."""
    total = function * 0
    for k, rate in enumerate(rates):
        total = total + function.derivative(k) * rate
    return total


@dataclass(frozen=True)
class Cells:
    """All cells of a system together with a function V; those that lie in surfaces are `thin`."""

    names: tuple[str, ...]
    moving: int
    surfaces: tuple[Poly, ...]
    cells: tuple[Cell, ...]
    thin: tuple[Cell, ...] = ()

    @property
    def context(self) -> Any:
        """The ring of the polynomials."""
        return self.cells[0].V.context()

    def instead(self, zeros: Sequence[Poly]) -> list[Poly]:
        """Polynomials in place of each variable where these vanish: the linear ones among them eliminate one each."""
        generators = list(self.context.gens())
        for zero in zeros:
            solved = solve(zero.compose(*generators))
            if solved is not None:
                place, instead = solved
                step = [instead if j == place else x for j, x in enumerate(self.context.gens())]
                generators = [x.compose(*step) for x in generators]
        return generators

    def reduced(self, value: Poly, zeros: Sequence[Poly]) -> Poly:
        """A polynomial with variables eliminated: equal to it where the others vanish."""
        return value.compose(*self.instead(zeros)) if zeros else value

    def agree(self, one: Cell, other: Cell, pairs: Sequence[tuple[Poly, Poly]]) -> bool:
        """Whether the polynomials of each pair are shown to be equal wherever two closed cells meet, exactly."""
        between = one.apart(other)
        onto = [self.surfaces[k] for k in between]
        zeros = [self.reduced(surface, onto) for surface in onto]
        curved = [z for z in zeros if not z.is_constant()]
        mine, yours = ([_modulo(g, curved) for g in self.guards(cell, onto)] for cell in (one, other))
        # What is not negative in one cell and not positive in the other is zero where they meet.
        zeros += [a for a in mine for b in yours if opposite(a, b)]
        if any(z.is_constant() and not z.is_zero() for z in zeros) or any(
            guard.is_constant() and not guard.is_zero() and guard.leading_coefficient() < 0 for guard in mine + yours
        ):
            # They do not meet.
            return True
        zeros = [z for z in zeros if not z.is_zero()]
        gaps = [self.reduced(a - b, onto) for a, b in pairs]
        return all(
            left.is_zero() or any(divmod(value, z)[1].is_zero() for z in zeros for value in (left, gap))
            for gap, left in zip(gaps, (_modulo(gap, curved) for gap in gaps), strict=True)
        )

    def guards(self, cell: Cell, onto: Sequence[Poly] = ()) -> list[Poly]:
        """Polynomials that are not negative in a closed cell, where those of `onto` vanish."""
        sided = list(zip(self.surfaces, cell.signs, strict=True))
        sided += [(self.surfaces[k], way) for k in cell.on for way in (1, -1)]
        return [self.reduced(surface, onto) * side for surface, side in sided if side and surface not in onto]


def _modulo(value: Poly, zeros: Sequence[Poly]) -> Poly:
    """A polynomial less multiples of others: equal to it where these vanish."""
    for zero in zeros:
        value = divmod(value, zero)[1]
    return value


def opposite(a: Poly, b: Poly) -> bool:
    """Whether one polynomial is a negative number times the other."""
    if a.is_zero() or b.is_zero():
        return False
    ratio = a.leading_coefficient() / b.leading_coefficient()
    return ratio < 0 and a == b * ratio


def solve(surface: Poly) -> tuple[int, Poly] | None:
    """A variable of a linear polynomial, and what it is where the polynomial vanishes; None for others."""
    if surface.is_zero() or surface.total_degree() != 1:
        return None
    generators = surface.context().gens()
    slopes = [surface.derivative(k) for k in range(len(generators))]
    place = max(range(len(slopes)), key=lambda k: 0 if slopes[k].is_zero() else abs(slopes[k].leading_coefficient()))
    return place, generators[place] - surface / slopes[place].leading_coefficient()


def split(system: System, V: Any) -> Cells:
    """The cells of a system and a function, polynomial or piecewise. ValueError where they are too many or too large."""
    names = system.inputs
    ring = fmpq_mpoly_ctx.get(names, Ordering.degrevlex)
    zero = Polynomial({})
    surfaces: list[Poly] = []
    found: list[tuple[dict[int, int], list[Poly]]] = []
    for truths, values in jointly([*system.rates, *(zero for _ in system.parameters), V], MOST_CELLS):
        sides = _sides(truths, surfaces, ring, names)
        if sides is not None:
            found.append((sides, [_poly(value, ring, names) for value in values]))
    cells = [
        Cell(
            tuple(sides.get(k, 0) for k in range(len(surfaces))),
            tuple(system.rates_with_angles(polys[:-1], ring)),
            polys[-1],
            tuple(k for k, side in sides.items() if side == 0),
        )
        for sides, polys in found
    ]
    degree = max(0, *(cell.V.total_degree() + rate.total_degree() for cell in cells for rate in cell.rates))
    if math.comb(len(names) + degree, degree) > MOST_TERMS:
        raise ValueError(f"V' of degree {degree} in {len(names)} variables")
    whole, thin = ([cell for cell in cells if bool(cell.on) == lies] for lies in (False, True))
    return Cells(names, len(system.variables), tuple(surfaces), tuple(whole), tuple(thin))


def _sides(
    truths: Sequence[tuple[Condition, bool]], surfaces: list[Poly], ring: Any, names: tuple[str, ...]
) -> dict[int, int] | None:
    """The side of each surface, 0 for states on it; None where nothing is; new surfaces are added."""
    sides: dict[int, int] = {}
    strictly: set[int] = set()
    for condition, truth in truths:
        polynomial = _poly(condition.positive, ring, names)
        leading = polynomial.leading_coefficient()
        polynomial, side = polynomial / leading, (1 if truth else -1) * (1 if leading > 0 else -1)
        place = next((k for k, known in enumerate(surfaces) if known == polynomial), len(surfaces))
        if place == len(surfaces):
            surfaces.append(polynomial)
        if sides.setdefault(place, side) != side:
            # Not positive and not negative: zero.
            if truth or place in strictly:
                return None
            sides[place] = 0
        if truth:
            strictly.add(place)
    return sides


def _poly(value: Polynomial, ring: Any, names: tuple[str, ...]) -> Poly:
    return ring.from_dict({tuple(m.count(name) for name in names): c for m, c in value.terms.items()})


def plain(system: System, function: Any) -> Poly:
    """A function that is not piecewise as a polynomial; ValueError for others."""
    found = jointly([function])
    if len(found) != 1:
        raise ValueError("the function has to be one polynomial")
    return _poly(found[0][1][0], fmpq_mpoly_ctx.get(system.inputs, Ordering.degrevlex), system.inputs)
