"""The theorem about the loop that flies: the torque is held between samples, torques from outside and errors of the command
are bounded, and motions from a large set come as near to the target as is told. Proof: docs/kernel.md, section 8."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TypeAlias

from ..loops import AXES, HYSTERESIS, SHORTEST, AttitudeLoop, slopes
from ..numbers import (
    Account, Rows, demand, inverse, matrix, norm, plus, rational, read_list, read_table, root, scalar, times, transpose, up,
)  # fmt: skip
from ..polynomials import Poly, apply, cross, dot, most, poly, var, variables
from ..reading import Claim
from ..rules import Definite, Exceeds
from ..sentences import Statement, above, below, enumerated
from .attitude import Proof, contents
from .limits import within_limits
from .sampling import beside, step

STATE = ("w1", "w2", "w3", "q1", "q2", "q3")
RATE, TURN, ITERATIONS = slice(0, 3), slice(3, 6), 60
Sizes: TypeAlias = Mapping[str, Fraction]


@dataclass(frozen=True)
class Region:
    """A set of states at samples: x.X^-1 x <= 1 for x = (w, q1, q2, q3), q0 >= least, and |x_i| at most the sizes."""

    X: Rows
    sizes: Sizes
    least: Fraction

    def within(self, X: Rows) -> Region:
        """Return the part that lies in an ellipsoid too."""
        sizes = {name: min(self.sizes[name], root(X[i][i])) for i, name in enumerate(STATE)}
        return Region(X, self.sizes | sizes, self.least)


@dataclass(frozen=True)
class Tube:
    """What motions from a region stay in for a period: sizes (u of the acceleration that is held), how far the rates drift,
    and how far q turns."""

    sizes: Sizes
    drift: list[Fraction]
    turned: Fraction


class Held:
    """A loop with its torque held for a period, and V = s (1 - q0) + x.Gx."""

    def __init__(self, loop: AttitudeLoop) -> None:
        numbers, V, x = loop.claim.numbers, loop.lyapunov, [var(name) for name in STATE]
        self.loop, self.h, self.outside, self.error = loop, numbers["period"], numbers["outside"], numbers["error"]
        self.push = self.outside + self.error
        demand(self.h > 0, "a period is not positive")
        demand(not (loop.outside or loop.moving or loop.wheels), "the loop is taken with nothing")
        loop.autonomous(loop.u)
        self.N: Rows = [[poly(p).number for p in row] for row in loop.J_inverse]
        self.gyroscopic = cross(loop.w, apply(loop.J, loop.w))
        self.pull, self.bend = apply(self.N, loop.u), apply(self.N, self.gyroscopic)
        # V' to V'''' while the acceleration u is held.
        acceleration = [u - g for u, g in zip(variables("u"), self.bend, strict=True)]
        self.rates = [loop.slopes_along(V, acceleration)]
        for _ in range(3):
            self.rates.append(loop.slopes_along(self.rates[-1], acceleration))
        mean = self.rates[0] + self.h / 2 * self.rates[1] + self.h * self.h / 6 * self.rates[2]
        self.mean = mean.at({f"u{k + 1}": p for k, p in enumerate(self.pull)})
        self.s = -V.terms.get(("q0",), Fraction(0))
        self.G = [[V.slope(i).slope(k).at(dict.fromkeys(STATE, 0)).number / 2 for k in STATE] for i in STATE]
        demand(not (V - self.s * (1 - loop.q[0]) - dot(x, apply(self.G, x))).terms, "V is not s (1 - q0) and a form")
        # What a torque does to V: felt x.
        self.felt = times(self.N, [[2 * entry for entry in row] for row in self.G[RATE]])
        # 2 (1 - q0) >= |q|^2.
        self.under = self.form(self.s / 2)

    def form(self, c: Fraction) -> Rows:
        """Return the matrix of x.Gx + c |q|^2."""
        return [[entry + c * (i == k > 2) for k, entry in enumerate(row)] for i, row in enumerate(self.G)]

    def region(self, c: Fraction) -> Region:
        """Return what holds {V <= c}. Over w V is least s (1 - q0) + q.Sq, with S >= -lean, and |q|^2 <= 2 (1 - q0)."""
        (ww, wq), (_, qq) = ([[row[b] for row in self.G[a]] for b in (RATE, TURN)] for a in (RATE, TURN))
        S = plus(qq, times(transpose(wq), times(inverse(ww), wq)), -1)
        lean = max(Fraction(0), *(sum(abs(S[i][k]) for k in AXES if k != i) - S[i][i] for i in AXES))
        demand(self.s > 2 * lean and c >= 0, "V is not least on target")
        least = 1 - up(c / (self.s - 2 * lean))
        demand(least > -1, "a level holds the other quaternion of the target")
        turn = root(1 - least * least) if least > 0 else Fraction(1)
        X = [[c * x for x in row] for row in inverse(self.under)]
        sizes = {name: root(X[i][i]) for i, name in enumerate(STATE)}
        return Region(X, sizes | {"q0": Fraction(1)} | {x: min(sizes[x], turn) for x in STATE[TURN]}, least)

    def tube(self, region: Region) -> Tube:
        """Return what motions stay in for a period."""
        sizes, held = region.sizes, {f"u{k + 1}": most(p, region.sizes) for k, p in enumerate(self.pull)}
        pushed = [u + self.push * norm(row) for u, row in zip(held.values(), self.N, strict=True)]

        def reached(wide: Sequence[Fraction]) -> list[Fraction]:
            rates = dict(zip(STATE, wide, strict=False))
            return [sizes[x] + self.h * (p + most(g, rates)) for x, p, g in zip(STATE, pushed, self.bend, strict=False)]

        wide = settled(reached)
        turned = self.h / 2 * norm(wide)
        far = {name: min(sizes[name] + turned, Fraction(1)) for name in STATE[TURN]}
        drift = [x - sizes[name] for x, name in zip(wide, STATE, strict=False)]
        return Tube({"q0": Fraction(1)} | dict(zip(STATE, wide, strict=False)) | far | held, drift, turned)

    def fall(self, region: Region) -> tuple[Rows, Rows, Fraction]:
        """Return Q, H and r such that V changes in a period by h (push |felt x| + r - x.Qx) at most, and V <= x.Hx."""
        h, tube = self.h, self.tube(region)
        slope, bent = self.rates[0], [[p.slope(name) for name in STATE[RATE]] for p in self.bend]

        def apart(d: Sequence[Fraction]) -> list[Fraction]:
            # How far a push takes the rates from where they go without it.
            return [
                h * (self.push * norm(own) + sum(most(p, tube.sizes) * x for p, x in zip(row, d, strict=True)))
                for own, row in zip(self.N, bent, strict=True)
            ]

        away = settled(apart)
        moved = [*tube.drift, *[tube.turned] * 3]
        rest = h**3 / 24 * most(self.rates[3], tube.sizes)
        rest += self.push / 2 * norm(sum(abs(a) * x for a, x in zip(row, moved, strict=True)) for row in self.felt)
        rest += sum(most(slope.slope(name), tube.sizes) * x for name, x in zip(STATE, away, strict=False)) / 2
        rest += h / 12 * norm(away) * sum(most(slope.slope(f"q{k}"), tube.sizes) for k in range(4))
        # q0 >= least: s (1 - q0) <= s |q|^2 / (1 + least).
        over = self.form(self.s / (1 + region.least))
        return least_form(-self.mean, region), over, rest

    def swing(self, region: Region) -> Fraction:
        """Return a bound of |V'| between samples."""
        sizes = self.tube(region).sizes
        felt = (sum(abs(a) * sizes[name] for a, name in zip(row, STATE, strict=True)) for row in self.felt)
        return most(self.rates[0], sizes) + self.push * norm(felt)

    def linear(self, region: Region) -> tuple[Rows, list[tuple[Rows, Fraction]]]:
        """Return A and pairs B, b such that samples in the region are followed by x+ = Ax + the sum of B v, |v| <= b: what is
        not linear is such a push."""
        h, N, tube, u = self.h, self.N, self.tube(region), self.loop.u
        rest = self.loop.on_target | self.loop.still
        linear = beside(*(slopes(u, letter, rest) for letter in "wq"))
        A = step([[-x for x in row] for row in times(N, linear)], h)
        x, far = [var(name) for name in STATE], region.sizes | {"v": sum(region.sizes[name] ** 2 for name in STATE[TURN])}
        turn, wide = norm(tube.sizes[name] for name in STATE[TURN]), norm(tube.sizes[name] for name in STATE[RATE])
        odd = [
            # q0 >= 0, so 1 - q0 <= |q|^2.
            most((p - own - g).at({"q0": 1 - var("v")}), far)
            + sum(most(g.slope(name), tube.sizes) * d for name, d in zip(STATE, tube.drift, strict=False))
            for p, own, g in zip(u, apply(linear, x), self.gyroscopic, strict=True)
        ]
        uneven = self.outside + norm(odd)
        return A, [
            ([[h * a for a in row] for row in N] + [[h * h / 4 * a for a in row] for row in N], self.error + uneven),
            (scalar(0) + N, h * h / 8 * uneven),
            (scalar(0) + scalar(1), h / 2 * wide * turn * (1 + turn)),
        ]


def image(X: Rows, shares: Sequence[Fraction], A: Rows, pushes: Sequence[tuple[Rows, Fraction]]) -> Rows:
    """Return the matrix of an ellipsoid that holds Ax + the sum of B v, of x.X^-1 x <= 1 and |v| <= b."""
    found = [[entry / (1 - sum(shares)) for entry in row] for row in times(A, times(X, transpose(A)))]
    for (B, b), share in zip(pushes, shares, strict=True):
        found = plus(found, times(B, transpose(B)), b * b / share)
    return found


def least_form(p: Poly, region: Region) -> Rows:
    """Return the matrix of a form that p is not below: two factors of x are taken out of every monomial, what is left lies
    in an interval, and |x_i x_k| <= (x_i^2 r_k / r_i + x_k^2 r_i / r_k) / 2 with the sizes r."""
    sizes, place = region.sizes, {name: k for k, name in enumerate(STATE)}
    found, radius = scalar(0, 6), scalar(0, 6)
    for m, c in p.terms.items():
        Account.spend(8)
        own, power = [name for name in m if name != "q0"], m.count("q0")
        demand(len(own) > 1, "the torque is not zero at rest on target")
        # The rates first.
        (*left, second, first), high = own, abs(c)
        for name in left:
            high *= sizes[name]
        even = all(left.count(name) % 2 == 0 for name in left)
        signed = not even or (power > 0 and region.least < 0)
        low = -high if signed else high * region.least**power if not left else Fraction(0)
        i, k, sign = place[first], place[second], 1 if c > 0 else -1
        found[i][k] += sign * (low + high) / 4
        found[k][i] += sign * (low + high) / 4
        radius[i][k] += up((high - low) / 4)
        radius[k][i] += up((high - low) / 4)
    for i, a in enumerate(STATE):
        found[i][i] -= up(sum((radius[i][k] * sizes[b] / sizes[a] for k, b in enumerate(STATE) if radius[i][k]), Fraction(0)))
    return found


def settled(change: Callable[[Sequence[Fraction]], list[Fraction]]) -> list[Fraction]:
    """Return bounds that a monotone change leaves bounds: what begins within them at no time leaves them."""
    found = [Fraction(0)] * 3
    for _ in range(ITERATIONS):
        further = change(found)
        if all(x <= y for x, y in zip(further, found, strict=True)):
            return found
        found = [up(x + x / 2**20) for x in further]
    demand(False, "the period is too long for the rates")
    raise AssertionError


def periods(fall: Fraction, floor: Fraction, start: Fraction, end: Fraction) -> int:
    """Return after how many periods a number is below `end` that in each comes down to (1 - fall) x + fall floor at most:
    (1 - fall)^n <= (1 + fall n / 64)^-64."""
    if start <= end:
        return 0
    ratio = up((start - floor) / (end - floor))
    for _ in range(6):
        ratio = root(ratio)
    return -((64 * (1 - ratio)) // fall)


def points(claim: Claim) -> Proof:
    """Every motion from {V <= level} has V <= highest at all times, and after the time `settling` it is at all times turned
    by no more than end.angle and turns no faster than end.rate. The torque is what the law asks for at the last sample and
    an error, |error| <= error; torques from outside are no more than `outside`."""
    loop = AttitudeLoop(claim)
    yield from loop.sound()
    held, numbers, samples = Held(loop), claim.numbers, 0
    c, h = numbers["level"], held.h
    yield "V exceeds a form", Definite(held.under)
    start = yield from contents(loop, loop.lyapunov)
    limited = yield from within_limits(loop)
    region = held.region(c)
    signs = {SHORTEST, HYSTERESIS} & claim.taken.content.keys()
    if any(claim.taken.get(word) for word in (SHORTEST, HYSTERESIS)):
        yield "the sign never changes", Exceeds(region.least)
    yield "V between samples", Exceeds(numbers["highest"], c + h / 2 * held.swing(region))
    levels, ellipsoids = (read_list(claim.evidence[name]) for name in ("levels", "ellipsoids"))
    demand(bool(levels), "no level is told")
    for k, told in enumerate(levels):
        end, tau, beta = map(rational, read_table(told, "end", "tau", "beta"))
        demand(min(tau, beta) > 0 and 0 < end < c, "a level is not below the one before")
        Q, H, rest = held.fall(region)
        pushed = held.push * held.push / (4 * tau) + rest
        fallen = plus(plus(Q, times(transpose(held.felt), held.felt), -tau), H, -beta)
        yield f"V falls {k}", Definite(fallen)
        yield f"V does not swing {k}", Exceeds(1, h * beta)
        yield f"level {k}", Exceeds(end, pushed / beta)
        samples += periods(h * beta, pushed / beta, c, end) if end > pushed / beta else 0
        c, region = end, held.region(end)
    for k, told in enumerate(ellipsoids):
        shape, parts, *rest = read_table(told, "shape", "shares", "rate", "reach")
        X, shares, (rate, reach) = matrix(shape, 6, 6), [rational(x) for x in read_list(parts, 3)], map(rational, rest)
        free = 1 - sum(shares)
        demand(min(free, rate, reach, *shares) > 0 and rate < 1, "shares or rates are not between 0 and 1")
        yield f"nearly upright {k}", Exceeds(region.least)
        after = image(X, shares, *held.linear(region))
        yield f"ellipsoid {k}", Definite(plus([[rate * x for x in row] for row in X], after, -1))
        yield f"entry {k}", Definite(plus([[reach * x for x in row] for row in X], region.X, -1))
        fall = 1 - rate * free
        samples += periods(fall, rate * (1 - free) / fall, reach, Fraction(1))
        region = region.within(X)
    angle, fastest = numbers["end.angle"], numbers["end.rate"]
    tube = held.tube(region)
    # Both samples next to a time lie in the region; |q| changes by |w|/2 at most, and sin x >= x - x^3/6.
    yield "nearly upright", Exceeds(region.least)
    near, slow = angle / 2 - angle**3 / 48 - h / 4 * fastest, fastest - norm(tube.drift) / 2
    for name, most_of, part in (("angle", near, TURN), ("rate", slow, RATE)):
        yield f"room for the {name}", Exceeds(most_of)
        yield f"end of the {name}", Definite(plus(scalar(most_of * most_of), [row[part] for row in region.X[part]], -1))
    yield "settling", Exceeds(numbers["settling"], h * samples)
    text = (
        f"every motion from {{V <= {below(numbers['level'])}}} stays in {{V <= {above(numbers['highest'])}}}, and after"
        f" {above(numbers['settling'])} s it is at all times within {above(angle)} rad of the target and turns no faster"
        f" than {above(fastest)} rad/s, with the torque held for {below(h)} s, torques from outside of up to"
        f" {below(held.outside)} N m and errors of the command of up to {below(held.error)} N m"
    )
    assumptions = ("rigid-body", "inertia-as-given", "bounded-push", "held-torque", *limited.assumptions, "target-at-rest")
    sign = "sign-at-once" if signs else "quaternion-as-fed"
    said = "".join(f"; {part}" for part in (enumerated(start), limited.text) if part)
    return Statement(text + said, (*assumptions, "no-wheels", sign), "pointing")
