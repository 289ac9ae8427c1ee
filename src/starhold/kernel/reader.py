"""How far errors of what a law is told take its torque from the one at the true state. Docs/kernel.md, 10."""

from __future__ import annotations

from fractions import Fraction
from functools import cached_property

from .loops import AttitudeLoop
from .numbers import norm, root
from .polynomials import Poly
from .regions import ANGLE, Region, Sizes, as_told, felt, stretch


class Reader:
    """A loop whose law is told the attitude, the rate and others with errors: of these noise drives a part."""

    loop: AttitudeLoop
    others: Sizes
    noise: list[Fraction]
    turned: Fraction
    rated: Fraction
    led: Fraction
    hurried: Fraction
    change: list[Fraction] | None
    unlike: list[Poly]

    @cached_property
    def wrong(self) -> Sizes:
        """Return how far off what the law is told is at most, by its letters."""
        r, a = self.size("r"), self.size("a")
        turn = {"r": self.led + self.turned * r, "a": self.hurried + self.turned * a}
        # A torque that turns over at once is what the law is told.
        changed = self.change[1] * self.turned if self.change else Fraction(0)
        spun = stretch(self.loop.given) * self.rated
        return {"q": self.turned / 2, "w": self.rated + turn["r"], "h": spun, "e": changed} | turn

    def misread(self, region: Region) -> tuple[Fraction, Fraction]:
        """Return how far the torque is from what the law asks for at the true state, for errors of what it is told; and how
        far from there and what errors that noise drives add linearly on target."""
        if not self.turned + self.rated + self.led + self.hurried:
            return Fraction(0), Fraction(0)
        wrong, sizes = self.wrong, as_told(region.sizes, self.wrong)
        full = {letter: felt(self.loop.u, letter, sizes) for letter in wrong}
        all_told = sum((full[letter] * x for letter, x in wrong.items()), Fraction(0))
        # A turn t by e takes q to qt: |qt - q - e/2| <= |q - 1| |t - 1| + |t - 1 - e/2|, and 1 - q0 <= |q|^2 where q0 >= 0.
        away, (turned, rated) = sizes[ANGLE], self.noise
        near = sizes | {"v": away * away}
        linear = {"q": turned / 2, "w": rated}
        curved = {"q": root(Fraction(2)) * away * turned / 2 + turned * turned / 8, "w": Fraction(0)}
        less = [(full[k] - felt(self.unlike, k, near)) * x - full[k] * curved[k] for k, x in linear.items()]
        return all_told, all_told - max(sum(less), Fraction(0)) * (region.least > self.turned / 2)

    def size(self, letter: str) -> Fraction:
        """Return a bound of the norm of a vector from outside."""
        sizes = [x for name, x in self.others.items() if name[0] == letter]
        return norm(sizes) if letter == "e" else max(sizes, default=Fraction(0))
