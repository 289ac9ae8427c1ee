"""Sets of states of a loop with its torque held, and bounds of polynomials on them. Docs/kernel.md, 10."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from typing import NamedTuple

from .loops import AXES, RATES, TURNS
from .numbers import RefusedError, Rows, added, demand, plus, reach, root, scalar, times, transpose, up, whole
from .polynomials import Monomial, Poly, largest, total

STATE = (*RATES, *TURNS)
FAR = 1 << 100
"""The largest bound at which an iteration may settle."""
RATE, TURN, ITERATIONS = slice(0, 3), slice(3, 6), 60
SPEED, ANGLE, PULL, LOAD = "|w", "|q", "|u", "|j"
"""The names of the sizes of |w| and |q|, of the linear acceleration where it is known, and in a tube of the torque due to an
inertia near the given one."""
COMMANDED = "|u1", "|u2", "|u3"
"""The names of the sizes of the acceleration about each axis that is commanded because of state and momentum, where a claim
bounds it."""
AMISS = "|turn", "|rate"
"""The names, in a tube, of the additional errors of measured attitude and rate due to the motion."""
TURNED = [[[(i - k) * (j - k) * (j - i) // 2 for j in AXES] for k in AXES] for i in AXES]
"""The matrix of (x, y, z) × has x, y and z in these places with these signs: the permutation symbol."""
Sizes = dict[str, Fraction]
Factored = dict[tuple[int, int], list[Poly]]
Radii = tuple[Fraction, Fraction]
"""Bounds of |w| and |q| of a motion."""
AT_REST: Radii = (Fraction(0), Fraction(0))


@dataclass(frozen=True)
class Region:
    """A set of states at samples: x.X^-1 x <= 1 for x = (w, q1, q2, q3), q0 >= least, and sizes of |x_i|, |w|, |q|."""

    X: Rows
    sizes: Sizes
    least: Fraction

    def within(self, X: Rows, swayed: Radii = AT_REST) -> Region:
        """Return the part that lies within `swayed` of an ellipsoid of the state alone."""
        state = [row[: len(STATE)] for row in X[: len(STATE)]]
        sizes = {name: root(X[i][i]) + swayed[i // 3] for i, name in enumerate(STATE)}
        sizes |= {name: x + more for (name, x), more in zip(lengths(X).items(), swayed, strict=True)}
        return Region(widened(state, swayed), self.sizes | {k: min(self.sizes[k], x) for k, x in sizes.items()}, self.least)

    def around(self, radii: Radii, pull: Fraction) -> Region:
        """Return the part where |w|, |q| and the linear acceleration are within these bounds."""
        X = plus(scalar(0, 6), balls(radii), 2)
        sizes = {name: radii[i // 3] for i, name in enumerate(STATE)} | named((SPEED, ANGLE), [*radii])
        return Region(X, self.sizes | {k: min(self.sizes[k], x) for k, x in sizes.items()} | {PULL: pull}, self.least)


class Behind(NamedTuple):
    """Bounds of the late torque's error: at any time, in the mean, and of a held torque that moves the rates evenly and so
    has at least its effect on their motion in a period."""

    most: Fraction
    mean: Fraction
    moved: Fraction


@dataclass(frozen=True)
class Tube:
    """A set that motions from a region do not leave for a period: its sizes (u of the held acceleration), the drift of the
    rates, the turn of q, and the torques besides those that vanish with the state: held (`steady`), at any time (`pushed`),
    and due to changes of target, momentum and the external torque that the law knows (`stale`): in the mean, and twice that
    at any time. `uneven` is `steady` without the linear effect of errors that noise drives. `bent` bounds the slopes of the
    gyroscopic acceleration in the rates; `late`: the late torque's error; `end`: the drift of the rates at the end, while
    `drift` is that of a motion that drifts evenly and has at least the same effect."""

    region: Region
    sizes: Sizes
    drift: list[Fraction]
    turned: Fraction
    steady: Fraction
    pushed: Fraction
    stale: Fraction
    uneven: Fraction
    bent: Rows
    late: Behind
    end: list[Fraction]

    @property
    def push(self) -> Fraction:
        """Return the bound of all of these together, except for the late torque, in the mean."""
        return self.steady + self.pushed + self.stale


def factored(p: Poly) -> Factored:
    """Return the cofactors of a polynomial by the places of two factors of x, the last of every monomial: bounds of those
    that are even but for powers of q0, with positive and with negative sign, and of the rest."""
    place, parts = {name: k for k, name in enumerate(STATE)}, dict[tuple[int, int], tuple[dict[Monomial, int], ...]]()
    for m, c in p.upper.items():
        factors = sorted((name for name in m if name != "q0"), key=place.__contains__)
        demand(set(factors[-2:]) <= set(place) and len(factors) > 1, "the torque is not zero at rest on target")
        # The rates first.
        *left, i, k = factors
        kind = 2 if any(left.count(name) % 2 for name in left) else int(c < 0)
        parts.setdefault((place[i], place[k]), ({}, {}, {}))[kind][(*left, *["q0"] * m.count("q0"))] = abs(c)
    return {ends: [Poly(part, p.lower) for part in kinds] for ends, kinds in parts.items()}


def least_form(parts: Factored, region: Region) -> Rows:
    """Return the matrix of a quadratic form that bounds a polynomial from below: the cofactor of x_i x_k lies in an
    interval, and |x_i x_k| <= (x_i^2 r_k / r_i + x_k^2 r_i / r_k) / 2 with any r > 0, here those in which the diagonal is 1,
    or the sizes."""
    sizes, middle, radius = region.sizes, scalar(0, 6), scalar(0, 6)
    for (i, k), (more, less, uneven) in parts.items():
        if region.least < 0:
            uneven = total([uneven, *(part.only(lambda m: "q0" in m) for part in (more, less))])
            more, less = (part.only(lambda m: "q0" not in m) for part in (more, less))
        # A cofactor in q0 alone is at least its value at the least q0.
        least = [added([c * region.least ** len(m) for m, c in p.terms.items() if {*m} <= {"q0"}]) for p in (more, less)]
        ((high, low, spread),) = largest([[more, less, uneven]], sizes)
        above, below = high - least[1] + spread, low - least[0] + spread
        for a, b in ((i, k), (k, i)):
            middle[a][b] += (above - below) / 4
            radius[a][b] += (above + below) / 4
    given = [middle[i][i] for i in range(6)]
    units = [1 / root(x) for x in given] if min(given) > 0 else [sizes[name] for name in STATE]
    for i, row in enumerate(radius):
        middle[i][i] -= up(reach([row], units)[0] / units[i])
    return middle


def outweighed(Q: Rows, c: Fraction, F: Rows, M: Rows) -> Rows:
    """Return the matrix of a form that is no more than x.Qx - c |Fx| |Mx|: 2 |Fx| |Mx| <= s |Fx|^2 + |Mx|^2 / s."""
    large, small = stretch(M), stretch(F)
    if not c * large * small:
        return Q
    s = large / small
    return plus(plus(Q, times(transpose(F), F), -c * s / 2), times(transpose(M), M), -c / (2 * s))


def felt(parts: list[Poly], letter: str, sizes: Sizes) -> Fraction:
    """Return a bound, in norms, of how much expressions change with a vector; zero for one that occurs in none of them."""
    rows, turned, bound = taken_apart(tuple(parts), letter, tuple(name for name in sizes if name[0] == letter))
    bound = stretch(largest(rows, sizes)) if rows else bound
    for other, c in turned:
        bound += c * (sizes[SPEED] if other == "w" else max(sizes[f"{other}{k + 1}"] for k in AXES))
    return bound


@lru_cache(256)
def taken_apart(
    parts: tuple[Poly, ...], letter: str, names: tuple[str, ...]
) -> tuple[list[list[Poly]], list[tuple[str, Fraction]], Fraction]:
    """Return the slopes of polynomials in a vector without the terms c y x z, and c for each y: |y x z| <= |y| |z|, and the
    rest is bounded by its entries; where these are numbers their bound stands in their place. No external vector is longer
    than the bound of each of its components."""
    demand(all(name in names for p in parts for name in p.names if name[0] == letter), "the size of a vector is not stated")
    rows, turned = [[p.slope(name) for name in names] for p in parts], list[tuple[str, Fraction]]()
    for other in "wrah" if len(rows) == len(names) == 3 else "":
        axes = [f"{other}{k + 1}" for k in AXES]
        c = rows[1][0].terms.get((axes[2],))
        if c is None:
            continue
        slopes = [[[p.terms.get((name,), 0) for name in axes] for p in row] for row in rows]
        if slopes == [[[(0, c, -c)[x] for x in axis] for axis in row] for row in TURNED]:
            rows = [[p.only(lambda m, axes=axes: len(m) != 1 or m[0] not in axes) for p in row] for row in rows]
            turned.append((other, abs(c)))
    if any(p.names for row in rows for p in row):
        return rows, turned, Fraction(0)
    return [], turned, stretch(largest(rows, {})) if names else Fraction(0)


def as_told(true: Sizes, wrong: Sizes) -> Sizes:
    """Return the sizes of the law's inputs for errors of these sizes, by letter."""
    return {name: x + wrong.get(name[-1 if name in (SPEED, ANGLE) else 0], 0) for name, x in true.items()}


def lengths(X: Rows) -> Sizes:
    """Return bounds of |w| and |q| where x.X^-1 x <= 1: no eigenvalue exceeds the largest sum of a row."""
    parts = (([row[part] for row in X[part]], name) for part, name in ((RATE, SPEED), (TURN, ANGLE)))
    return {name: root(max(sum(map(abs, row), Fraction(0)) for row in rows)) for rows, name in parts}


def widened(X: Rows, swayed: Radii) -> Rows:
    """Return the matrix of an ellipsoid that contains everything within `swayed` of another one."""
    return plus([[2 * x for x in row] for row in X], balls(swayed), 4) if any(swayed) else X


def balls(radii: Radii) -> Rows:
    """Return the matrix whose blocks are those of balls of w and q with these radii."""
    return [[radii[i // 3] ** 2 * (i == k) for k in range(6)] for i in range(6)]


def first(p: Poly, letter: str) -> Poly:
    """Return the terms of which the first variable but q0 has this letter."""
    return p.only(lambda m: next(name for name in m if name != "q0")[0] == letter)


def with_momentum(p: Poly, rate: str = "w") -> Poly:
    """Return the terms of a polynomial that are products of wheels' momentum and a rate, the body's or the target's."""
    return p.only(lambda m: [name[0] for name in m] == sorted(("h", rate)))


def growing(parts: list[Poly]) -> list[Poly]:
    """Return the terms of polynomials that vanish with the state."""
    return [p.only(lambda m: not set(STATE).isdisjoint(m)) for p in parts]


def named(names: tuple[str, ...], values: list[Fraction]) -> Sizes:
    """Return values by names."""
    return dict(zip(names, values, strict=True))


def beyond(wide: list[Fraction], sizes: Sizes) -> list[Fraction]:
    """Return by how much bounds of the rates exceed those in a region."""
    return [x - sizes[name] for x, name in zip(wide, STATE[RATE], strict=True)]


def stretch(rows: Rows) -> Fraction:
    """Return a bound of the norm of a matrix: by the sums of its rows and of its columns, or by all entries."""
    numbers, below = whole([abs(x) for row in rows for x in row])
    lines = [numbers[k : k + len(rows[0])] for k in range(0, len(numbers), len(rows[0]))]
    return root(Fraction(stretch_squared(lines), below * below))


def stretch_squared(lines: list[list[int]]) -> int:
    """Return a bound of the square of the norm of a matrix without negative entries."""
    across, down = max(map(sum, lines)), max(map(sum, zip(*lines, strict=True)))
    return min(across * down, sum(x * x for line in lines for x in line))


def settled(change: Callable[[list[Fraction]], list[Fraction]], begun: list[Fraction] | None = None) -> list[Fraction]:
    """Return bounds that a monotone map maps into themselves: motions that begin within them never leave them."""
    bounds = begun or [Fraction(0)] * 3
    for _ in range(ITERATIONS):
        further = change(bounds)
        if all(x <= y for x, y in zip(further, bounds, strict=True)):
            return bounds
        bounds = [up(x + x / 2**20) for x in further]
        if max(bounds) > FAR:
            break
    raise RefusedError("the period is too long for the rates")
