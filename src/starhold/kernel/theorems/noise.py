"""Bounds that errors driven by Gaussian noise rarely exceed. Proof: docs/kernel.md, section 10."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from itertools import pairwise
from math import ceil

from ..held import Held
from ..loops import AXES, AttitudeLoop, slopes
from ..near import Near, spinning
from ..numbers import Account, Rows, beside, demand, matrix, plus, rational, read_list, scalar, shortened, times, up
from ..polynomials import var
from ..programs import Exactly, known, single
from ..reading import Claim
from ..regions import RATE, TURN
from ..rules import Definite, Exceeds, Part
from ..sentences import Statement, below

SHARE, BESIDE, VECTORS = "share", "noise.beside", "noise.beside.vectors"
"""The probability of exceeding the bounds; the bound of other noise, in deviations; and how many vectors of it a sample
has."""
DEVIATION = "noise.torque.deviation"
"""The deviation of a random torque about each axis (N m), new at each sample and held until the next."""
CARRIED, CORRECTED = "errors carried", "errors corrected"
"""The programs of a sample without a new measurement, and with one: from `errors` and standard normal `noise` to the errors
at the next sample, and to those of the attitude and the rate that the law measures."""
TOLD = ("attitude", "rate")
Spin = tuple[Rows, Rows]
ROOT = Fraction(17321, 10000)
"""At least the root of 3."""
MOST, TERMS = 64, 80
"""The most samples from one measurement to the next; the terms of the exponential series."""
PLACES, FINE, SLIGHT = 100, 160, 40
"""The binary places of matrices and of covariances, and of the share by which rounding widens these."""


def within_radii(claim: Claim, motion: Held) -> Part[Statement]:
    """At all of `samples` samples on end, every `every`-th with a new measurement, the following bounds are exceeded with a
    probability of at most `share`: errors of attitude and rate by noise.attitude and noise.rate, the random torque by
    noise.torque, other standard normal vectors by noise.beside; and by the stated radii the rate, the turn and the lagging
    torque that the errors and this torque cause near the target, and what momentum adds to these."""
    numbers = claim.numbers
    share, samples, every = (numbers[name] for name in (SHARE, "samples", "every"))
    demand(1 <= every <= MOST and every.denominator == samples.denominator == 1, "samples are not counted")
    spins, count = spins_of(motion.loop), int(every)
    roles = [CARRIED] * min(count - 1, 1) + [CORRECTED]
    errors = [linear(claim, role) for role in roles]
    rows = iter(read_list(claim.evidence["covariances"], count * len(spins)))
    parts = parts_of(motion.near, len(errors[0][0][0]), spins)
    widths = [rational(x) for x in read_list(claim.evidence["deviations"], len(parts))]
    swayed = [rational(x) for x in read_list(claim.evidence["swayed"], len(parts) - 2)]
    for place, spin in enumerate(spins):
        driven_by = [driven(motion.near, *pair, spin, numbers.get(DEVIATION)) for pair in errors]
        first, last = driven_by[0], driven_by[-1]
        size = len(last[0][0])
        demand(size == len(first[0][0]) and len(last[0]) == len(first[0]), "the errors are not those of one estimate")
        steps, shapes = (
            [first] * (count - 1) + [last],
            [shortened(matrix(next(rows), size, size), FINE) for _ in range(count)],
        )
        # The sample before the first of the list is like the last.
        pairs = pairwise([shapes[-1], *shapes])
        for k, ((before, after), step) in enumerate(zip(pairs, steps, strict=True), place * count):
            spread = covariance(before, *step)
            yield f"covariance {k}", Definite(plus(after, [row[:size] for row in spread[:size]], -1))
            for width, (name, blocks) in zip(widths, parts.items(), strict=True):
                for part in blocks:
                    block = [row[part] for row in spread[part]]
                    yield f"deviation of the {name} {k} {part.start}", Definite(plus(scalar(width * width), block, -1))
    radii = [numbers["noise.attitude"], numbers["noise.rate"], *swayed]
    often = [1, 1, *(len(spins) * len(blocks) for blocks in [*parts.values()][2:])]
    beside, missed = "", sum(n * samples * tail(*pair) for n, *pair in zip(often, radii, widths, strict=True))
    if DEVIATION in numbers:
        missed += samples * tail(motion.random, numbers[DEVIATION])
        beside = f", a random torque from outside up to {below(motion.random)} N m"
    if BESIDE in numbers:
        vectors = numbers[VECTORS] if VECTORS in numbers else Fraction(1)
        demand(vectors >= 1, "there is no other noise")
        missed += vectors * samples * tail(numbers[BESIDE], Fraction(1))
        beside += f", other noise up to {below(numbers[BESIDE])} deviations"
    yield "share", Exceeds(share, missed)
    text = (
        f", of these errors up to {below(numbers['noise.attitude'])} rad and {below(numbers['noise.rate'])} rad/s driven by"
        f" noise{beside}: all this at {samples} samples on end with a probability of at least {below(1 - share)}"
    )
    motion.sways(swayed)
    return Statement(text, ("gaussian-noise", "linear-estimate", "settled-estimate"))


def spins_of(loop: AttitudeLoop) -> list[Spin | None]:
    """Return what wheels' momentum adds per unit of rate at three of the six corners of an octahedron that contains every
    momentum they may have; the others are opposite to these. None without wheels."""
    if not loop.wheels:
        return [None]
    most = ROOT * loop.claim.numbers["momentum"]
    return [spinning(loop, [most * (i == k) for i in AXES]) for k in AXES]


def parts_of(near: Near, size: int, spins: Sequence[Spin | None]) -> dict[str, list[slice]]:
    """Return the places of what noise drives, after `size` errors: the measurement errors, and the rate, the turn and a
    lagging torque that they cause; with wheels each with and without momentum, and half of the difference."""
    wide, count = len(near.A), 2 if spins[0] else 1
    begun, names = size + count * wide, ("rate", "turn", "torque")[: wide // 3]

    def at(*places: int) -> list[slice]:
        return [slice(place, place + 3) for place in places]

    where = {"attitude": at(begun), "rate": at(begun + 3)}
    where |= {f"motion's {name}": at(*(wide * k + 3 * i for k in range(count))) for i, name in enumerate(names)}
    return where | {f"spun {name}": at(begun + 6 + 3 * i) for i, name in enumerate(names) if spins[0]}


def driven(
    near: Near, errors: Rows, noise: Rows, spin: Spin | None = None, random: Fraction | None = None
) -> tuple[Rows, Rows]:
    """Return A and B of the rates and the turn that errors cause near the target, of the errors themselves and of those of
    the measurement, given A and B of the errors alone. The law measures q + e/2 and w + s. spin: with a momentum and with
    the opposite one, to first order, and half of the difference at the end. random: the deviation of a torque on the body;
    momentum has no effect on it within its own period."""
    size = len(errors) - 6
    turned, rated = ([row[part] for row in near.torque] for part in (TURN, RATE))

    def torque(rows: Rows) -> Rows:
        return plus(times(rated, rows[size + 3 :]), times(turned, rows[size : size + 3]), Fraction(1, 2))

    pushed: Rows = [[random * x for x in row] if random else [] for row in near.B]
    plain = [times(near.commanded, torque(rows)) for rows in (errors, noise)]
    still = [[Fraction(0)] * len(near.A) for _ in errors]

    def unpushed(rows: Rows) -> Rows:
        return [row + [Fraction(0)] * len(pushed[0]) for row in rows]

    if spin is None:
        return beside(near.A, plain[0]) + beside(still, errors), beside(plain[1], pushed) + unpushed(noise)
    law, body = spin

    def more(rows: Rows) -> Rows:
        grown = times(near.grown, times(body, times(near.eased, torque(rows))))
        return plus(times(near.commanded, times(law, rows[size + 3 :])), grown)

    # For both signs of the momentum: x without it, half of their sum, plus or minus what momentum adds.
    half = [[x / 2 for x in row] for row in near.spun(law, body)]
    (e, spun), (n, shaken) = ((rows, more(given)) for rows, given in zip(plain, (errors, noise), strict=True))
    both = [
        beside(beside(plus(near.A, half), half), plus(e, spun)),
        beside(beside([[-x for x in row] for row in half], plus(near.A, half, -1)), plus(e, spun, -1)),
    ]
    apart = [[(x - y) / 2 for x, y in zip(s, t, strict=True)] for s, t in zip(*both, strict=True)]
    signs = [beside(plus(n, shaken, sign), pushed) for sign in (1, -1)]
    misread = beside(beside(still, still), errors)
    return both[0] + both[1] + misread + apart, signs[0] + signs[1] + unpushed(noise) + unpushed(shaken)


def linear(claim: Claim, role: str) -> tuple[Rows, Rows]:
    """Return A and B of a program that maps errors x and noise n to Ax + Bn: the next errors, and those of the
    measurement."""
    program = claim.programs[role]
    size = len(program.outputs) - 3 * len(TOLD)
    errors = [f"errors.{k // 3}.{k % 3}" for k in range(size)]
    noise = sorted(set(program.inputs) - set(errors))
    demand(size > 0 and all(name.startswith("noise.") for name in noise), f"the {role} are not of errors and noise")
    given = {name: known(var(name)) for name in program.inputs}
    outputs = [single(cases) for cases in program.run(given, Exactly(), len(program.outputs))]
    demand(not any(() in p.terms for p in outputs), f"the {role} do not vanish without noise")
    return slopes(outputs, errors), slopes(outputs, noise)


def covariance(X: Rows, A: Rows, B: Rows) -> Rows:
    """Return an upper bound of the covariance of Ax + Bn, in numbers as short as those of X. If b is what rounding removes
    from A and B, (a + b)(a + b)' <= (1 + 1/c) aa' + (1 + c) bb', and bb' is at most squares of entries times the trace."""
    n, size, one, fine = len(A), len(X), 1 << PLACES, 1 << FINE
    whole = [[[x.numerator * one // x.denominator for x in row] for row in rows] for rows in (A, B)]
    motion, noise = ([{k: x for k, x in enumerate(row) if x} for row in rows] for rows in whole)
    shape = [[x.numerator * fine // x.denominator for x in row] for row in X]
    Account.spend(size * sum(map(len, motion)) + n * sum(map(len, motion + noise)), 2 * PLACES + FINE)
    half = [[sum([x * row[k] for k, x in given.items()]) for row in shape] for given in motion]
    trace, c = sum(X[k][k] for k in range(size)), 1 << SLIGHT
    room = ceil((1 + c) * n * (size * trace + len(B[0])) * Fraction(fine, one * one)) + n
    bound = scalar(0, n)
    for i, (given, pushed) in enumerate(zip(motion, noise, strict=True)):
        for j in range(i + 1):
            spread = sum([x * half[j][k] for k, x in given.items()])
            spread += sum([x * noise[j].get(k, 0) for k, x in pushed.items()]) << FINE
            rounded = spread * (c + 1) >> 2 * PLACES + SLIGHT
            bound[i][j] = bound[j][i] = Fraction(rounded + room * (i == j), fine)
    return bound


def tail(radius: Fraction, width: Fraction) -> Fraction:
    """Return an upper bound of the probability that |x| > radius, for a Gaussian x of three components with a covariance of
    at most width^2: sqrt(2/pi) (k + 1/k) exp(-k^2/2) with k = radius/width."""
    demand(width > 0, "a deviation is not positive")
    k = -up(-radius / width)
    demand(k > 0, "a radius is too small")
    y = -up(-k * k / 2)
    total, term = Fraction(0), Fraction(1)
    for n in range(TERMS):
        total, term = total + term, -up(-term * y / (n + 1))
    return up(Fraction(4, 5) * (k + 1 / k) / total)
