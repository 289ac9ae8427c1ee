"""A loop with its torque held between samples, and a body with appendages whose motion is a recorded program.

The state z = (w, q, v) has that of the appendages, v. Near rest z' = Az + B(u + d) and what is left, of which models of the
program bound how large it is, and u = -K(w, q) and what is left likewise. Samples are in modal coordinates, y = Wz, in
blocks of one or two: each |y_k| <= r_k. All bounds of what a period makes of that are linear in r, and a constant.
Docs/kernel.md, 12.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from functools import cached_property
from itertools import accumulate
from operator import mul
from typing import NamedTuple

from .loops import AXES, IS_VALID, AttitudeLoop
from .numbers import Account, Rows, added, demand, inverse, norm, plus, reach, root, scalar, shortened, times, transpose, up
from .regions import stretch
from .taylor import PLACES, Model, add, beyond, multiple, multiply, negative, number, run, slope, within
from .taylor import root as root_of

MOST, LONGEST, FINE, TINY, LITTLE, SHORT = 40, 16, 2**64, Fraction(1, 2**20), Fraction(1, 2**200), 48
"""How many states appendages may have; how far the motion of a period may be; the share of it at which a series ends; the
size of inputs of which slopes at zero are read; the least number of a matrix of bounds that is not zero; the places of
slopes."""
HALF, ZERO = Fraction(1, 2), Fraction(0)
Column = list[Fraction]


class Box(NamedTuple):
    """A box bounds the states between samples, the torque, and the state at samples that the law is told."""

    state: Column
    torque: Column
    measured: Column


class Left(NamedTuple):
    """The rates, and the law's torque, differ from the linear ones by at most D|z| + T|u + d| + c, and D|z| + c."""

    state: Rows
    torque: Rows
    rest: Column
    law: Rows
    law_rest: Column


class Period(NamedTuple):
    """Samples with |y_k| <= r_k are followed by ones with |y| <= grown r + more, the states until then are at
    most between r + far, torques with all errors torque r + pushed, and the command torque r + commanded, of which
    law r + law_rest is what is not linear in what is told. Rates differ from the linear ones by `over` at most; torques from
    outside are no more than `outside`, and errors of the command and of what is told no more than `error`."""

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
    """The loop, its programs read near rest, and the bounds of a period."""

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
        """Return models of w' and v' where states and torques are no larger than told."""
        given = {name: within(state[k], k) for name, k in self.names.items()}
        given |= {f"torque.{k}": within(torque[k], self.n + k) for k in AXES}
        return run(self.motion, given, 3 + self.count)

    def command(self, state: Column) -> list[Model]:
        """Return models of the law's torque where it is told no larger a state, near a target at rest, and no torque."""
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
        """Return what is left on a box. Of a turn that is q0 w - w + q x w, half of it."""
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
        """Return how far the state that the law is told is from the true one."""
        turned, rate = (self.numbers.get(f"error.{name}") or ZERO for name in ("attitude", "rate"))
        demand(turned <= HALF, "an attitude is told too wrongly")
        return [*[rate] * 3, *[turned / 2] * 3, *[ZERO] * self.count]

    def push(self, name: str, state: Column) -> Fraction:
        """Return a bound of the torque from outside, or of the error of the command."""
        return self.numbers[name] + (self.numbers.get(f"{name}.per.rate") or ZERO) * norm(state[:3])

    def take(self, W: Rows, blocks: Sequence[int]) -> None:
        """Take modal coordinates, in blocks of so many, and compute the linear motion in them."""
        self.W, self.blocks = W, blocks
        demand(set(blocks) <= {1, 2} and sum(blocks) == self.n, "blocks of coordinates are not of one or two")
        h, A, alone, axes = self.h, self.A, [1] * self.n, [1] * 3
        V = times(inverse(times(transpose(W), W)), transpose(W))
        KV = times(self.K, V)
        # Components of (Ah)^m x are no larger than a^m where those of x are no larger than 1.
        a = h * max(map(total, A))
        demand(a <= LONGEST, "the period is too long for the appendages")
        terms, last, top = 0, a / 2, 3 ** -(-a.numerator // a.denominator)
        while last * top * FINE > 1:
            terms, last = terms + 1, last * a / (terms + 3)
        # Of the terms (Ah)^m/m! each entry is rounded down, which takes none further off than by this times e^a.
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
            # Torques from outside come from any side, and turn over at any time.
            lengths, turned = list(map(norm, pushed)), parted(times(W, pushed), blocks)
            nudged = [x + share * y for x, y in zip(nudged, lengths, strict=True)]
            # A curve is h^2/8 of its second derivative from a line, which is near that in the middle of the period.
            curve, in_middle = h * (m * (m - 1)) / 12, Fraction(4, 2**m)
            bent = [x + curve * (1 - in_middle) * y for x, y in zip(bent, lengths, strict=True)]
            middle = plus(middle, pushed, curve * in_middle)
            struck = [x + share * norm(y for row in rows for y in row) for x, rows in zip(struck, turned, strict=True)]
            hurry = plus(hurry, sized(times(A[:3], moved), axes, blocks), share)
            power = shortened([[share * x for x in row] for row in times(A, power)], places)
        # A block of two is no longer than 3/2 times the larger one of its components.
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
        """Return bounds of the blocks where (w, q) is in the ellipsoid of X, and appendages are no further than told."""
        blocks = list[Fraction]()
        for rows in parted(self.W, self.blocks):
            first = [row[:6] for row in rows]
            square = times(times(first, X), transpose(first))
            more = [added([abs(x) * y for x, y in zip(row[6:], appendages, strict=True)]) for row in rows]
            blocks.append(root(max(map(total, square))) + norm(more))
        return blocks

    def period(self, box: Box) -> Period:
        """Return what a period makes of samples, as long as states and torques are within a box."""
        # So the scalar part of what is told is positive, too.
        demand(norm(box.measured[3:6]) <= HALF, "motions are not near the target")
        left = self.left(box)
        error, outside = (self.push(name, box.state) for name in ("error", "outside"))
        # The law's torque is -Kz, and beside no more than law r + rest, as it is told a state that is off.
        law, law_rest = times(left.law, self.start), combined(left.law_rest, image(left.law, self.misread))
        commanded = combined(law_rest, image(sizes_of(self.K), self.misread))
        rest = combined(commanded, [error] * 3)
        torque, pushed = short(plus(self.feedback, law)), combined(rest, [outside] * 3)
        # What moves the state beside the linear motion and torques from outside from the sample on.
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
        """Return how far what is left of the series may take each component of a state in a period."""
        return self.tail * max(combined(image(sizes_of(self.A), box.state), image(sizes_of(self.B), box.torque)))

    def beside(self, period: Period, box: Box, wrong: Fraction) -> Column:
        """Return what a period at most adds to what `sampled` makes of samples, and `ways` of torques from outside and of
        torques that are held, of up to `wrong`."""
        rounded = added([*box.state, 9 * period.outside, 3 * wrong]) / 2**PLACES
        shaken = [period.outside * x + self.unseries(box) + rounded for x in self.bent]
        return combined(image(self.carry, period.over), shaken)

    def hurried(self, period: Period, box: Box, radii: Column, wrong: Fraction) -> Fraction:
        """Return a bound of how far w' is at all times from what is linear in the last sample."""
        moved = combined(image(self.given, [wrong] * 3), image(self.carry, period.over))
        moved = [x + period.outside * y + self.unseries(box) for x, y in zip(moved, self.nudged, strict=True)]
        torques = [(wrong + period.outside) * norm(row) for row in self.B[:3]]
        return norm(combined(image(self.hurry, radii), image(sizes_of(self.A[:3]), moved), torques, period.over[:3]))


def image(rows: Rows, v: Column) -> Column:
    """Return a matrix of what is not negative times a column of that."""
    return [up(x) for x in reach(rows, v)]


def combined(*columns: Column) -> Column:
    """Return a sum of columns."""
    return [added(entries) for entries in zip(*columns, strict=True)]


def total(row: Sequence[Fraction]) -> Fraction:
    """Return the sum of sizes."""
    return added([abs(x) for x in row])


def short(rows: Rows) -> Rows:
    """Return numbers that are short and not tiny, and hardly larger."""
    return [[up(max(x, LITTLE)) if x else x for x in row] for row in rows]


def sizes_of(rows: Rows) -> Rows:
    """Return the sizes of a matrix's entries."""
    return [[abs(x) for x in row] for row in rows]


def parted(rows: Rows, blocks: Sequence[int]) -> list[Rows]:
    """Return the rows of each block."""
    ends = list(accumulate(blocks))
    return [rows[end - size : end] for size, end in zip(blocks, ends, strict=True)]


def sized(rows: Rows, down: Sequence[int], across: Sequence[int]) -> Rows:
    """Return how much longer each block of a matrix makes a vector at most."""
    columns = [parted(transpose(part), across) for part in parted(rows, down)]
    return [[longer(block) for block in row] for row in columns]


def longer(block: Rows) -> Fraction:
    """Return a bound of how much longer a matrix of no more than two rows and columns makes a vector: of two by two half the
    sum of |(a + d, b - c)| and |(a - d, b + c)|."""
    if len(block) < 2 or len(block[0]) < 2:
        return norm([x for row in block for x in row])
    (a, b), (c, d) = block
    return (norm([a + d, b - c]) + norm([a - d, b + c])) / 2


def follow(period: Period, begun: Column, periods: int) -> tuple[Column, Column]:
    """Return bounds of samples at the start of each of so many periods, the first of which is told, and after them. They are
    in whole multiples, rounded up."""
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
    """Return bounds of samples after so many periods, as (r+ <= grown r + more) is taken twice, and twice again."""
    grown, more = period.grown, period.more
    while periods:
        if periods & 1:
            begun = combined(image(grown, begun), more)
        grown, more, periods = short(times(grown, grown)), combined(image(grown, more), more), periods >> 1
    return begun
