"""The part of V that depends on the attitude alone: s (1 - q0), or q.Nq of a law that treats both quaternions alike."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from flint import arb, fmpq
from numpy.typing import NDArray

from starhold.algebra.polynomial import Polynomial, exact
from starhold.certification.matrices import Rows, definite, floats, greatest, identity, least, matrix_of, number
from starhold.certification.motion import AXES, RATE
from starhold.certification.subject import below

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Spring:
    """s (1 - q0), least at one quaternion of the target and greatest at the other."""

    s: Any
    even: ClassVar[bool] = False
    linear: ClassVar[tuple[tuple[str, ...], ...]] = tuple((name,) for name in AXES)
    """The monomials that make up a law's torque at rest."""

    @property
    def positive(self) -> bool:
        """Whether it is positive off the target."""
        return bool(self.s > 0)

    @property
    def top(self) -> Any:
        """Its largest value."""
        return 2 * self.s

    @property
    def barrier(self) -> Any:
        """A rational not above its value at any equilibrium but the target's."""
        return 2 * self.s

    def turn(self, level: Any) -> float:
        """The largest turn from rest (rad, from below) at which it is at most `level`."""
        return 2.0 * math.pi if level >= self.top else _floor(turn_of(level / self.s))

    def at(self, q: Sequence[Any]) -> Any:
        """Its value at a quaternion."""
        return self.s * (1 - q[0])

    def of(self, q: Array) -> Array:
        """In floats its values at the quaternions in the columns of an array."""
        # Half of |q - q_target|2, without cancellation near the target.
        return 0.5 * float(number(self.s)) * ((1.0 - q[0]) ** 2 + np.sum(q[1:] ** 2, axis=0))

    def sizes(self, first: Any, last: Any) -> tuple[arb, arb]:
        """Bounds of the length of the `linear` monomials and of |q| where it is between two rationals."""
        # |q|2 = x (2 - x) with x = t/s rises up to x = 1 and falls after.
        turned = _parabola(arb(first) / self.s, arb(last) / self.s, 2)
        return turned, turned

    def grid(self, t: Array) -> tuple[Array, Array]:
        """The lengths that `sizes` bounds, in floats, where it has the values t."""
        x = t / number(self.s)
        turned = np.sqrt(np.maximum(x * (2.0 - x), 0.0))
        return turned, turned

    def cosine(self, t: Any, axes: Array) -> Any:
        """q0 of the turns about axes (n, 3) that have the values t."""
        return 1.0 - t / number(self.s)

    def length(self, t: Any, axes: Array) -> Any:
        """|q| of the same turns."""
        return self.grid(t)[1]

    def tops(self, axes: Array) -> Array:
        """Its largest value for turns about each of some axes (n, 3)."""
        return np.full(len(axes), number(self.top))


@dataclass(frozen=True)
class Cosines:
    """q.Nq, the weighted sum of 1 - a_ii over the direction cosines: equal at q and -q, with equilibria at half turns."""

    N: Rows
    even: ClassVar[bool] = True
    linear: ClassVar[tuple[tuple[str, ...], ...]] = tuple(("q0", name) for name in AXES)

    @cached_property
    def s(self) -> Any | None:
        """Its value at every half turn; None where they differ."""
        return self.N[0][0] if identity(3, self.N[0][0]) == self.N else None

    @property
    def positive(self) -> bool:
        """Whether it is positive off the target."""
        return definite(self.N)

    @cached_property
    def top(self) -> Any:
        """A rational not below its largest value."""
        return greatest(self.N) if self.s is None else self.s

    @cached_property
    def barrier(self) -> Any:
        """A rational not above its value at any equilibrium but the target's."""
        return least(self.N) if self.s is None else self.s

    def turn(self, level: Any) -> float:
        """The largest turn from rest (rad, from below) at which it is at most `level`."""
        return math.pi if level >= self.top else min(_floor(2 * (arb(level) / self.top).sqrt().asin()), math.pi)

    def at(self, q: Sequence[Any]) -> Any:
        """Its value at a quaternion."""
        return sum((q[i + 1] * self.N[i][j] * q[j + 1] for i in range(3) for j in range(3)), fmpq(0))

    def of(self, q: Array) -> Array:
        """In floats its values at the quaternions in the columns of an array."""
        return np.einsum("ik,ij,jk->k", q[1:], floats(self.N), q[1:])

    def sizes(self, first: Any, last: Any) -> tuple[arb, arb]:
        """Bounds of the length of the `linear` monomials and of |q| where it is between two rationals; of equal weights."""
        s: Any = self.s
        start, end = arb(first) / s, arb(last) / s
        return _parabola(start, end, 1), end.sqrt()

    def grid(self, t: Array) -> tuple[Array, Array]:
        """The lengths that `sizes` bounds, in floats, where it has the values t."""
        x = t / number(self.s)
        return np.sqrt(np.maximum(x * (1.0 - x), 0.0)), np.sqrt(x)

    def cosine(self, t: Any, axes: Array) -> Any:
        """q0 of the turns about axes (n, 3) that have the values t."""
        return np.sqrt(np.maximum(1.0 - t / self.tops(axes), 0.0))

    def length(self, t: Any, axes: Array) -> Any:
        """|q| of the same turns."""
        return np.sqrt(t / self.tops(axes))

    def tops(self, axes: Array) -> Array:
        """Its largest value for turns about each of some axes (n, 3)."""
        return np.einsum("ni,ij,nj->n", axes, floats(self.N), axes)


Potential = Spring | Cosines


def potential_of(function: Polynomial) -> Potential | None:
    """The attitude's part of a V; None where it has neither form."""
    rest = function.only(lambda m: not (len(m) == 2 and set(m) <= set(RATE)))
    if any(m != () and m != ("q0",) for m in rest.terms):
        pairs = all(len(m) == 2 and set(m) <= set(AXES) for m in rest.terms)
        return Cosines(matrix_of(rest, AXES, AXES)) if pairs else None
    s = rest.terms.get((), fmpq(0))
    return Spring(s) if s + rest.terms.get(("q0",), fmpq(0)) == 0 else None


def turn_of(share: Any) -> arb:
    """The angle whose s (1 - q0) is this share of s, 1 - cos(angle/2); without cancellation for small ones."""
    return 4 * (arb(share) / 2).sqrt().asin()


def _floor(ball: arb) -> float:
    return below(exact(float(ball.lower().mid())))


def _parabola(start: arb, end: arb, width: int) -> arb:
    """The root of the largest x (width - x) for start <= x <= end."""
    half = arb(width) / 2
    widest = end if end <= half else start if start >= half else half
    return (widest * (width - widest)).nonnegative_part().sqrt()
