"""Guesses of the evidence for the theorem on isotropic loops, in u = 1 - q0, the rate v, and t, the part of q along the
rate: sums of squares times products of level - V and of |q|^2 - t^2."""

from collections.abc import Mapping
from fractions import Fraction
from typing import Any

from starhold.certification.evidence.sums import Block, Guess, product_of
from starhold.kernel.polynomials import Poly
from starhold.kernel.rules import Sum

LEAST: dict[tuple[int, ...], tuple[int, int]] = {(): (1, 2), (0,): (0, 1)}
FALLS: dict[tuple[int, ...], tuple[int, int]] = {(): (2, 3), (1,): (2, 2), (0,): (1, 2), (0, 1): (1, 1)}
"""The highest powers of v, and of u and t together, by places of the known polynomials: for V that is least on target |q|^2
- t^2, for V that decreases level - V and |q|^2 - t^2."""


class Reduced(Guess):
    """The search with squares of v^i u^j t^k. Of all monomials of a degree the highest powers of v would have to vanish."""

    def __init__(self, o: Sum, scales: Mapping[str, float]) -> None:
        self.sizes = LEAST if len(o.known) == 1 else FALLS
        super().__init__(o, scales, 4, (), None)

    def reduce(self) -> None:
        """Take these squares without those that would have to vanish. Terms that are odd in v and t together have their own
        block, for nothing else is."""
        self.blocks = [
            Block(places, product_of(self.known, places), powers(*size, odd))
            for places, size in self.sizes.items()
            for odd in (0, 1)
        ]
        super().reduce()

    def evidence(self) -> dict[str, Any] | None:
        """Return evidence that the kernel accepts; None where none was found."""
        x = self.floats()
        return None if x is None else self.exactly(x)


def powers(fast: int, turned: int, odd: int) -> list[Poly]:
    """Return all v^i u^j t^k with i up to `fast`, j + k up to `turned`, and i + k odd or even."""
    spare = range(turned + 1)
    exponents = [(i, j, k) for i in range(fast + 1) for j in spare for k in spare if j + k <= turned and (i + k) % 2 == odd]
    return [Poly({("t",) * k + ("u",) * j + ("v",) * i: Fraction(1)}) for i, j, k in exponents]
