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

# Not inlined, said outright: what an equation calls inherits its options, and inlining all this at each of five levels
# would multiply the time a kernel takes to compile.
compiled = numba.njit(error_model="numpy", forceinline=False)

TERMS = 30
"""Most terms of the Taylor series; fewer once they no longer count."""
ON_SPHERE = 1.0 - 1e-12


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
    R from the centre of attraction in body axes; G = 0 where there is none (R = 0). Source: equations B.
    """
    w, position = seen.rate, seen.position
    momentum, pull = apply(craft.inertia, w), apply(craft.inertia, position)
    square = position[0] * position[0] + position[1] * position[1] + position[2] * position[2]
    strength = 0.0
    if square > 0.0:
        strength = 6.0 * craft.gravity / (square * square * math.sqrt(square))
    for j in range(3):
        e = (1.0 if j == 0 else 0.0, 1.0 if j == 1 else 0.0, 1.0 if j == 2 else 0.0)
        turning = cross(e, w)
        lever = cross(position, e)
        tilt = subtract(cross(position, apply(craft.inertia, lever)), cross(pull, lever))
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


@equation
def project(v, problem):
    """The point of the admissible set nearest to v, and whether v was outside."""
    c, bound = problem.centre, problem.bound
    d = (v[0] - c[0], v[1] - c[1], v[2] - c[2])
    if problem.ball:
        square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
        if square > bound * bound:
            s = bound / math.sqrt(square)
            return (c[0] + s * d[0], c[1] + s * d[1], c[2] + s * d[2]), True
        return v, False
    w = (
        min(max(v[0], c[0] - bound), c[0] + bound),
        min(max(v[1], c[1] - bound), c[1] + bound),
        min(max(v[2], c[2] - bound), c[2] + bound),
    )
    return w, w[0] != v[0] or w[1] != v[1] or w[2] != v[2]


@equation
def triple(array, k):
    """Three numbers from the k-th triple of a flat array."""
    return (array[3 * k], array[3 * k + 1], array[3 * k + 2])


@equation
def put(array, k, v):
    """Write the k-th triple."""
    array[3 * k], array[3 * k + 1], array[3 * k + 2] = v[0], v[1], v[2]


@equation
def held(problem, v, g):
    """Which axes of a box press against a limit."""
    c, bound = problem.centre, problem.bound
    return (
        (g[0] < 0.0 and v[0] >= c[0] + bound) or (g[0] > 0.0 and v[0] <= c[0] - bound),
        (g[1] < 0.0 and v[1] >= c[1] + bound) or (g[1] > 0.0 and v[1] <= c[1] - bound),
        (g[2] < 0.0 and v[2] >= c[2] + bound) or (g[2] > 0.0 and v[2] <= c[2] - bound),
    )


@equation
def pressure(problem, v, g):
    """For a ball: the outward normal (zero inside) and the multiplier of (|v - centre|2 - bound2)/2, zero when not
    pressing."""
    c, bound = problem.centre, problem.bound
    d = (v[0] - c[0], v[1] - c[1], v[2] - c[2])
    square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
    if not square >= ON_SPHERE * bound * bound:
        return (0.0, 0.0, 0.0), 0.0
    s = 1.0 / math.sqrt(square)
    normal = (s * d[0], s * d[1], s * d[2])
    outward = -(g[0] * normal[0] + g[1] * normal[1] + g[2] * normal[2])
    return normal, max(outward, 0.0) / bound


@equation
def loose(problem, v, g):
    """The part of the gradient that no limit holds."""
    if problem.ball:
        normal, multiplier = pressure(problem, v, g)
        if multiplier > 0.0:
            s = multiplier * problem.bound
            return (g[0] + s * normal[0], g[1] + s * normal[1], g[2] + s * normal[2])
        return g
    fixed = held(problem, v, g)
    return (0.0 if fixed[0] else g[0], 0.0 if fixed[1] else g[1], 0.0 if fixed[2] else g[2])


@equation
def slack(problem, v):
    """(bound2 - d2)/2 for d = v - centre: on each axis of a box, or thrice that of a ball; positive inside."""
    c, bound = problem.centre, problem.bound
    d = (v[0] - c[0], v[1] - c[1], v[2] - c[2])
    # As a product, which does not cancel near the limit.
    if problem.ball:
        size = math.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
        s = 0.5 * (bound - size) * (bound + size)
        return (s, s, s)
    return (
        0.5 * (bound - d[0]) * (bound + d[0]),
        0.5 * (bound - d[1]) * (bound + d[1]),
        0.5 * (bound - d[2]) * (bound + d[2]),
    )


@equation
def repelled(problem, v, multipliers, barrier, m):
    """A symmetric matrix with the curvature of the limits added, and their push: the interior-point step."""
    c, s = problem.centre, slack(problem, v)
    d = (v[0] - c[0], v[1] - c[1], v[2] - c[2])
    push = (barrier / s[0] * d[0], barrier / s[1] * d[1], barrier / s[2] * d[2])
    if problem.ball:
        y = multipliers[0]
        z = y / s[0]
        return (
            m[0] + y + z * d[0] * d[0],
            m[1] + z * d[0] * d[1],
            m[2] + z * d[0] * d[2],
            m[3] + y + z * d[1] * d[1],
            m[4] + z * d[1] * d[2],
            m[5] + y + z * d[2] * d[2],
        ), push
    y0, y1, y2 = multipliers
    return (
        m[0] + y0 * (1.0 + d[0] * d[0] / s[0]),
        m[1],
        m[2],
        m[3] + y1 * (1.0 + d[1] * d[1] / s[1]),
        m[4],
        m[5] + y2 * (1.0 + d[2] * d[2] / s[2]),
    ), push


@equation
def inverse3(m):
    """The inverse of a symmetric matrix (m00, m01, m02, m11, m12, m22), in the same order."""
    c0 = m[3] * m[5] - m[4] * m[4]
    c1 = m[2] * m[4] - m[1] * m[5]
    c2 = m[1] * m[4] - m[2] * m[3]
    s = 1.0 / (m[0] * c0 + m[1] * c1 + m[2] * c2)
    d0 = m[0] * m[5] - m[2] * m[2]
    d1 = m[1] * m[2] - m[0] * m[4]
    return (s * c0, s * c1, s * c2, s * d0, s * d1, s * (m[0] * m[3] - m[1] * m[1]))


@equation
def box_inverse(m, fixed):
    """Inverse of a symmetric matrix on the axes that are not fixed, zero on the others."""
    f0, f1, f2 = fixed
    cut = (
        1.0 if f0 else m[0],
        0.0 if f0 or f1 else m[1],
        0.0 if f0 or f2 else m[2],
        1.0 if f1 else m[3],
        0.0 if f1 or f2 else m[4],
        1.0 if f2 else m[5],
    )
    w = inverse3(cut)
    return (0.0 if f0 else w[0], w[1], w[2], 0.0 if f1 else w[3], w[4], 0.0 if f2 else w[5])


@equation
def plane_inverse(m, n, multiplier):
    """Inverse of a symmetric matrix plus multiplier on the plane normal to n, zero along n."""
    # The first tangent: n crossed with the axis it is farthest from.
    a0, a1, a2 = abs(n[0]), abs(n[1]), abs(n[2])
    if a0 <= a1 and a0 <= a2:
        t = (0.0, n[2], -n[1])
    elif a1 <= a2:
        t = (-n[2], 0.0, n[0])
    else:
        t = (n[1], -n[0], 0.0)
    s = 1.0 / math.sqrt(t[0] * t[0] + t[1] * t[1] + t[2] * t[2])
    t = (s * t[0], s * t[1], s * t[2])
    u = (n[1] * t[2] - n[2] * t[1], n[2] * t[0] - n[0] * t[2], n[0] * t[1] - n[1] * t[0])
    mt = (
        m[0] * t[0] + m[1] * t[1] + m[2] * t[2],
        m[1] * t[0] + m[3] * t[1] + m[4] * t[2],
        m[2] * t[0] + m[4] * t[1] + m[5] * t[2],
    )
    mu = (
        m[0] * u[0] + m[1] * u[1] + m[2] * u[2],
        m[1] * u[0] + m[3] * u[1] + m[4] * u[2],
        m[2] * u[0] + m[4] * u[1] + m[5] * u[2],
    )
    tt = t[0] * mt[0] + t[1] * mt[1] + t[2] * mt[2] + multiplier
    tu = u[0] * mt[0] + u[1] * mt[1] + u[2] * mt[2]
    uu = u[0] * mu[0] + u[1] * mu[1] + u[2] * mu[2] + multiplier
    s = 1.0 / (tt * uu - tu * tu)
    # Columns of the inverse in the tangent basis, carried back to the axes.
    y = (s * (uu * t[0] - tu * u[0]), s * (uu * t[1] - tu * u[1]), s * (uu * t[2] - tu * u[2]))
    z = (s * (tt * u[0] - tu * t[0]), s * (tt * u[1] - tu * t[1]), s * (tt * u[2] - tu * t[2]))
    return (
        t[0] * y[0] + u[0] * z[0],
        t[0] * y[1] + u[0] * z[1],
        t[0] * y[2] + u[0] * z[2],
        t[1] * y[1] + u[1] * z[1],
        t[1] * y[2] + u[1] * z[2],
        t[2] * y[2] + u[2] * z[2],
    )
