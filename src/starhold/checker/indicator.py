"""Shows anew what a certificate of an invariant set has to hold: V' < 0 on {0 < V <= level} and what goes with it, by
Bernstein coefficients on charts of the box.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from flint import fmpq_mat

from starhold.checker.cells import ClosedCell, Partition, one_sign, signed_like
from starhold.checker.covering import Options, Poly, Question, answer
from starhold.checker.exact import CheckError, NotCheckedError, demand

OPEN = "neither shown nor found false with the parts of the box that were looked at"


@dataclass(frozen=True)
class Indicator:
    """V of a claim. `level`: None for instability, where all of the box counts. `escape` and `squares`: hints of the file.
    `told`: the obligations that the claim lists."""

    pieces: Partition
    theorem: str
    level: Any
    escape: Poly | None
    squares: tuple[Poly, ...]
    told: frozenset[str]

    @property
    def sense(self) -> int:
        return -1 if self.theorem == "unstable" else 1

    def ask(
        self, cells: Sequence[ClosedCell], wanted: Callable[[Callable[[Poly], list[Poly]]], Options], zeros: Any = ()
    ) -> bool | None:
        """Whether options are met wherever 0 < V <= level in all of these closed cells at once, and polynomials vanish.
        `wanted` makes the options, with a function that takes a polynomial to the goal that it is positive."""
        found: bool | None = True
        for chart in self.pieces.charts(zeros):
            V = chart.of(cells[0].V)
            guards = [chart.of(guard) for cell in cells for guard in cell.guards]
            if V.is_zero() or one_sign(V, guards) < 0:
                continue
            inside = [] if self.level is None else [chart.of(self.level - cells[0].V)]
            rooms = [*chart.rooms[: chart.strict], V, *chart.rooms[chart.strict :], *guards, *inside]
            options = wanted(lambda p, V=V, of=chart.of, guards=guards: signed_like(of(p), V, guards))
            here = answer(Question(chart.box, rooms, options, chart.strict + 1))
            if here is False:
                return False
            found = found and here
        return found

    def equilibrium(self) -> str:
        """That nothing moves at the equilibrium."""
        point = self.pieces.equilibrium or ()
        sides = zip(point, self.pieces.box, strict=True)
        demand(all(x is None or low < x < high for x, (low, high) in sides), "the equilibrium is not inside the box")
        for cell in self._at_equilibrium():
            if all(self.pieces.at_equilibrium(rate).is_zero() for rate in cell.rates):
                return "the rates of a cell vanish there"
        if len(self._at_equilibrium()) > 1:
            raise NotCheckedError("an equilibrium that is one only by a mean of rates")
        raise CheckError("the rates do not vanish there")

    def _at_equilibrium(self) -> list[ClosedCell]:
        found: list[ClosedCell] = []
        for cell in self.pieces.every:
            sides = [self.pieces.at_equilibrium(guard) for guard in cell.guards]
            if any(not side.is_constant() for side in sides):
                raise NotCheckedError("which cells hold the equilibrium depends on a parameter")
            if all(side.is_zero() or side.leading_coefficient() > 0 for side in sides):
                found.append(cell)
        return found

    def continuous(self) -> str:
        """That V is one function."""
        for one, other in self.pieces.pairs:
            if not self.pieces.same(one, other, [one.V - other.V]):
                raise NotCheckedError("V is not shown to be the same from both sides of a surface")
        return f"the same from all sides in {len(self.pieces.every)} cells"

    def set(self, evidence: Mapping[str, Any]) -> str:
        """V is zero at the equilibrium; or a state has V at most the level, for stability and instability at most 0."""
        if self.pieces.equilibrium is not None:
            there = (self.pieces.at_equilibrium(cell.V) for cell in self._at_equilibrium())
            demand(all(V.is_zero() for V in there), "V is not zero at the equilibrium")
            return "V is zero at the equilibrium"
        most = 0 if self.theorem in ("stable", "unstable") else self.level
        demand(self.pieces.value(self.pieces.state(evidence)) <= most, "V is above the level at the state")
        return "V at the state"

    def positive(self) -> str:
        """That V > 0 but at the equilibrium."""
        found: list[bool | None] = []
        for cell in self.pieces.cells:
            for chart in self.pieces.charts():
                rooms = [*chart.rooms, *map(chart.of, cell.guards)]
                found.append(answer(Question(chart.box, rooms, [[[chart.of(cell.V)]]], chart.strict)))
        return _told(found, "in pyramids about the equilibrium", "V is not positive somewhere")

    def positive_nearby(self, direction: Sequence[Any]) -> str:
        """That V > 0 however near the equilibrium, on a way out of it."""
        demand(
            any(self._leading(c, c.V, direction) > 0 for c in self.pieces.cells if self._starts(c, direction)), "V is not"
        )
        return "V on a way out of the equilibrium"

    def _starts(self, cell: ClosedCell, direction: Sequence[Any]) -> bool:
        """Whether the first of a way out of the equilibrium is inside a cell."""
        return all(self._leading(cell, guard, direction) > 0 for guard in cell.guards)

    def _leading(self, cell: ClosedCell, p: Poly, direction: Sequence[Any]) -> Any:
        """The first coefficient that is not zero of a polynomial on the way equilibrium + t direction."""
        context = cell.V.context()
        equilibrium = self.pieces.equilibrium or ()
        if any(x is None for x in equilibrium):
            raise NotCheckedError("a way out of an equilibrium with parameters")
        t = context.gens()[0]
        terms = p.compose(*(context.constant(x) + t * d for x, d in zip(equilibrium, direction, strict=True))).to_dict()
        return min(((int(powers[0]), c) for powers, c in terms.items()), key=lambda term: term[0], default=(0, 0))[1]

    def grows_near(self, direction: Sequence[Any]) -> bool:
        """Whether V' > 0 however near the equilibrium on a way out of it."""
        cells = [cell for cell in self.pieces.cells if self._starts(cell, direction)]
        return any(self._leading(cell, cell.slope(cell.V), direction) > 0 for cell in cells)

    def bounded(self) -> str:
        """That V exceeds the level all over the border of the box."""
        pieces, level = self.pieces, self.level if self.level is not None else 0
        found: list[bool | None] = []
        for k in range(pieces.moving):
            box = {name: side for j, (name, side) in enumerate(zip(pieces.names, pieces.box, strict=True)) if j != k}
            for end in pieces.box[k]:
                context = pieces.cells[0].V.context()
                face = [context.constant(end) if j == k else g for j, g in enumerate(pieces.generators)]
                for cell in pieces.cells:
                    rooms = [p.compose(*face) for p in (level - cell.V, *cell.guards)]
                    found.append(answer(Question(box, rooms)))
        return _told(found, "on every side of the box", "V does not exceed the level all over the border")

    @property
    def _weak(self) -> list[tuple[ClosedCell, tuple[Poly, ...]]]:
        """Cells in which V' is shown only not to have the wrong sign, and what vanishes with it; else a CheckError."""
        if isinstance(self._looked, CheckError):
            raise self._looked
        return self._looked

    @cached_property
    def _looked(self) -> list[tuple[ClosedCell, tuple[Poly, ...]]] | CheckError:
        """The cells of `_weak`, or the error, so that nothing is looked for twice."""
        try:
            return self._look()
        except CheckError as fault:
            return fault

    def _look(self) -> list[tuple[ClosedCell, tuple[Poly, ...]]]:
        weak: list[tuple[ClosedCell, tuple[Poly, ...]]] = []
        may = self.theorem in ("stable", "attracts", "region", "intersection")
        for cell in self.pieces.cells:
            q = cell.slope(cell.V) * -self.sense
            told = self._not_negative(cell, q) if "leaves" in self.told and self.squares and not q.is_zero() else None
            if told == [self.squares]:
                weak.append((cell, self.squares))
                continue
            if self._even(q):
                continue
            strictly = self.ask([cell], lambda goal, q=q: [[goal(q)]]) if not q.is_zero() else None
            if strictly:
                continue
            if q.is_zero() and self.ask([cell], lambda goal: []):
                continue
            zeros = [()] if q.is_zero() else self._not_negative(cell, q)
            if not may or zeros is None:
                demand(strictly is not False, "V does not change as it must at a state of the set")
                raise NotCheckedError(OPEN)
            weak += [(cell, own) for own in zeros]
        return weak

    def _even(self, q: Poly) -> bool:
        """Whether q is a sum of even powers of the distances from the equilibrium, with positive coefficients, zero only
        there."""
        equilibrium = self.pieces.equilibrium
        if equilibrium is None or any(x is None for x in equilibrium):
            return False
        terms = q.compose(*(g + x for g, x in zip(self.pieces.generators, equilibrium, strict=True))).to_dict()
        alone = {tuple(int(e) > 0 for e in powers) for powers in terms}
        single = all(tuple(j == k for j in range(len(equilibrium))) in alone for k in range(len(equilibrium)))
        return single and all(c > 0 and all(int(e) % 2 == 0 for e in powers) for powers, c in terms.items())

    def _not_negative(self, cell: ClosedCell, q: Poly) -> list[tuple[Poly, ...]] | None:
        """Polynomials that vanish where q does, if q is nowhere negative: those it is a sum of squares of, or even
        factors."""
        if self.squares and _sum_of(q, [h * h for h in self.squares]):
            return [self.squares]
        constant, factors = q.factor()
        odd = q * 0 + constant
        for factor, power in factors:
            odd = odd * factor if int(power) % 2 else odd
        zeros = [(factor,) for factor, power in factors if int(power) > 1 and not factor.is_constant()]
        even = zeros and self.ask([cell], lambda goal: [[goal(odd)]])
        return zeros if even else None

    def falls(self) -> str:
        """That V' has its sign wherever 0 < V <= level; where it may vanish, the obligation `leaves` is needed."""
        weak = self._weak
        demand(not weak or self.theorem == "stable" or "leaves" in self.told, "V' vanishes, and motions may stay there")
        return f"V' {'<' if self.sense > 0 else '>'} 0" if not weak else "V' <= 0"

    def leaves(self) -> str:
        """That no motion stays where V' vanishes."""
        if self.escape is not None:
            escape = self.escape
            for way in (1, -1):
                if all(
                    self.ask([cell], lambda goal, c=cell: [[goal(c.slope(escape) * way)]], zeros)  # noqa: B023
                    for cell, zeros in self._weak
                ):
                    return "a function grows there, or falls"
        for cell, zeros in self._weak:
            slopes = [cell.slope(h) for h in zeros]
            found = self.ask([cell], lambda goal, s=slopes: [[goal(h * way)] for h in s for way in (1, -1)], zeros)
            if not found:
                raise NotCheckedError("no function is shown to grow where V' vanishes")
        return "what vanishes with V' does not stay zero"

    @cached_property
    def jumps(self) -> list[tuple[ClosedCell, ClosedCell]]:
        """Pairs of cells whose rates are not shown to agree where they meet."""
        return [
            (one, other)
            for one, other in self.pieces.pairs
            if not self.pieces.same(one, other, [a - b for a, b in zip(one.rates, other.rates, strict=True)])
        ]

    def switching(self) -> str:
        """That each surface where the rates jump is crossed: all of them lead to the same side.

        At a place where two cells of different rates meet, each further one either has the rate of one of them or makes such
        a pair with both. So it is enough to look at pairs.
        """
        between = [one.between(other) for one, other in self.jumps]
        alone = {str(own[0]): own[0] for own in between if len(own) == 1}
        # Of several surfaces between two cells, all meet where the cells do: one is enough.
        several = {str(p): p for own in between if not any(str(p) in alone for p in own) for p in own}
        surfaces = [*alone.values(), *several.values()]
        for surface in surfaces:
            for one, other in self.jumps:
                pair = (one.slope(surface), other.slope(surface))
                crossed = self.ask(
                    [one, other],
                    lambda goal, pair=pair: [[goal(q * way) for q in pair] for way in (1, -1)],
                    [surface, *one.on, *other.on],
                )
                if not crossed:
                    raise NotCheckedError("a surface where the rates jump is not shown to be crossed")
        return f"{len(surfaces)} surfaces are crossed"

    def invariant(self) -> str:
        """That V cannot become positive: it falls where it is."""
        self.falls()
        if self.jumps:
            self.switching()
        return "V cannot rise where it is positive"


def _told(found: Iterable[bool | None], reason: str, otherwise: str) -> str:
    answers = list(found)
    demand(False not in answers, otherwise)
    if None in answers:
        raise NotCheckedError(OPEN)
    return reason


def _sum_of(q: Poly, squares: Sequence[Poly]) -> bool:
    """Whether q is a sum of these with positive factors: the factors by least squares, the identity by expansion."""
    places = sorted({powers for p in (q, *squares) for powers in p.to_dict()})
    rows = [[p.to_dict().get(powers, 0) for p in squares] for powers in places]
    matrix, right = fmpq_mat(rows), fmpq_mat([[q.to_dict().get(powers, 0)] for powers in places])
    try:
        factors = (matrix.transpose() * matrix).solve(matrix.transpose() * right)
    except ZeroDivisionError:
        return False
    shares = [factors[k, 0] for k in range(len(squares))]
    return all(c > 0 for c in shares) and q == sum((p * c for p, c in zip(squares, shares, strict=True)), q * 0)
