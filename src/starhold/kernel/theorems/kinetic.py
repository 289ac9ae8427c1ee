"""A bound of the body's rate that holds although it does not on all of {V <= level}: the kinetic energy of the motion relative
to the target falls before it reaches a bound. Proof: docs/kernel-flying.md."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from fractions import Fraction
from math import factorial, prod

from ..held import Held
from ..loops import AXES
from ..numbers import Rows, demand, norm, root
from ..polynomials import Monomial, Poly, apply, dot, fastest
from ..regions import ANGLE, SPEED, Tube, felt, stretch
from ..rules import Exceeds, Part, Squares
from .attitude import within_turn
from .limits import Asking, basis

PACE, ASKED, ASKED_PACE = "kinetic.pace", "asked", "asked.pace"
"""How fast w.Jw may approach its bound (1/s), for each unit that is left; the share of its limits that the law asks for at most
because of the state alone, and how fast it may approach that."""
CUBIC, ORDER = ("q", "w", "qq", "qw", "ww", "qqw"), 3
QUARTIC = (*CUBIC, "qqqq")
"""The letters of monomials that stand in a sum of squares, and the order of the derivative that is bounded."""


def stays_slow(motion: Held, tube: Tube) -> Part[list[Poly]]:
    """In motions from states with w.Jw <= `kinetic`, and from every rate up to `start.rate`, w.Jw <= `kinetic` at all
    samples. Return what is nonnegative then; nothing without such a bound."""
    loop, numbers = motion.loop, motion.loop.claim.numbers
    if (bound := motion.kinetic) is None:
        return []
    pace, G = numbers[PACE], twice_energy(motion)
    demand(0 < motion.h * pace <= 1 and "rate" not in numbers, "a bound of the rate is not properly approached")
    if "start.rate" in numbers:
        yield "rate at first", Exceeds(bound, stretch(loop.given) * numbers["start.rate"] ** 2)
    (changed,), (rest,), pushed = changing(motion, tube, [G], QUARTIC)
    left = pace * (bound - G) - changed - rest - pushed
    yield "rate falls", Squares(left, basis(loop, left), 0, [numbers["level"] - loop.lyapunov], [loop.sphere])
    return [bound - G]


def asking(motion: Held, tube: Tube) -> Asking | None:
    """Return what keeps the law of a claim within its limits in a tube, if something does."""
    numbers, loop, still = motion.loop.claim.numbers, motion.loop, motion.loop.still
    if (share := numbers.get(ASKED)) is None:
        return None
    pace = numbers[ASKED_PACE]
    demand(0 < share < 1 and 0 < motion.h * pace <= 1, "a limit is not properly approached")
    demand(motion.plan is None and "rate" not in numbers, "a limit is not approached like this")
    begun = within_turn(loop, numbers["start.angle" if "start.rate" in numbers else "angle"])
    if "start.rate" in numbers:
        still = dict[str, int]()
        begun.append(numbers["start.rate"] ** 2 - dot(loop.w, loop.w))
    return Asking(share, pace, motion.u, *changing(motion, tube, motion.u, CUBIC), begun, still)


def twice_energy(motion: Held) -> Poly:
    """Return w.Jw."""
    return dot(motion.loop.w, apply(motion.loop.given, motion.loop.w))


def mean_rate(motion: Held, p: Poly) -> tuple[Poly, Poly]:
    """Return the mean rate of change of p(q, w) in a period without disturbances, up to a derivative, and that derivative
    while the torque is held."""
    rates = [motion.along(p)]
    while len(rates) < ORDER:
        rates.append(motion.along(rates[-1]))
    shares = [motion.h**k / factorial(k + 1) for k in range(ORDER)]
    return dot(shares, rates).at(motion.commanded), rates[-1]


def short(p: Poly, kinds: Collection[str]) -> Poly:
    """Return the terms of which the letters of the factors are of some kinds."""
    return p.only(lambda m: "".join(sorted(name[0] for name in m)) in kinds)


def changing(
    motion: Held, tube: Tube, parts: Sequence[Poly], kinds: Collection[str]
) -> tuple[list[Poly], list[Fraction], Fraction]:
    """Return polynomials with terms of these kinds, numbers, and a number for a vector, that together are at least the mean
    rates of change of functions of q and w from one sample to the next: by Taylor in the motion without disturbances, and by
    as far as these move the state."""
    sizes, h, speeds = tube.sizes, motion.h, motion.speeds(tube.sizes)
    lengths = {"w": tube.region.sizes[SPEED], "q": tube.region.sizes[ANGLE]} | motion.extents
    moved_by, calm = motion.mover(tube)
    away = norm(moved_by(tube.steady + tube.pushed + tube.late.moved + calm)) / h
    kept, rest = list[Poly](), list[Fraction]()
    for rate, last in (mean_rate(motion, p) for p in parts):
        kept.append(short(rate, kinds))
        left = h**ORDER / factorial(ORDER + 1) * fastest(last, sizes, speeds)
        rest.append(by_norms(rate - kept[-1], lengths) + left)
    return kept, rest, away * (felt([*parts], "w", sizes) + h / 4 * felt([*parts], "q", sizes))


def by_norms(p: Poly, sizes: Mapping[str, Fraction]) -> Fraction:
    """Return a bound of |p| for vectors, each with its letter, of these lengths, and |q0| <= 1: of the terms with factors of
    the same letters, as a matrix that takes one vector to products of the others."""
    groups: dict[tuple[str, ...], dict[Monomial, Fraction]] = {}
    for m, c in p.terms.items():
        groups.setdefault(tuple(name if name == "q0" else name[0] for name in m), {})[m] = c
    bound = Fraction(0)
    for letters, terms in groups.items():
        vectors = [letter for letter in letters if letter != "q0"]
        size = prod((sizes[letter] for letter in vectors), start=Fraction(1))
        bound += size * min(stretch(unfolded(terms, letter, vectors.count(letter))) for letter in {*vectors})
    return bound


def unfolded(terms: Mapping[Monomial, Fraction], letter: str, count: int) -> Rows:
    """Return bounds of the entries of the matrix M of terms x.My, where x is one of `count` vectors with the letter, and y has
    the products of all others: the square of the product of their lengths is the sum of squares of products, each as often
    as it occurs."""
    rest = sorted({without(m, name) for m in terms for name in m if name[0] == letter and name != "q0"})
    place, rows = {m: k for k, m in enumerate(rest)}, [[Fraction(0)] * len(rest) for _ in AXES]
    for m, c in terms.items():
        for name in {name for name in m if name[0] == letter and name != "q0"}:
            left = without(m, name)
            rows[int(name[1]) - 1][place[left]] += abs(c) * m.count(name) / count * root(Fraction(1, often(left)))
    return rows


def without(m: Monomial, name: str) -> Monomial:
    """Return a monomial without one of its factors."""
    place = m.index(name)
    return m[:place] + m[place + 1 :]


def often(m: Monomial) -> int:
    """Return in how many orders the factors of each letter can stand."""
    names = [name for name in m if name != "q0"]
    letters = Counter(name[0] for name in names)
    return prod(map(factorial, letters.values())) // prod(map(factorial, Counter(names).values()))
