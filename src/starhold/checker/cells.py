"""A piecewise system with a function V, as the checker sees it: closed cells on which all is a polynomial, and the ways to
look at them: on surfaces by elimination, about an equilibrium in pyramids.

A pyramid has its top at the equilibrium x0 and its base on a side of the box: x = x0 + r (base - x0), 0 <= r <= 1. All of
them fill the box. What vanishes at x0 has a power of r as a factor there; without it its sign is the same for r > 0, and may
be shown down to r = 0.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import comb
from typing import Any

from flint import Ordering, fmpq_mpoly_ctx

from starhold.algebra.polynomial import Polynomial, jointly
from starhold.checker.covering import Poly, Question, answer
from starhold.checker.exact import ONE, ZERO, CheckError, demand, in_time

MOST, TERMS = 64, 50_000
"""Cells, and terms that V' may have."""
FEW = 2_000
"""Parts of a box that are looked at for whether two cells meet at all."""


@dataclass(frozen=True)
class ClosedCell:
    """Where surfaces times their signs are not negative, and those in `on`, of a thin cell, are zero."""

    sides: Sequence[tuple[Poly, int]]
    rates: tuple[Poly, ...]
    V: Poly
    on: Sequence[Poly] = ()

    @property
    def guards(self) -> list[Poly]:
        return [*(surface * side for surface, side in self.sides), *self.on, *(-surface for surface in self.on)]

    def slope(self, function: Poly) -> Poly:
        """Its derivative along the motion."""
        return sum((function.derivative(k) * rate for k, rate in enumerate(self.rates)), function * 0)

    def between(self, other: ClosedCell) -> list[Poly]:
        """The surfaces that part two cells: all that both have, when closed, lies in each of them."""
        return [
            *(p for p, side in self.sides if any(p == q and side * way < 0 for q, way in other.sides)),
            *self.on,
            *other.on,
        ]


@dataclass(frozen=True)
class Chart:
    """Variables to look at a part of the box in: `box` and a substitution. `rooms`: what is not negative there beside, the
    first `strict` of them positive but at the equilibrium. `power`: the place of r, by whose powers one may divide."""

    box: Mapping[str, tuple[Any, Any]]
    steps: tuple[Sequence[Poly], ...]
    rooms: tuple[Poly, ...] = ()
    strict: int = 0
    power: int | None = None

    def of(self, p: Poly) -> Poly:
        """A polynomial in these variables."""
        for step in self.steps:
            p = p.compose(*step)
        if self.power is None or p.is_zero():
            return p
        terms = {tuple(int(e) for e in powers): c for powers, c in p.to_dict().items()}
        least = min(powers[self.power] for powers in terms)
        lowered = {tuple(e - least * (k == self.power) for k, e in enumerate(powers)): c for powers, c in terms.items()}
        return p.context().from_dict(lowered)


@dataclass(frozen=True)
class Partition:
    """All cells, those with an inside and thin ones. `equilibrium`: its coordinates, None for parameters; None if M is
    {V <= 0}."""

    names: tuple[str, ...]
    moving: int
    box: tuple[tuple[Any, Any], ...]
    cells: tuple[ClosedCell, ...]
    equilibrium: tuple[Any, ...] | None
    thin: tuple[ClosedCell, ...] = ()

    @property
    def every(self) -> tuple[ClosedCell, ...]:
        return (*self.cells, *self.thin)

    @property
    def pairs(self) -> Iterator[tuple[ClosedCell, ClosedCell]]:
        """Cells with each other, and thin ones with all of them."""
        for place, one in enumerate(self.every):
            for other in self.cells[place + 1 :] if place < len(self.cells) else self.cells:
                in_time()
                yield one, other

    @property
    def generators(self) -> tuple[Poly, ...]:
        return tuple(self.cells[0].V.context().gens())

    def state(self, values: Mapping[str, Any]) -> list[Any]:
        """A state of the file, which the box has to hold."""
        demand(set(values) == set(self.names), "a state has not the names of the variables and parameters")
        found = [values[name] for name in self.names]
        demand(all(low <= x <= high for x, (low, high) in zip(found, self.box, strict=True)), "a state is outside the box")
        return found

    def around(self, state: Sequence[Any]) -> list[ClosedCell]:
        """The closed cells that hold a state."""
        return [cell for cell in self.every if all(guard(*state) >= 0 for guard in cell.guards)]

    def value(self, state: Sequence[Any]) -> Any:
        """V at a state; all cells have to agree."""
        found = [cell.V(*state) for cell in self.around(state)]
        demand(bool(found) and all(v == found[0] for v in found), "V has no one value at a state")
        return found[0]

    def at_equilibrium(self, p: Poly) -> Poly:
        """A polynomial at the equilibrium: one of the parameters."""
        context = p.context()
        pairs = zip(self.generators, self.equilibrium or (), strict=True)
        return p.compose(*(g if x is None else context.constant(x) for g, x in pairs))

    def charts(self, zeros: Sequence[Poly] = ()) -> Iterator[Chart]:
        """Charts that fill the box, or its part where polynomials vanish: linear ones eliminate a variable."""
        steps, gone, curved = self._eliminated(zeros)
        flat = Chart({}, steps)
        box = {name: side for k, (name, side) in enumerate(zip(self.names, self.box, strict=True)) if k not in gone}
        rooms = [*curved, *(-h for h in curved)]
        for k in gone:
            place, (low, high) = flat.of(self.generators[k]), self.box[k]
            rooms += [place - low, high - place]
        if self.equilibrium is None or any(not self.at_equilibrium(zero).is_zero() for zero in zeros):
            yield Chart(box, steps, tuple(rooms))
            return
        for k in range(self.moving):
            for end in () if k in gone else self.box[k]:
                pyramid, r = list(self.generators), self.generators[k]
                for j, x in enumerate(self.equilibrium):
                    if x is not None and j not in gone:
                        pyramid[j] = x + r * (end - x if j == k else self.generators[j] - x)
                found = Chart(box | {self.names[k]: (ZERO, ONE)}, (*steps, pyramid), power=k)
                inside = Chart(box, (pyramid,), power=k)
                yield Chart(found.box, found.steps, (r, *map(inside.of, rooms)), 1, k)

    def _eliminated(self, zeros: Sequence[Poly]) -> tuple[tuple[Sequence[Poly], ...], list[int], list[Poly]]:
        steps: list[Sequence[Poly]] = []
        gone: list[int] = []
        curved: list[Poly] = []
        for zero in zeros:
            left = Chart({}, tuple(steps)).of(zero)
            solved = linear(left)
            if solved is not None:
                place, instead = solved
                steps.append([instead if k == place else g for k, g in enumerate(self.generators)])
                gone.append(place)
            elif not left.is_zero():
                curved.append(left)
        return tuple(steps), gone, [Chart({}, tuple(steps)).of(h) for h in curved]

    def same(self, one: ClosedCell, other: ClosedCell, gaps: Sequence[Poly]) -> bool:
        """Whether polynomials are shown to vanish wherever two closed cells meet."""
        if all(gap.is_zero() for gap in gaps):
            return True
        for surface in one.between(other):
            if all(divides(surface, gap) for gap in gaps):
                return True
            steps = self._eliminated([surface, *one.on, *other.on])[0]
            left, mine, yours = ([_on(surface, p, steps) for p in ps] for ps in (gaps, one.guards, other.guards))
            if all(gap.is_zero() for gap in left):
                return True
            # What is not negative in one and not positive in the other vanishes where they meet.
            if any(negative_multiple(a, b) and all(divides(a, gap) for gap in left) for a in mine for b in yours):
                return True
            chart = next(iter(Partition(self.names, self.moving, self.box, self.cells, None).charts([surface])))
            if answer(Question(chart.box, [*chart.rooms, *mine, *yours], most=FEW)):
                return True
        return False


def _on(surface: Poly, p: Poly, steps: tuple[Sequence[Poly], ...]) -> Poly:
    """A polynomial where a surface vanishes: without a variable if that is linear, else up to multiples of it."""
    return Chart({}, steps).of(p) if steps else divmod(p, surface)[1]


def split(names: Sequence[str], moving: int, box: Any, equilibrium: Any, rates: Sequence[Any], V: Any) -> Partition:
    """The cells of rates and V; what holds on a surface alone (neither p > 0 nor -p > 0) is a thin one."""
    ring = fmpq_mpoly_ctx.get(tuple(names), Ordering.degrevlex)
    cells: list[ClosedCell] = []
    thin: list[ClosedCell] = []
    still = [Polynomial({}) for _ in names[moving:]]
    try:
        joined = jointly([*rates, *still, V], MOST)
    except ValueError as error:
        raise CheckError(f"the system is too large: {error}") from None
    for truths, values in joined:
        asked: dict[str, tuple[Poly, set[tuple[int, bool]]]] = {}
        for condition, truth in truths:
            surface = polynomial(ring, names, condition.positive)
            lead = surface.leading_coefficient()
            side = 1 if (lead > 0) == truth else -1
            asked.setdefault(str(surface / lead), (surface / lead, set()))[1].add((side, truth))
        both = [len({side for side, _ in ways}) == 2 for _, ways in asked.values()]
        if any(torn and any(strictly for _, strictly in ways) for torn, (_, ways) in zip(both, asked.values(), strict=True)):
            continue
        sides = [(p, next(iter(ways))[0]) for torn, (p, ways) in zip(both, asked.values(), strict=True) if not torn]
        on = [p for torn, (p, _) in zip(both, asked.values(), strict=True) if torn]
        own = [polynomial(ring, names, value) for value in values]
        (thin if on else cells).append(ClosedCell(sides, tuple(own[:-1]), own[-1], on))
    demand(bool(cells), "a system has no cells")
    degree = max(0, *(cell.V.total_degree() + rate.total_degree() for cell in (*cells, *thin) for rate in cell.rates))
    demand(comb(len(names) + degree, degree) <= TERMS, "the system is too large: V' has too many terms")
    return Partition(tuple(names), moving, tuple(box), tuple(cells), equilibrium, tuple(thin))


def polynomial(ring: Any, names: Sequence[str], p: Any) -> Poly:
    """A polynomial in a ring; a CheckError for a piecewise one."""
    if not isinstance(p, Polynomial):
        raise CheckError("a function has pieces")
    return ring.from_dict({tuple(m.count(name) for name in names): c for m, c in p.terms.items()})


def linear(p: Poly) -> tuple[int, Poly] | None:
    """A variable of a linear polynomial and what it is where that vanishes."""
    if p.is_zero() or p.total_degree() != 1:
        return None
    for place, generator in enumerate(p.context().gens()):
        slope = p.derivative(place)
        if not slope.is_zero():
            return place, generator - p / slope.leading_coefficient()
    return None


def divides(divisor: Poly, p: Poly) -> bool:
    """Whether a polynomial is a multiple of another."""
    return p.is_zero() or (not divisor.is_zero() and divmod(p, divisor)[1].is_zero())


def negative_multiple(a: Poly, b: Poly) -> bool:
    """Whether a = c b with a number c < 0."""
    if a.is_zero() or b.is_zero():
        return False
    c = a.leading_coefficient() / b.leading_coefficient()
    return bool(c < 0) and a == b * c


def one_sign(p: Poly, guards: Sequence[Poly]) -> int:
    """1 if a polynomial is a product of guards and squares, nowhere negative in the cell, -1 if its negative is; else 0."""
    constant, factors = p.factor()
    found = (constant > 0) - (constant < 0)
    for factor, power in factors:
        if int(power) % 2 == 1:
            found *= any(negative_multiple(-factor, g) for g in guards) - any(negative_multiple(factor, g) for g in guards)
    return found


def vanishes_at_once(p: Poly, V: Poly) -> bool:
    """Whether p >= 0 is zero only where all its variables are, by its even powers, and V is not positive there."""
    names, terms = p.context().names(), [(tuple(map(int, powers)), c) for powers, c in p.to_dict().items()]
    inside = [k for k in range(len(names)) if any(powers[k] for powers, _ in terms)]
    alone = {k for powers, _ in terms for k in inside if sum(powers) == powers[k] > 0}
    even = all(c > 0 and any(powers) and all(power % 2 == 0 for power in powers) for powers, c in terms)
    if not inside or not even or alone != set(inside):
        return False
    left = V.compose(*(g * 0 if k in inside else g for k, g in enumerate(p.context().gens())))
    return left.is_zero() or (left.is_constant() and bool(left.leading_coefficient() < 0))


def signed_like(q: Poly, V: Poly, guards: Sequence[Poly] = ()) -> list[Poly]:
    """Polynomials each of which, where it and V are positive in a cell, shows that q is: q less factors of one sign there,
    and what is left of q V without the square of their common factor."""
    if q.is_zero() or V.is_zero():
        return [q]
    constant, factors = q.factor()
    q = q * 0 + constant
    for factor, power in factors:
        shared = divides(factor, V)
        sign = one_sign(factor, guards) if shared else next((s for s in (1, -1) if vanishes_at_once(factor * s, V)), 0)
        q = q * (sign or factor if int(power) % 2 else 1 if shared or sign else factor**power)
    common = q.gcd(V)
    if common.is_constant():
        return [q]
    return [q, divmod(q, common)[0] * divmod(V, common)[0]]
