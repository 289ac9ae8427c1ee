"""The sign of a polynomial where V > 0, also where both vanish together: on the border of a set, or at an equilibrium."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from flint import fmpq
from numpy.typing import NDArray

from starhold.algebra.polynomial import exact
from starhold.certification.invariant.enclosure import Boxes, EnclosedPolynomial, Mask, definite
from starhold.certification.invariant.system import Poly, opposite, solve
from starhold.certification.matrices import number


class Positive:
    """Whether q > 0 wherever V > 0 is shown on boxes, in one of these ways:

    * q > 0 on the box;
    * q and V share factors: none of them vanishes where V > 0, those of q to an even power do not matter, and those that
      both have to an odd power have, together with what is left of V, a sign. So what is left of q V has to be positive;
    * q is definite about an equilibrium (`Definite`).

    Before, q is divided by what is positive where V is: factors of V that do not change sign in the cell, and sums of even
    powers that vanish at one point only, where V <= 0.

    `equilibrium`: its coordinates, None for parameters; `guards`: what is not negative in the cell."""

    def __init__(self, q: Poly, V: Poly, equilibrium: Sequence[Any] | None = None, guards: Sequence[Poly] = ()) -> None:
        q = _divided(q, V, guards)
        self._direct = EnclosedPolynomial(q)
        parts = [] if q.is_zero() or V.is_zero() else _without_common(q, V)
        self._relative = [EnclosedPolynomial(part) for part in parts]
        self._definite = None if equilibrium is None or q.is_zero() else Definite(q, equilibrium, guards)

    def on(self, boxes: Boxes) -> Mask:
        """On which boxes it is shown."""
        if self._definite is not None and self._definite.always:
            return np.ones(boxes.count, dtype=bool)
        found = self._direct.on(boxes).low > 0.0
        for form in self._relative:
            if not found.all():
                found |= form.on(boxes).low > 0.0
        if self._definite is not None and not found.all():
            found |= self._definite.on(boxes)
        return found


class Definite:
    """Whether q > 0 in a cell but at an equilibrium, z the distance from it, is shown on boxes in one of these ways:

    * q is a sum of even powers of all the z, with positive factors: then it is `always`;
    * q, or q less a multiple of what is not negative in the cell, is a form z.Q(x)z, and Q is positive definite on the box;
    * q = a g + r with a > 0 on the box, g linear, zero at the equilibrium, not negative in the cell, and r definite where
      g = 0."""

    def __init__(self, q: Poly, equilibrium: Sequence[Any], guards: Sequence[Poly]) -> None:
        about = from_equilibrium(q, equilibrium)
        moving = [k for k, x in enumerate(equilibrium) if x is not None]
        self.always = _even_powers(about, moving)
        self._matrices: list[list[list[EnclosedPolynomial]]] = []
        self._sloping: list[tuple[EnclosedPolynomial, Definite]] = []
        if self.always or not moving:
            return
        matrix = _quadratic(about, moving)
        if matrix is not None:
            back = to_equilibrium(q.context(), equilibrium)
            extra = (_quadratic(from_equilibrium(guard, equilibrium), moving) for guard in guards)
            for found in _definite_with(matrix, [m for m in extra if m is not None]):
                self._matrices.append([[EnclosedPolynomial(entry.compose(*back)) for entry in row] for row in found])
            return
        for guard in guards:
            solved = solve(guard)
            if solved is None or equilibrium[solved[0]] is None or lowest(from_equilibrium(guard, equilibrium), moving) < 1:
                continue
            generators = q.context().gens()
            on_it = q.compose(*(solved[1] if k == solved[0] else g for k, g in enumerate(generators)))
            share, _ = divmod(q - on_it, guard)
            others = [None if k == solved[0] else x for k, x in enumerate(equilibrium)]
            self._sloping.append((EnclosedPolynomial(share), Definite(on_it, others, ())))

    def on(self, boxes: Boxes) -> Mask:
        """On which boxes it is shown."""
        found = np.full(boxes.count, self.always)
        for matrix in self._matrices:
            if not found.all():
                found |= definite(matrix, boxes)
        for share, rest in self._sloping:
            if not found.all():
                found |= (share.on(boxes).low > 0.0) & rest.on(boxes)
        return found


def squares(q: Poly, V: Poly) -> tuple[Poly, list[Poly]]:
    """q as the product of a polynomial and squares of others that do not divide V: q has the sign of the former where none
    of the latter vanishes."""
    if q.is_zero():
        return q, []
    constant, factors = q.factor()
    left, even = q.context().constant(constant), list[Poly]()
    for factor, power in factors:
        if power % 2 == 0 and (V.is_zero() or not divmod(V, factor)[1].is_zero()):
            even.append(factor)
        else:
            left = left * factor**power
    return left, even


def is_sum(q: Poly, functions: Sequence[Poly]) -> bool:
    """Whether q is a sum of the squares of these functions with positive factors: floats guess these, q decides."""
    parts = [h * h for h in functions]
    powers = sorted({tuple(int(x) for x in p) for part in (q, *parts) for p in part.to_dict()})
    columns = [[number(part.to_dict().get(p, 0)) for p in powers] for part in (*parts, q)]
    guess = np.linalg.lstsq(np.array(columns[:-1]).T, np.array(columns[-1]), rcond=None)[0]
    factors = [exact(Fraction(float(x)).limit_denominator(10**6)) for x in guess]
    return all(c > 0 for c in factors) and (q - sum((p * c for p, c in zip(parts, factors, strict=True)), q * 0)).is_zero()


def from_equilibrium(q: Poly, equilibrium: Sequence[Any]) -> Poly:
    """The polynomial in the distance from an equilibrium."""
    generators = q.context().gens()
    return q.compose(*(g if x is None else g + x for g, x in zip(generators, equilibrium, strict=True)))


def to_equilibrium(context: Any, equilibrium: Sequence[Any]) -> list[Poly]:
    """The polynomials in place of the distance from an equilibrium."""
    return [g if x is None else g - x for g, x in zip(context.gens(), equilibrium, strict=True)]


def lowest(q: Poly, moving: Sequence[int]) -> int:
    """The lowest degree in the moving variables among a polynomial's terms."""
    return min((sum(powers[k] for k in moving) for powers in q.to_dict()), default=0)


def sign_between(p: Poly, guards: Sequence[Poly]) -> int:
    """1 or -1 where this is the only sign that a polynomial may have in the cell, being a product of guards; else 0."""
    constant, factors = p.factor()
    sign = 0 if constant == 0 else 1 if constant > 0 else -1
    for factor, power in factors:
        if int(power) % 2:
            sign *= next((way for g in guards for way in (1, -1) if opposite(factor * -way, g)), 0)
    return sign


def _divided(q: Poly, V: Poly, guards: Sequence[Poly]) -> Poly:
    """q without factors that are positive where V is, or negative with the sign turned."""
    if q.is_zero() or V.is_zero():
        return q
    constant, factors = q.factor()
    left = q * 0 + constant
    for factor, power in factors:
        shared = divmod(V, factor)[1].is_zero()
        sign = sign_between(factor, guards) if shared else _sign_but_where_none_is_left(factor, V)
        left = left * (sign ** int(power) if sign else factor**power)
    return left


def _sign_but_where_none_is_left(p: Poly, V: Poly) -> int:
    """The sign of a sum of even powers which vanishes where all its variables do, if V is not positive there; else 0."""
    sign = 1 if p.leading_coefficient() > 0 else -1
    used = [k for k in range(len(p.context().gens())) if not p.derivative(k).is_zero()]
    generators = p.context().gens()
    there = V.compose(*(g * 0 if k in used else g for k, g in enumerate(generators)))
    holds = there.is_zero() or (there.is_constant() and there.leading_coefficient() < 0)
    return sign if used and holds and _even_powers(p * sign, used) else 0


def _without_common(q: Poly, V: Poly) -> list[Poly]:
    """q, and q V, without those factors of V that do not change their signs where V > 0; nothing if there are none."""
    constant, factors = q.factor()
    alone, both, found = q.context().constant(constant), q.context().constant(constant), False
    left = V
    for factor, power in factors:
        shared = 0
        while True:
            quotient, remainder = divmod(left, factor)
            if not remainder.is_zero():
                break
            left, shared = quotient, shared + 1
        found |= shared > 0
        # Where V > 0 a shared factor is not zero: of its powers only the parity counts, of q alone or of q and V together.
        alone = alone * factor ** (power % 2 if shared else power)
        both = both * factor ** ((power + shared) % 2 if shared else power)
    return [alone, both * left] if found else []


def _quadratic(q: Poly, moving: Sequence[int]) -> list[list[Poly]] | None:
    """A symmetric matrix Q(z) of polynomials with z.Q(z)z = q, None where q has terms of lower degree."""
    if lowest(q, moving) < 2:
        return None
    size = len(moving)
    entries = [[dict[tuple[int, ...], Any]() for _ in range(size)] for _ in range(size)]
    for powers, c in q.to_dict().items():
        high = max(range(size), key=lambda i: powers[moving[i]])
        if powers[moving[high]] >= 2:
            pairs, share = [(high, high)], c
        else:
            i, j = [i for i in range(size) if powers[moving[i]]][:2]
            pairs, share = [(i, j), (j, i)], c / 2
        for i, j in pairs:
            rest = list(powers)
            rest[moving[i]] -= 1
            rest[moving[j]] -= 1
            entries[i][j][tuple(rest)] = entries[i][j].get(tuple(rest), fmpq(0)) + share
    context = q.context()
    return [[context.from_dict(entry) for entry in row] for row in entries]


def _definite_with(matrix: list[list[Poly]], guards: Sequence[list[list[Poly]]]) -> list[list[list[Poly]]]:
    """The matrix, and less the multiple of each guard's that leaves it the most definite at the equilibrium, if definite."""
    found = [matrix]
    own = _constants(matrix)
    for guard in guards:
        other = _constants(guard)
        size = float(np.abs(other).max())
        if size == 0.0 or np.linalg.eigvalsh(own)[0] > 0.0:
            continue
        scale = max(float(np.abs(own).max()), 1e-300) / size
        tried = [scale * 2.0 ** (k / 2) for k in range(-16, 9)]
        best = max(tried, key=lambda share: float(np.linalg.eigvalsh(own - share * other)[0]))
        if np.linalg.eigvalsh(own - best * other)[0] > 0.0:
            share = exact(float(f"{best:.4g}"))
            found.append([[a - b * share for a, b in zip(*rows, strict=True)] for rows in zip(matrix, guard, strict=True)])
    return found


def _constants(matrix: list[list[Poly]]) -> NDArray[np.float64]:
    """A matrix at the equilibrium in floats, with parameters at zero."""
    zero = [fmpq(0)] * len(matrix[0][0].context().gens())
    return np.array([[number(entry(*zero)) for entry in row] for row in matrix])


def _even_powers(q: Poly, moving: Sequence[int]) -> bool:
    """Whether q is a sum of even powers with positive factors, among them one of every moving variable alone."""
    alone: set[int] = set()
    for powers, c in q.to_dict().items():
        if c <= 0 or any(power % 2 for power in powers):
            return False
        used = [k for k, power in enumerate(powers) if power]
        if not used:
            return False
        if len(used) == 1 and used[0] in moving:
            alone.add(used[0])
    return alone == set(moving)
