"""A loop with its torque held between samples, and a body with appendages whose motion is a recorded program.

The state z = (w, q, v) contains the appendages' state v. Near rest z' = Az + B(u + d) plus a remainder, which Taylor models
of the program bound, and u = -Kz plus a remainder, bounded likewise. Samples are in modal coordinates, y = Wz, in blocks of
one or two, each with a bound |y_k| <= r_k. All bounds over a period are linear in r, plus a constant. Docs/kernel.md, 12.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from functools import cached_property
from itertools import accumulate
from operator import mul
from typing import NamedTuple

from .loops import AXES, AttitudeLoop
from .numbers import Account, Rows, added, demand, inverse, norm, plus, reach, root, scalar, shortened, times, transpose, up
from .reading import IS_VALID
from .regions import stretch
from .taylor import PLACES, Model, add, beyond, multiple, multiply, negative, number, run, slope, within
from .taylor import root as root_of

MOST, LONGEST, FINE, TINY, LITTLE, SHORT = 40, 16, 2**64, Fraction(1, 2**20), Fraction(1, 2**200), 48
"""The most states of appendages; the largest norm of A times the period; the relative size of terms at which a series ends;
the size of inputs at which slopes at zero are read; the least nonzero entry of a matrix of bounds; the binary places of
slopes."""
HALF, ZERO = Fraction(1, 2), Fraction(0)
Column = list[Fraction]


class Box(NamedTuple):
    """Bounds of the states between samples, of the torque, and of the measured state at samples."""

    state: Column
    torque: Column
    measured: Column


class Left(NamedTuple):
    """Remainders: the rates differ from the linear ones by at most D|z| + T|u + d| + c, the law's torque by at most D|z| +
    c."""

    state: Rows
    torque: Rows
    rest: Column
    law: Rows
    law_rest: Column


class Period(NamedTuple):
    """Samples with |y_k| <= r_k are followed by ones with |y| <= grown r + more. Until then states are at most between r +
    far, torques with all errors torque r + pushed, and the command torque r + commanded, of which law r + law_rest is
    nonlinear in the measured state. Rates differ from the linear ones by at most `over`; external torques are at most
    `outside`, and errors of the command and of the measurement, as torques, at most `error`."""

    grown: Rows
    more: Column
    between: Rows
    far: Column
    torque: Rows
    pushed: Column
    commanded: Column
    law: Rows
    law_rest: Column
    over: Column
    outside: Fraction
    error: Fraction


class Appended:
    """The loop, its programs linearised near rest, and the bounds of a period."""

    def __init__(self, loop: AttitudeLoop) -> None:
        claim = loop.claim
        self.loop, self.numbers, self.h = loop, claim.numbers, claim.numbers["period"]
        demand(not (loop.outside or loop.moving or loop.wheels), "appendages are not taken with this")
        self.motion, self.count = claim.programs["motion"], len(claim.programs["motion"].outputs) - 3
        demand(0 < self.count <= MOST and self.h > 0, "appendages have no state, or too many")
        self.n = 6 + self.count
        self.names = {f"rate.{k}": k for k in AXES} | {f"state.{k}": 6 + k for k in range(self.count)}
        small = [TINY] * self.n
        slopes = [[slope(x, TINY, k) for k in range(self.n + 3)] for x in self.rates(small, [TINY] * 3)]
        A = [row[: self.n] for row in slopes]
        turning = [[HALF * (i == k) for k in range(self.n)] for i in AXES]
        B, none = [row[self.n :] for row in slopes], [[ZERO] * 3] * 3
        # All that follows holds of any A, B and K.
        self.A, self.B = (shortened(x, SHORT) for x in ([*A[:3], *turning, *A[3:]], [*B[:3], *none, *B[3:]]))
        # The law's torque is -Kz near rest.
        self.K = shortened([[-slope(x, TINY, k) for k in range(self.n)] for x in self.command(small)], SHORT)

    def rates(self, state: Column, torque: Column) -> list[Model]:
        """Return Taylor models of w' and v' for states and torques up to these sizes."""
        given = {name: within(state[k], k) for name, k in self.names.items()}
        given |= {f"torque.{k}": within(torque[k], self.n + k) for k in AXES}
        return run(self.motion, given, 3 + self.count)

    def command(self, state: Column) -> list[Model]:
        """Return Taylor models of the law's torque for measured states up to these sizes, near a target at rest, without
        external torque."""
        w, q = ([within(state[k], k) for k in range(first, first + 3)] for first in (0, 3))
        scalar_part = number(Fraction(1))
        for x in q:
            scalar_part = add(scalar_part, negative(multiply(x, x)))
        q, none, program = [root_of(scalar_part), *q], [number(ZERO)] * 3, self.loop.claim.programs["law"]
        fields = {"attitude": q, "rate": w, "body_rate": w, "target_rate": none, "target_acceleration": none}
        fields |= {"external_torque": none, "wheel_momentum": none}
        given = {f"measurement.{name}.{k}": x for name, parts in fields.items() for k, x in enumerate(parts)}
        given[IS_VALID] = number(Fraction(1))
        for name in program.inputs:
            if name.startswith(("gains.", "craft.", "plant.")) or name == "measurement.period":
                given[name] = number(self.loop.claim.subject[name])
        return run(program, given, 3)

    def left(self, box: Box) -> Left:
        """Return the remainders on a box. For q' the remainder is half of q0 w - w + q x w."""
        sizes = [*box.state, *box.torque]
        linear = [[*a, *b] for a, b in zip(self.A, self.B, strict=True)]
        rows = [beyond(x, sizes, row) for x, row in zip(self.rates(*box[:2]), [*linear[:3], *linear[6:]], strict=True)]
        x, y, z = q = box.state[3:6]
        v = sum((s * s for s in q), ZERO)
        turned = [[HALF * s for s in row] + [ZERO] * (self.n - 3) for row in ((v, z, y), (z, v, x), (y, x, v))]
        state, torque = ([row[part] for row, _ in rows] for part in (slice(self.n), slice(self.n, None)))
        rest = [c for _, c in rows]
        law = [beyond(x, box.measured, [-k for k in row]) for x, row in zip(self.command(box.measured), self.K, strict=True)]
        return Left(
            [*state[:3], *turned, *state[3:]],
            [*torque[:3], *[[ZERO] * 3] * 3, *torque[3:]],
            [*rest[:3], *[ZERO] * 3, *rest[3:]],
            [row for row, _ in law],
            [c for _, c in law],
        )  # fmt: skip

    @cached_property
    def misread(self) -> Column:
        """Return the bounds of the measurement errors of the state."""
        turned, rate = (self.numbers.get(f"error.{name}") or ZERO for name in ("attitude", "rate"))
        demand(turned <= HALF, "the error of the measured attitude is too large")
        return [*[rate] * 3, *[turned / 2] * 3, *[ZERO] * self.count]

    def push(self, name: str, state: Column) -> Fraction:
        """Return a bound of the external torque, or of the command's error."""
        return self.numbers[name] + (self.numbers.get(f"{name}.per.rate") or ZERO) * norm(state[:3])

    def take(self, W: Rows, blocks: Sequence[int]) -> None:
        """Take modal coordinates, in blocks of these sizes, and compute the linear motion in them."""
        self.W, self.blocks = W, blocks
        demand(set(blocks) <= {1, 2} and sum(blocks) == self.n, "blocks of coordinates are not of one or two")
        h, A, alone, axes = self.h, self.A, [1] * self.n, [1] * 3
        V = times(inverse(times(transpose(W), W)), transpose(W))
        KV = times(self.K, V)
        # If no component of x exceeds 1, no component of (Ah)^m x exceeds a^m.
        a = h * max(map(total, A))
        demand(a <= LONGEST, "the period is too long for the appendages")
        terms, last, top = 0, a / 2, 3 ** -(-a.numerator // a.denominator)
        while last * top * FINE > 1:
            terms, last = terms + 1, last * a / (terms + 3)
        # Each entry of the terms (Ah)^m/m! is rounded down, which moves none of them by more than this times e^a.
        places = PLACES + top.bit_length()
        self.tail = up(h * top * (last + Fraction(self.n * (terms + 1), 1 << places)))
        self.pull = plus(A, times(self.B, self.K), -1)[:3]
        forward, power = plus(times(A, V), times(self.B, KV), -1), scalar(1, self.n)
        end, held_torque, spans = V, [[ZERO] * 3 for _ in A], sized(V, alone, blocks)
        given, carry, filtered = held_torque, [[ZERO] * self.n for _ in A], [[ZERO] * self.n for _ in blocks]
        nudged, bent, struck, middle = [ZERO] * self.n, [ZERO] * self.n, [ZERO] * len(blocks), held_torque
        self.start, hurry = short(spans), sized([[ZERO] * self.n] * 3, axes, blocks)
        for m in range(terms + 1):
            share, moved, pushed = h / (m + 1), times(power, forward), times(power, self.B)
            end, held_torque = plus(end, moved, share), plus(held_torque, pushed, share)
            spans, given = plus(spans, sized(moved, alone, blocks), share), plus(given, sizes_of(pushed), share)
            carry = plus(carry, sizes_of(power), share)
            filtered = plus(filtered, sized(times(W, power), blocks, alone), share)
            # External torques have any direction, and may reverse at any time.
            lengths, turned = list(map(norm, pushed)), parted(times(W, pushed), blocks)
            nudged = [x + share * y for x, y in zip(nudged, lengths, strict=True)]
            # A curve is h^2/8 of its second derivative away from its chord, and that is near its value in the middle of the
            # period.
            curve, in_middle = h * (m * (m - 1)) / 12, Fraction(4, 2**m)
            bent = [x + curve * (1 - in_middle) * y for x, y in zip(bent, lengths, strict=True)]
            middle = plus(middle, pushed, curve * in_middle)
            struck = [x + share * norm(y for row in rows for y in row) for x, rows in zip(struck, turned, strict=True)]
            hurry = plus(hurry, sized(times(A[:3], moved), axes, blocks), share)
            power = shortened([[share * x for x in row] for row in times(A, power)], places)
        # A block of two is at most 3/2 times as long as its larger component.
        largest = [max(map(total, rows)) for rows in parted(W, blocks)]
        self.widths = [up(x * (size + 1) / 2) for x, size in zip(largest, blocks, strict=True)]
        self.filter = short([[x + self.tail * width for x in row] for row, width in zip(filtered, self.widths, strict=True)])
        self.carry = short([[x + self.tail for x in row] for row in carry])
        whole_period, self.linear = held_torque, short(sized(times(W, end), blocks, blocks))
        self.held_torque = short(sized(times(W, held_torque), blocks, axes))
        self.spans, self.given, self.feedback = short(spans), short(given), short(sized(KV, axes, blocks))
        rest = self.tail * max(map(norm, self.B))
        self.nudged, self.struck = combined(nudged, [rest] * self.n), combined(struck, [rest * x for x in self.widths])
        rest *= a / 2 + Fraction((terms + 2) * (terms + 1) * terms, 12)
        self.bent, self.hurry = combined(bent, [rest] * self.n), short(hurry)
        final = plus(self.B, times(A, whole_period))
        ends = ([[h / 2 * x for x in row] for row in rows] for rows in (self.B, final))
        self.ways = [shortened(rows, PLACES) for rows in (*ends, middle, whole_period)]
        self.sampled = shortened(times(end, W), PLACES)

    def begun(self, X: Rows, appendages: Column) -> Column:
        """Return bounds of the blocks for (w, q) in the ellipsoid of X and for appendages within these bounds."""
        blocks = list[Fraction]()
        for rows in parted(self.W, self.blocks):
            first = [row[:6] for row in rows]
            square = times(times(first, X), transpose(first))
            more = [added([abs(x) * y for x, y in zip(row[6:], appendages, strict=True)]) for row in rows]
            blocks.append(root(max(map(total, square))) + norm(more))
        return blocks

    def period(self, box: Box) -> Period:
        """Return the bounds of a period that follow from those of samples, as long as states and torques stay within a
        box."""
        # So the scalar part of the measured quaternion is positive, too.
        demand(norm(box.measured[3:6]) <= HALF, "motions are not near the target")
        left = self.left(box)
        error, outside = (self.push(name, box.state) for name in ("error", "outside"))
        # The law's torque is -Kz plus at most law r + rest, because the measured state is in error.
        law, law_rest = times(left.law, self.start), combined(left.law_rest, image(left.law, self.misread))
        commanded = combined(law_rest, image(sizes_of(self.K), self.misread))
        rest = combined(commanded, [error] * 3)
        torque, pushed = short(plus(self.feedback, law)), combined(rest, [outside] * 3)
        # What drives the state besides the linear motion and the external torques, from the sample on.
        over = combined(left.rest, image(left.state, box.state), image(left.torque, box.torque))
        tail = self.unseries(box)
        between = short(plus(self.spans, times(self.given, law)))
        shaken = [outside * x for x in self.nudged]
        far = combined(image(self.given, rest), image(self.carry, over), shaken, [tail] * self.n)
        inner = plus(times(left.state, between), times(left.torque, torque))
        beside = combined(left.rest, image(left.state, far), image(left.torque, pushed))
        grown = short(plus(plus(self.linear, times(self.held_torque, law)), times(self.filter, inner)))
        shaken = [tail * width + outside * x for width, x in zip(self.widths, self.struck, strict=True)]
        more = combined(image(self.held_torque, rest), image(self.filter, beside), shaken)
        rate, turn = ([row[part] for row in self.K] for part in (slice(3), slice(3, 6)))
        error += stretch(rate) * self.misread[0] + stretch(turn) * self.misread[3]
        return Period(grown, more, between, far, torque, pushed, commanded, law, law_rest, over, outside, error)

    def unseries(self, box: Box) -> Fraction:
        """Return how far the rest of the series can move any component of a state in a period."""
        return self.tail * max(combined(image(sizes_of(self.A), box.state), image(sizes_of(self.B), box.torque)))

    def beside(self, period: Period, box: Box, wrong: Fraction) -> Column:
        """Return what a period adds at most to the linear motion of samples (`sampled`) and to the effect (`ways`) of
        external torques and of held torques of up to `wrong`."""
        rounded = added([*box.state, 9 * period.outside, 3 * wrong]) / 2**PLACES
        shaken = [period.outside * x + self.unseries(box) + rounded for x in self.bent]
        return combined(image(self.carry, period.over), shaken)

    def hurried(self, period: Period, box: Box, radii: Column, wrong: Fraction) -> Fraction:
        """Return a bound, at all times, of the part of w' that is not linear in the last sample."""
        moved = combined(image(self.given, [wrong] * 3), image(self.carry, period.over))
        moved = [x + period.outside * y + self.unseries(box) for x, y in zip(moved, self.nudged, strict=True)]
        torques = [(wrong + period.outside) * norm(row) for row in self.B[:3]]
        return norm(combined(image(self.hurry, radii), image(sizes_of(self.A[:3]), moved), torques, period.over[:3]))


def image(rows: Rows, v: Column) -> Column:
    """Return the product of a nonnegative matrix and a nonnegative column."""
    return [up(x) for x in reach(rows, v)]


def combined(*columns: Column) -> Column:
    """Return a sum of columns."""
    return [added(entries) for entries in zip(*columns, strict=True)]


def total(row: Sequence[Fraction]) -> Fraction:
    """Return the sum of sizes."""
    return added([abs(x) for x in row])


def short(rows: Rows) -> Rows:
    """Return slightly larger entries that are short and not tiny."""
    return [[up(max(x, LITTLE)) if x else x for x in row] for row in rows]


def sizes_of(rows: Rows) -> Rows:
    """Return the absolute values of a matrix's entries."""
    return [[abs(x) for x in row] for row in rows]


def parted(rows: Rows, blocks: Sequence[int]) -> list[Rows]:
    """Return the rows of each block."""
    ends = list(accumulate(blocks))
    return [rows[end - size : end] for size, end in zip(blocks, ends, strict=True)]


def sized(rows: Rows, down: Sequence[int], across: Sequence[int]) -> Rows:
    """Return a bound of the norm of each block of a matrix."""
    columns = [parted(transpose(part), across) for part in parted(rows, down)]
    return [[longer(block) for block in row] for row in columns]


def longer(block: Rows) -> Fraction:
    """Return a bound of the norm of a matrix of at most two rows and columns: for two by two, half the sum of |(a + d, b -
    c)| and |(a - d, b + c)|."""
    if len(block) < 2 or len(block[0]) < 2:
        return norm([x for row in block for x in row])
    (a, b), (c, d) = block
    return (norm([a + d, b - c]) + norm([a - d, b + c])) / 2


def follow(period: Period, begun: Column, periods: int) -> tuple[Column, Column]:
    """Return bounds of the samples at the start of all of so many periods, given those at the first, and bounds after the
    last one. They are rounded up to whole multiples."""
    rows, (now, more) = (
        [list(map(multiple, row)) for row in period.grown],
        (list(map(multiple, x)) for x in (begun, period.more)),
    )
    largest = now
    for k in range(periods):
        Account.spend(len(now) ** 2 // 4, 2 * PLACES)
        largest = list(map(max, largest, now)) if k else largest
        now = [x - (-sum(map(mul, row, now)) >> PLACES) for row, x in zip(rows, more, strict=True)]
    most, last = ([Fraction(x, 1 << PLACES) for x in column] for column in (largest, now))
    return most, last


def after(period: Period, begun: Column, periods: int) -> Column:
    """Return bounds of samples after so many periods, by repeated squaring of r+ <= grown r + more."""
    grown, more = period.grown, period.more
    while periods:
        if periods & 1:
            begun = combined(image(grown, begun), more)
        grown, more, periods = short(times(grown, grown)), combined(image(grown, more), more), periods >> 1
    return begun
