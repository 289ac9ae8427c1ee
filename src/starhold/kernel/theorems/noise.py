"""How large errors become that Gaussian noise drives, but for a share of the times. Proof: docs/kernel.md, section 10."""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise

from ..held import Near
from ..loops import slopes
from ..numbers import Rows, beside, demand, matrix, plus, rational, read_list, scalar, times, transpose, up
from ..polynomials import var
from ..programs import Exactly, known, single
from ..reading import Claim
from ..regions import RATE, STATE, TURN, Radii
from ..rules import Definite, Exceeds, Part
from ..sentences import Statement, below

SHARE, BESIDE = "share", "noise.beside"
CARRIED, CORRECTED = "errors carried", "errors corrected"
"""The programs of a sample without a new measurement, and with one: from `errors` and standard normal `noise` to the errors
at the next, and to those of the attitude and the rate that the law is told."""
TOLD = ("attitude", "rate")
MOST, TERMS = 64, 80
"""How many samples there may be from one measurement to the next; terms of the exponential series."""


def within_radii(claim: Claim, near: Near) -> Part[tuple[Statement, Radii]]:
    """At all of `samples` samples on end, every `every`-th with a new measurement, errors of attitude and rate are no larger
    than noise.attitude and noise.rate, other standard normal vectors no longer than noise.beside, and the rate and the turn
    that the errors cause in the linear loop no larger than those returned, but with a probability of `share` at most."""
    numbers = claim.numbers
    share, samples, every = (numbers[name] for name in (SHARE, "samples", "every"))
    demand(1 <= every <= MOST and every.denominator == samples.denominator == 1, "samples are not counted")
    carried = [driven(near, *linear(claim, CARRIED))] * (int(every) - 1) if every > 1 else []
    steps = [*carried, driven(near, *linear(claim, CORRECTED))]
    size = len(steps[0][0][0])
    demand(len(steps[-1][0][0]) == size, "the errors are not those of one estimate")
    shapes = [matrix(shape, size, size) for shape in read_list(claim.evidence["covariances"], int(every))]
    parts = {"attitude": slice(size, size + 3), "rate": slice(size + 3, size + 6)}
    parts |= {"motion's rate": RATE, "motion's turn": TURN}
    widths = [rational(x) for x in read_list(claim.evidence["deviations"], len(parts))]
    wide, turned = (rational(x) for x in read_list(claim.evidence["swayed"], 2))
    radii = numbers["noise.attitude"], numbers["noise.rate"], wide, turned
    # The last sample before those of the list is like their last.
    for k, ((before, after), step) in enumerate(zip(pairwise([shapes[-1], *shapes]), steps, strict=True)):
        spread = covariance(before, *step)
        rest = plus(after, [row[:size] for row in spread[:size]], -1)
        yield f"covariance {k}", Definite(rest)
        for width, (name, part) in zip(widths, parts.items(), strict=True):
            own = [row[part] for row in spread[part]]
            yield f"deviation of the {name} {k}", Definite(plus(scalar(width * width), own, -1))
    beside, missed = "", samples * sum(map(tail, radii, widths))
    if BESIDE in numbers:
        missed += samples * tail(numbers[BESIDE], Fraction(1))
        beside = f", other noise up to {below(numbers[BESIDE])} deviations"
    yield "share", Exceeds(share, missed)
    text = (
        f", of these errors up to {below(numbers['noise.attitude'])} rad and {below(numbers['noise.rate'])} rad/s driven by"
        f" noise{beside}: all this at {samples} samples on end with a probability of at least {below(1 - share)}"
    )
    return Statement(text, ("gaussian-noise", "linear-estimate", "settled-estimate")), (wide, turned)


def driven(near: Near, errors: Rows, noise: Rows) -> tuple[Rows, Rows]:
    """Return A and B of the rates and the turn that errors cause near the target, the errors themselves and those told: from
    Ax + Bn for these alone. The law is told q + e/2 and w + s."""
    size = len(errors) - 6
    turned, rated = ([row[part] for row in near.torque] for part in (TURN, RATE))

    def torque(rows: Rows) -> Rows:
        told, fast = rows[size : size + 3], rows[size + 3 :]
        return plus(times(rated, fast), times(turned, told), Fraction(1, 2))

    still = [[Fraction(0)] * len(STATE) for _ in errors]
    return beside(near.A, times(near.B, torque(errors))) + beside(still, errors), times(near.B, torque(noise)) + noise


def linear(claim: Claim, role: str) -> tuple[Rows, Rows]:
    """Return A and B of a program that takes errors x and noise n to Ax + Bn: the next errors, and those that are told."""
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
    """Return the covariance of Ax + Bn."""
    return plus(times(A, times(X, transpose(A))), times(B, transpose(B)))


def tail(radius: Fraction, width: Fraction) -> Fraction:
    """Return a number that the probability of |x| > radius does not exceed, of a Gaussian x of three components with a
    covariance of no more than width^2: sqrt(2/pi) (k + 1/k) exp(-k^2/2) with k = radius/width."""
    demand(width > 0, "a deviation is not positive")
    k = -up(-radius / width)
    demand(k > 0, "a radius is too small")
    y = -up(-k * k / 2)
    total, term = Fraction(0), Fraction(1)
    for n in range(TERMS):
        total, term = total + term, -up(-term * y / (n + 1))
    return up(Fraction(4, 5) * (k + 1 / k) / total)
