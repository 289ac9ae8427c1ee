"""Bounds of the body's rate and of the law's torque that motions keep although {V <= level} holds states beyond: both fall
before they reach them. Proof: docs/kernel-flying.md."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from fractions import Fraction
from typing import Any

from ..held import Held
from ..loops import AXES
from ..norms import Norms, norms, total_of
from ..numbers import demand, norm, reach, transpose
from ..polynomials import Poly, apply, derivatives, dot, fastest
from ..reading import Numbers
from ..regions import ANGLE, COMMANDED, SPEED, Sizes, Tube, felt, named, stretch
from ..rules import Exceeds, Part, Squares
from .attitude import within_turn
from .limits import Asking, axes_of, basis, heeds_momentum, rotors

KINETIC, PACE, ASKED, ASKED_PACE = "kinetic", "kinetic.pace", "asked", "asked.pace"
"""A bound of w.Jw, and how fast it may be approached (1/s), for each unit that is left; the share of its limits that the law
asks for at most because of state and momentum alone, and how fast that may be approached."""
CUBIC = ("q", "w", "qq", "qw", "ww", "qqw")
QUARTIC = (*CUBIC, "qqqq")
"""The letters of monomials that stand in a sum of squares."""
MOMENTUM = ("hw", "hq", "hqq", "hqw", "hww", "hhw", "hqqw", "hhww", "qqqq")
"""Those with the wheels' momentum, where the law reads it."""


def stays_slow(motion: Held, tube: Tube) -> Part[list[Poly]]:
    """In motions from states with w.Jw <= `kinetic`, and from every rate up to `start.rate`, w.Jw <= `kinetic` at all
    samples. Return what is nonnegative then; nothing without such a bound."""
    loop, numbers = motion.loop, motion.loop.claim.numbers
    if (bound := motion.kinetic) is None:
        return []
    pace = numbers[PACE]
    demand(0 < motion.h * pace <= 1 and "rate" not in numbers, "a bound of the rate is not properly approached")
    if "start.rate" in numbers:
        yield "rate at first", Exceeds(bound, stretch(loop.given) * numbers["start.rate"] ** 2)
    yield "rate falls", slowing(motion, speeding_up(motion, tube), bound, pace, numbers["level"])
    return [bound - twice_energy(motion)]


def speeding_up(motion: Held, tube: Tube) -> tuple[Poly, Fraction]:
    """Return a polynomial and a number that together are at least the mean rate of change of w.Jw."""
    (changed,), (rest,), pushed = changing(motion, tube, [twice_energy(motion)], QUARTIC)
    return changed, rest + pushed


def slowing(motion: Held, faster: tuple[Poly, Fraction], bound: Fraction, pace: Fraction, level: Fraction) -> Squares:
    """Return what shows that w.Jw approaches a bound at most at a pace on {V <= level}. faster: of `speeding_up`."""
    loop, (changed, rest) = motion.loop, faster
    left = pace * (bound - twice_energy(motion)) - changed - rest
    return Squares(left, basis(loop, left), 0, [level - loop.lyapunov], [loop.sphere])


def asking(motion: Held, tube: Tube) -> Asking | None:
    """Return what keeps the law of a claim within its limits in a tube, if something does."""
    numbers, loop, still = motion.loop.claim.numbers, motion.loop, motion.loop.still
    if (share := numbers.get(ASKED)) is None:
        return None
    pace, command = numbers[ASKED_PACE], motion.alone
    demand(0 < share < 1 and 0 < motion.h * pace <= 1, "a limit is not properly approached")
    demand(motion.plan is None and loop.added is None and "rate" not in numbers, "a limit is not approached like this")
    begun = within_turn(loop, numbers["start.angle" if "start.rate" in numbers else "angle"])
    if "start.rate" in numbers:
        still = dict[str, int]()
        begun.append(numbers["start.rate"] ** 2 - dot(loop.w, loop.w))
    return Asking(share, pace, command, *changing(motion, tube, command, kinds_of(command)), begun, still)


def commanded(motion: Held, numbers: Mapping[str, Any] | Numbers) -> Sizes:
    """Return bounds of the acceleration that the law asks for because of state and momentum, where a claim with these
    numbers shows that it keeps to a share of its limits; otherwise none."""
    share, limit, names = numbers.get(ASKED), numbers.get("limit"), [f"motors.{k}" for k in range(rotors(motion.loop))]
    torques = [[limit] * len(AXES)] if limit is not None else []
    if names and all(name in numbers for name in names):
        torques.append(reach(transpose(axes_of(motion.loop)), [numbers[name] for name in names]))
    if share is None or not torques:
        return {}
    return named(COMMANDED, reach(motion.N, [share * min(x) for x in zip(*torques, strict=True)]))


def kinds_of(command: Sequence[Poly]) -> tuple[str, ...]:
    """Return the letters of monomials of a torque's rate of change that stand in a sum of squares."""
    return (*CUBIC, *MOMENTUM) if heeds_momentum(command) else CUBIC


def twice_energy(motion: Held) -> Poly:
    """Return w.Jw."""
    return dot(motion.loop.w, apply(motion.loop.given, motion.loop.w))


def mean_rate(motion: Held, p: Poly, kinds: Collection[str]) -> tuple[Poly, Norms, Poly, Fraction]:
    """Return the mean rate of change of a function in a period without disturbances, up to a derivative: the terms with
    factors of these letters, and bounds of the rest; then that derivative while the torque is held, and its share in it."""
    key = *kinds, p.lower, *p.upper.items()
    if key not in motion.rates:
        rates, shares, last = derivatives(motion.along(p), lambda rates: motion.along(rates[-1]), motion.h)
        mean = dot(shares, rates).at(motion.commanded)
        short = mean.only(lambda m: "".join(sorted(name[0] for name in m)) in kinds)
        motion.rates[key] = short, norms(mean - short), rates[-1], last
    return motion.rates[key]


def changing(
    motion: Held, tube: Tube, parts: Sequence[Poly], kinds: Collection[str]
) -> tuple[list[Poly], list[Fraction], Fraction]:
    """Return polynomials with terms of these kinds, numbers, and a number for a vector, that together are at least the mean
    rates of change of functions of q and w from one sample to the next: by Taylor in the motion without disturbances, and by
    as far as these move the state."""
    sizes, h, rates = tube.sizes, motion.h, [mean_rate(motion, p, kinds) for p in parts]
    speeds, lengths = motion.speeds(sizes), {"w": tube.region.sizes[SPEED], "q": tube.region.sizes[ANGLE]} | motion.extents
    moved_by, calm = motion.mover(tube)
    away = norm(moved_by(tube.steady + tube.pushed + tube.late.moved + calm)) / h
    # Momentum turns with the target too, grows by torques from outside, and turns with a body that is moved.
    turned = 2 * motion.changes(sizes, 0)["h"] / h + h / 2 * away * motion.size("h")
    rest = [total_of(bounds, lengths) + share * fastest(last, sizes, speeds) for _, bounds, last, share in rates]
    moved = away * (felt([*parts], "w", sizes) + h / 4 * felt([*parts], "q", sizes))
    return [p for p, *_ in rates], rest, moved + turned * felt([*parts], "h", sizes)
