"""How far errors of what a law is told take its torque from the one at the true state, and how fast changes what is around.
Docs/kernel.md, 10."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from fractions import Fraction
from functools import cached_property

from .loops import AttitudeLoop
from .numbers import Rows, norm, reach, root
from .polynomials import Poly
from .regions import AMISS, ANGLE, AT_REST, SPEED, Radii, Region, Sizes, Tube, as_told, felt, stretch

ZERO = Fraction(0)


class Reader(ABC):
    """A loop whose law is told the attitude, the rate and others with errors: of these noise drives a part."""

    loop: AttitudeLoop
    others: Sizes
    noise: list[Fraction]
    turned: Fraction
    rated: Fraction
    moving: Rows
    led: Fraction
    hurried: Fraction
    change: list[Fraction] | None
    unlike: list[Poly]
    h: Fraction
    off: Fraction
    light: Fraction

    @abstractmethod
    def pushed(self, sizes: Sizes) -> dict[str, Fraction]:
        """Return bounds in a tube of the torque from outside and of the error of the command, where a target turns too."""

    @cached_property
    def grows(self) -> bool:
        """Whether errors of what the law is told grow with the motion."""
        return any(map(any, self.moving))

    def misled(self, sizes: Sizes) -> Radii:
        """Return how far off attitude and rate are that the law is told; in a tube, where that grows with the motion."""
        more = [sizes[x] for x in AMISS] if self.grows else AT_REST
        return self.turned + more[0], self.rated + more[1]

    def misleads(self, sizes: Sizes, acceleration: Fraction) -> list[Fraction]:
        """Return how much of that comes of a motion with these rates, relative to the target, and this acceleration."""
        w, r = sizes[SPEED], self.size("r")
        return reach(self.moving, [w + r, acceleration + self.size("a") + w * r])

    def misleading(self, tube: Tube) -> list[Fraction]:
        """Return how much more attitude and rate are off at most that the law is told, after a motion in a tube."""
        fastest = norm(tube.end) / self.h + (tube.stale + tube.late.most - tube.late.mean) * self.light
        return self.misleads(tube.sizes, fastest)

    def wrong(self, sizes: Sizes) -> Sizes:
        """Return how far off what the law is told is at most, by its letters."""
        (turned, rated), r, a = self.misled(sizes), self.size("r"), self.size("a")
        turn = {"r": self.led + turned * r, "a": self.hurried + turned * a}
        # A torque that turns over at once is what the law is told.
        changed = self.change[1] * turned if self.change else Fraction(0)
        return {"q": turned / 2, "w": rated + turn["r"], "h": stretch(self.loop.given) * rated, "e": changed} | turn

    def misread(self, region: Region) -> tuple[Fraction, Fraction]:
        """Return how far the torque is from what the law asks for at the true state, for errors of what it is told; and how
        far from there and what errors that noise drives add linearly on target."""
        if not (self.turned + self.rated + self.led + self.hurried or self.grows):
            return Fraction(0), Fraction(0)
        wrong = self.wrong(region.sizes)
        sizes = as_told(region.sizes, wrong)
        full = {letter: felt(self.loop.u, letter, sizes) for letter in wrong}
        all_told = sum((full[letter] * x for letter, x in wrong.items()), Fraction(0))
        # A turn t by e takes q to qt: |qt - q - e/2| <= |q - 1| |t - 1| + |t - 1 - e/2|, and 1 - q0 <= |q|^2 where q0 >= 0.
        away, (turned, rated) = sizes[ANGLE], self.noise
        near = sizes | {"v": away * away}
        linear = {"q": turned / 2, "w": rated}
        # Other errors turn it too.
        apart = (self.misled(region.sizes)[0] - turned) * turned / 2
        curved = {"q": root(Fraction(2)) * away * turned / 2 + turned * turned / 8 + apart, "w": Fraction(0)}
        less = [(full[k] - felt(self.unlike, k, near)) * x - full[k] * curved[k] for k, x in linear.items()]
        return all_told, all_told - max(sum(less), Fraction(0)) * (region.least > self.misled(region.sizes)[0] / 2)

    def size(self, letter: str) -> Fraction:
        """Return a bound of the norm of a vector from outside."""
        sizes = [x for name, x in self.others.items() if name[0] == letter]
        return norm(sizes) if letter == "e" else max(sizes, default=Fraction(0))

    def load(self, sizes: Sizes, acceleration: Fraction) -> Fraction:
        """Return how far the torque that the body takes is from that of the given inertia."""
        w, r = sizes[SPEED], self.size("r")
        return self.off * (acceleration + self.size("a") + w * r + (w + r) ** 2)

    def changes(self, sizes: Sizes, turning: int = 1) -> dict[str, Fraction]:
        """Return by how much target, momentum and torque from outside change in the mean of a period: those from nothing on;
        the torque is at no time nearer than this to what the law is told. turning: 0 without what the body's own rate does
        to momentum."""
        e, r, a, H = (self.size(letter) for letter in "erah")
        w, outside = sizes[SPEED], self.pushed(sizes)["outside"]
        turned = (turning * w + r) * H + e + outside
        return {"r": self.h / 2 * (a + w * r), "a": 2 * a, "h": self.h / 2 * turned, "e": min(2 * e, self.gradual(sizes))}

    def gradual(self, sizes: Sizes) -> Fraction:
        """Return by how much a torque that is told changes in the mean of a period, or twice itself if it may at once."""
        if self.change is None:
            return 2 * self.size("e")
        return self.h / 2 * (self.change[0] + self.change[1] * (sizes[SPEED] + self.size("r")))

    def stale(self, sizes: Sizes, parts: list[Poly], turning: int = 1, letters: str = "raeh") -> Fraction:
        """Return by how much parts change by that, or by some of it."""
        changes = self.changes(sizes, turning)
        return sum((felt(parts, letter, sizes) * changes[letter] for letter in letters), ZERO)

    def renewed(self, sizes: Sizes, parts: list[Poly]) -> Fraction:
        """Return by how much parts change at most from one sample to the next."""
        changes = self.changes(sizes)
        whole = {"r": 2 * changes["r"], "h": 2 * changes["h"], "a": 2 * self.size("a")}
        whole["e"] = 2 * min(self.size("e"), self.gradual(sizes))
        return sum((felt(parts, letter, sizes) * x for letter, x in whole.items()), ZERO)

    def unlike_body(self, sizes: Sizes, parts: Sequence[list[Poly]]) -> tuple[Fraction, Fraction]:
        """Return `stale` of two parts, of which the second follows momentum that turns with the body as without pushes; and
        what is more for each rate that pushes add until the end of a period."""
        steady, turning = parts
        calm = self.stale(sizes, steady) + self.stale(sizes, turning, 0)
        return calm, felt(turning, "h", sizes) * self.h / 4 * self.size("h")
