"""How far measurement errors move the law's torque, and how fast external quantities change. Docs/kernel.md, 10."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from fractions import Fraction
from functools import cached_property

from .loops import AttitudeLoop
from .numbers import Rows, added, norm, reach, root
from .polynomials import Poly
from .regions import AMISS, ANGLE, AT_REST, SPEED, Radii, Region, Sizes, Tube, as_told, felt, settled, stretch

ZERO = Fraction(0)


class Reader(ABC):
    """A loop whose law measures the attitude, the rate and other inputs with errors, some of which noise drives."""

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
    widths: list[Fraction]
    parted: tuple[list[Poly], list[Poly]]

    @abstractmethod
    def pushed(self, sizes: Sizes) -> dict[str, Fraction]:
        """Return bounds, in a tube, of the external torque, and of that torque together with the command's error, for a
        turning target too."""

    @cached_property
    def grows(self) -> bool:
        """Whether measurement errors grow with the motion."""
        return any(map(any, self.moving))

    def misled(self, sizes: Sizes) -> Radii:
        """Return bounds of the errors of measured attitude and rate; in a tube, with the part that grows with the motion."""
        more = [sizes[x] for x in AMISS] if self.grows else AT_REST
        return self.turned + more[0], self.rated + more[1]

    def misleads(self, sizes: Sizes, acceleration: Fraction) -> list[Fraction]:
        """Return that part for a motion with these rates, relative to the target, and this acceleration."""
        w, r = sizes[SPEED], self.size("r")
        return reach(self.moving, [w + r, acceleration + self.size("a") + w * r])

    def misleading(self, tube: Tube) -> list[Fraction]:
        """Return bounds of that part after a motion in a tube."""
        fastest = norm(tube.end) / self.h + (tube.stale + tube.late.most - tube.late.mean) * self.light
        return self.misleads(tube.sizes, fastest)

    def wrong(self, sizes: Sizes) -> Sizes:
        """Return bounds of the errors of the law's inputs, by letter."""
        (turned, rated), r, a = self.misled(sizes), self.size("r"), self.size("a")
        turn = {"r": self.led + turned * r, "a": self.hurried + turned * a}
        # A torque that may reverse at once is, by definition, the one that the law knows.
        changed = self.change[1] * turned if self.change else Fraction(0)
        return {"q": turned / 2, "w": rated + turn["r"], "h": stretch(self.loop.given) * rated, "e": changed} | turn

    def misread(self, region: Region) -> tuple[Fraction, Fraction]:
        """Return a bound of the torque's error due to measurement errors, and the same without the linear effect, on target,
        of errors that noise drives."""
        if not (self.turned + self.rated + self.led + self.hurried or self.grows):
            return Fraction(0), Fraction(0)
        wrong = self.wrong(region.sizes)
        sizes = as_told(region.sizes, wrong)
        full = {letter: felt(self.loop.u, letter, sizes) for letter in wrong}
        all_told = added([*full.values()], [*wrong.values()])
        if not any(self.noise):
            return all_told, all_told
        # A turn t by e takes q to qt: |qt - q - e/2| <= |q - 1| |t - 1| + |t - 1 - e/2|, and 1 - q0 <= |q|^2 where q0 >= 0.
        away, (turned, rated) = sizes[ANGLE], self.noise
        near = sizes | {"v": away * away}
        linear = {"q": turned / 2, "w": rated}
        # Other errors, before it or after, take this no further than they take q.
        curved = {"q": root(Fraction(2)) * away * turned / 2 + turned * turned / 8, "w": Fraction(0)}
        less = [(full[k] - felt(self.unlike, k, near)) * x - full[k] * curved[k] for k, x in linear.items()]
        return all_told, all_told - max(sum(less), Fraction(0)) * (region.least > self.misled(region.sizes)[0] / 2)

    @cached_property
    def extents(self) -> Sizes:
        """Return bounds of the norms of external vectors, by their letters."""
        sizes = {letter: [x for name, x in self.others.items() if name[0] == letter] for letter in "erah"}
        return {letter: norm(x) if letter == "e" else max(x, default=ZERO) for letter, x in sizes.items()}

    def size(self, letter: str) -> Fraction:
        """Return a bound of the norm of an external vector."""
        return self.extents[letter]

    def load(self, sizes: Sizes, acceleration: Fraction) -> Fraction:
        """Return a bound of the torque due to the difference of the body's inertia from the given one."""
        w, r = sizes[SPEED], self.size("r")
        return self.off * (acceleration + self.size("a") + w * r + (w + r) ** 2)

    def changes(self, sizes: Sizes, turning: int = 1) -> dict[str, Fraction]:
        """Return the mean changes over a period of the target's rate (r) and acceleration (a), of momentum (h) and of the
        external torque that the law knows (e). turning: 0 without the change of momentum by the body's own rate."""
        e, r, a, H = (self.size(letter) for letter in "erah")
        w, outside = sizes[SPEED], self.pushed(sizes)["outside"]
        turned = (turning * w + r) * H + e + outside
        return {"r": self.h / 2 * (a + w * r), "a": 2 * a, "h": self.h / 2 * turned, "e": min(2 * e, self.gradual(sizes))}

    def gradual(self, sizes: Sizes) -> Fraction:
        """Return the mean change over a period of the external torque that the law knows, or twice the torque if it may
        reverse at once."""
        if self.change is None:
            return 2 * self.size("e")
        return self.h / 2 * (self.change[0] + self.change[1] * (sizes[SPEED] + self.size("r")))

    def stale(self, sizes: Sizes, parts: list[Poly], turning: int = 1, letters: str = "raeh") -> Fraction:
        """Return a bound of what these changes, or some of them, do to expressions."""
        changes = self.changes(sizes, turning)
        return added([felt(parts, letter, sizes) for letter in letters], [changes[letter] for letter in letters])

    def renewed(self, sizes: Sizes, parts: list[Poly]) -> Fraction:
        """Return a bound of the change of expressions from one sample to the next."""
        changes = self.changes(sizes)
        whole = {"r": 2 * changes["r"], "h": 2 * changes["h"], "a": 2 * self.size("a")}
        whole["e"] = 2 * min(self.size("e"), self.gradual(sizes))
        return added([felt(parts, letter, sizes) for letter in whole], [*whole.values()])

    def unlike_body(self, sizes: Sizes, parts: Sequence[list[Poly]]) -> tuple[Fraction, Fraction]:
        """Return `stale` of two lists of expressions, where momentum in the second turns with the body as without
        disturbances; and what is to be added for each unit of rate that disturbances add by the end of a period."""
        steady, turning = parts
        calm = self.stale(sizes, steady) + self.stale(sizes, turning, 0)
        return calm, felt(turning, "h", sizes) * self.h / 4 * self.size("h")

    def mover(self, tube: Tube) -> tuple[Callable[[Fraction], list[Fraction]], Fraction]:
        """Return how far a torque of some size moves the rates in a period from the undisturbed motion, in which momentum
        turns with the body; and the torque due to changes of target, momentum and the torque that the law knows."""
        calm, slower = self.unlike_body(tube.sizes, self.parted)
        columns, h = [*zip(self.widths, tube.bent, strict=True)], self.h

        def moved_by(p: Fraction) -> list[Fraction]:
            return settled(lambda d: [h * ((p + slower * norm(d)) * n + reach([row], d)[0]) for n, row in columns])

        return moved_by, calm
