# pyright: basic
# Basic, not strict: every function is compiled, and Numba's own types are not visible to a type checker.
"""The quadratic program of predictive control: the motion linearised and sampled, its cost, and its limits.

    minimise   sum over k < N of x_k'Q x_k + v_k'R v_k,  plus x_N'P x_N,   x_{k+1} = A x_k + B v_k,
    subject to |v_k - centre| <= bound, on each axis (box) or in norm (ball).

Matrices are flat arrays, row after row: with fixed offsets the compiler unrolls the loops.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numba
import numpy as np

from starhold.algebra.scalar import equation
from starhold.algebra.vector import apply, cross, scale, subtract
from starhold.models.craft import whole

# Not inlined, said outright: what an equation calls inherits its options, and inlining all this at each of five levels
# would multiply the time a kernel takes to compile.
compiled = numba.njit(error_model="numpy", forceinline=False)

TERMS = 30
"""Most terms of the Taylor series; fewer once they no longer count."""


class Space(NamedTuple):
    """Work arrays of a horizon of N: all that a solution needs, so that a call allocates nothing."""

    states: Any
    bend: Any
    gradient: Any
    trial: Any
    step: Any
    feedback: Any
    stiffness: Any
    multipliers: Any
    spare: Any
    value: Any
    small: Any


class Problem(NamedTuple):
    """A (36), B (18), Q (36), R (9), R^-1 (9), P (36), the limit's centre, its size (inf: none), and ball or box."""

    a: Any
    b: Any
    q: Any
    r: Any
    r_inverse: Any
    p: Any
    centre: Any
    bound: Any
    ball: Any


class Store(NamedTuple):
    """All numbers of a program: A (36) and B (18), the weights Q (36), R (9), R^-1 (9) and P (36), the feedback (18) for
    the move that a shifted plan lacks, and the work arrays."""

    a: Any
    b: Any
    q: Any
    r: Any
    r_inverse: Any
    p: Any
    tail: Any
    space: Space


FIXED = 312
PER_MOVE = 46
"""A store has FIXED + 12 numbers, and PER_MOVE for each move; the 12 are the state's at the end of the horizon."""


@equation
def carve(numbers: Any, horizon: int) -> Store:
    """The store that lives in the flat array of `make_store`: views, nothing is copied.

    One array rather than twenty travels with a trajectory; that halves the time a kernel takes to compile.
    """
    n = horizon
    per = numbers[FIXED:]
    space = Space(
        per[: 6 * n + 6],
        per[6 * n + 6 : 12 * n + 12],
        per[12 * n + 12 : 15 * n + 12],
        per[15 * n + 12 : 18 * n + 12],
        per[18 * n + 12 : 21 * n + 12],
        per[21 * n + 12 : 39 * n + 12],
        per[39 * n + 12 : 40 * n + 12],
        per[40 * n + 12 : 43 * n + 12],
        per[43 * n + 12 : 46 * n + 12],
        numbers[162:204],
        numbers[204:312],
    )
    return Store(
        numbers[0:36],
        numbers[36:54],
        numbers[54:90],
        numbers[90:99],
        numbers[99:108],
        numbers[108:144],
        numbers[144:162],
        space,
    )


@equation
def make_store(horizon: int) -> Any:
    """The numbers of a store for that many moves, all zero."""
    return np.zeros(FIXED + 12 + PER_MOVE * horizon)


@compiled
def linearise(seen: Any, craft: Any, a: Any, b: Any) -> None:
    """Fill a (36) and b (18) with A_c and B_c of x' = A_c x + B_c u for x = (q; w), small about the motion seen.

    A_c = [[-[w]x, E/2], [J^-1 G, J^-1 ([Jw]x - [w]x J)]], B_c = [0; J^-1], G = 6 (mu/R^5) ([R]x J - [JR]x) [R]x with
    R from the centre of attraction in body axes; G = 0 where there is none (R = 0).
    """
    w, position = seen.rate, seen.position
    momentum, pull = apply(craft.inertia, w), apply(whole(craft), position)
    square = position[0] * position[0] + position[1] * position[1] + position[2] * position[2]
    strength = 0.0
    if square > 0.0:
        strength = 6.0 * craft.gravity / (square * square * math.sqrt(square))
    for j in range(3):
        e = (1.0 if j == 0 else 0.0, 1.0 if j == 1 else 0.0, 1.0 if j == 2 else 0.0)
        turning = cross(e, w)
        lever = cross(position, e)
        tilt = subtract(cross(position, apply(whole(craft), lever)), cross(pull, lever))
        stiffness = scale(strength, apply(craft.inverse_inertia, tilt))
        swung = subtract(cross(momentum, e), cross(w, apply(craft.inertia, e)))
        damping = apply(craft.inverse_inertia, swung)
        inverse = apply(craft.inverse_inertia, e)
        for i in range(3):
            a[6 * i + j] = turning[i]
            a[6 * i + 3 + j] = 0.5 * e[i]
            a[18 + 6 * i + j] = stiffness[i]
            a[21 + 6 * i + j] = damping[i]
            b[3 * i + j] = 0.0
            b[9 + 3 * i + j] = inverse[i]


@compiled
def hold(a: Any, b: Any, period: float, work: Any) -> None:
    """Exact sampling with a held input, in place: a = exp(A_c h), b = (integral of exp(A_c s) over 0..h) B_c.

    Both come from S = sum of (A_c h)^k / (k + 1)!, which loses no digits where A_c is singular. work holds 108 numbers.
    """
    # Time counted in periods: then all entries of A_c and S are of comparable size.
    for i in range(3):
        for j in range(3):
            a[6 * i + j] *= period
            a[18 + 6 * i + j] *= period * period
            a[21 + 6 * i + j] *= period
            b[3 * i + j] *= period
            b[9 + 3 * i + j] *= period * period
    size = 0.0
    for i in range(6):
        row = 0.0
        for j in range(6):
            row += abs(a[6 * i + j])
        size = max(size, row)
    doublings = 0
    while size > 1.0 and doublings < 60:
        size *= 0.5
        doublings += 1
    shrink = 0.5**doublings
    s, t, y = 0, 36, 72
    for i in range(36):
        a[i] *= shrink
        work[s + i] = 1.0 if i % 7 == 0 else 0.0
        work[t + i] = work[s + i]
    for k in range(1, TERMS):
        multiply6(a, 0, work, t, work, y)
        peak = 0.0
        for i in range(36):
            term = work[y + i] / (k + 1.0)
            work[t + i] = term
            work[s + i] += term
            peak = max(peak, abs(term))
        if peak < 1e-21:
            break
    for _ in range(doublings):
        # S over twice the time is (S + exp(A) S) / 2 when each is divided by its own time.
        multiply6(a, 0, work, s, work, t)
        multiply6(work, t, work, s, work, y)
        for i in range(36):
            work[s + i] += 0.5 * work[y + i]
            a[i] *= 2.0
    multiply6(a, 0, work, s, work, t)
    for i in range(6):
        x0, x1, x2 = 0.0, 0.0, 0.0
        for j in range(6):
            c = work[s + 6 * i + j]
            x0 += c * b[3 * j]
            x1 += c * b[3 * j + 1]
            x2 += c * b[3 * j + 2]
        work[y + 3 * i], work[y + 3 * i + 1], work[y + 3 * i + 2] = x0, x1, x2
    for i in range(36):
        a[i] = work[t + i] + (1.0 if i % 7 == 0 else 0.0)
    per = 1.0 / period
    for i in range(3):
        for j in range(3):
            a[6 * i + 3 + j] *= period
            a[18 + 6 * i + j] *= per
            b[3 * i + j] = work[y + 3 * i + j]
            b[9 + 3 * i + j] = work[y + 9 + 3 * i + j] * per


@equation
def multiply6(a, p, b, q, c, o):
    """c[o:] = a[p:] b[q:] for 6x6 matrices; c must lie apart."""
    for i in range(6):
        w0, w1, w2, w3, w4, w5 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for j in range(6):
            s = a[p + 6 * i + j]
            w0 += s * b[q + 6 * j]
            w1 += s * b[q + 6 * j + 1]
            w2 += s * b[q + 6 * j + 2]
            w3 += s * b[q + 6 * j + 3]
            w4 += s * b[q + 6 * j + 4]
            w5 += s * b[q + 6 * j + 5]
        c[o + 6 * i], c[o + 6 * i + 1], c[o + 6 * i + 2] = w0, w1, w2
        c[o + 6 * i + 3], c[o + 6 * i + 4], c[o + 6 * i + 5] = w3, w4, w5
