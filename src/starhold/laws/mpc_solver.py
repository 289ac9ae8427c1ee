# pyright: basic
# Basic, not strict: every function is compiled, and Numba's own types are not visible to a type checker.
"""Quadratic programs of predictive control, solved inside a compiled kernel: no allocation, no Python, no library.

    minimise   sum over k < N of x_k'Q x_k + v_k'R v_k,  plus x_N'P x_N,   x_{k+1} = A x_k + B v_k,
    subject to |v_k - centre| <= bound, on each axis (box) or in norm (ball).

The method is a projected Newton method of two metrics (Bertsekas 1982, "Projected Newton methods for optimization
problems with simple constraints"). What presses against a limit is held there, for a ball with the curvature of the
sphere; the rest takes the Newton step, which one backward Riccati sweep gives in time proportional to N. The step is
flown with its feedback through the limits, so moves further on already answer to those that were cut; where that does
not bring the cost down, a search along the projected line does, and where that fails too, a scaled gradient step, which
always does. A run ends when the gap to the optimum is proved small: for multipliers of the right sign, strong
convexity bounds the gap of half the cost by g'R^-1 g / 2, g being the gradient that is not held.

Matrices are flat arrays, row after row: with fixed offsets the compiler unrolls the loops.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numba
import numpy as np

from starhold.algebra.scalar import equation

compiled = numba.njit(error_model="numpy", cache=False)

TOLERANCE = 1e-16
"""Relative gap of the objective at which a solution is accepted."""
SUFFICIENT = 1e-4
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


def make_space(horizon: int) -> Space:
    """Work arrays for a horizon of that many moves."""
    n = horizon
    sizes = (6 * (n + 1), 6 * (n + 1), 3 * n, 3 * n, 3 * n, 18 * n, n, 42, 96)
    return Space(*(np.zeros(size) for size in sizes))


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
def transition(problem, x, o, v, y, p):
    """y[p:p+6] = A x[o:o+6] + B v."""
    a, b = problem.a, problem.b
    for i in range(6):
        s = b[3 * i] * v[0] + b[3 * i + 1] * v[1] + b[3 * i + 2] * v[2]
        for j in range(6):
            s += a[6 * i + j] * x[o + j]
        y[p + i] = s


@equation
def form(m, x, o):
    """x'Mx for a 6x6 M and x[o:o+6]."""
    total = 0.0
    for i in range(6):
        s = 0.0
        for j in range(6):
            s += m[6 * i + j] * x[o + j]
        total += s * x[o + i]
    return total


@equation
def form3(m, v):
    """v'Mv for a 3x3 M."""
    return (
        v[0] * (m[0] * v[0] + m[1] * v[1] + m[2] * v[2])
        + v[1] * (m[3] * v[0] + m[4] * v[1] + m[5] * v[2])
        + v[2] * (m[6] * v[0] + m[7] * v[1] + m[8] * v[2])
    )


@compiled
def rollout(problem, plan, x):
    """States under the plan from x[0:6]; half the cost."""
    n = plan.size // 3
    total = 0.0
    for k in range(n):
        v = triple(plan, k)
        total += form(problem.q, x, 6 * k) + form3(problem.r, v)
        transition(problem, x, 6 * k, v, x, 6 * k + 6)
    return 0.5 * (total + form(problem.p, x, 6 * n))


@compiled
def adjoint(problem, plan, space):
    """The gradient of half the cost, and a bound on its gap to the optimum if all that is held has to be."""
    a, b, q, r, x = problem.a, problem.b, problem.q, problem.r, space.states
    n = plan.size // 3
    y = space.small
    for i in range(6):
        s = 0.0
        for j in range(6):
            s += problem.p[6 * i + j] * x[6 * n + j]
        y[i] = s
    gap = 0.0
    for k in range(n - 1, -1, -1):
        v = triple(plan, k)
        for i in range(3):
            s = r[3 * i] * v[0] + r[3 * i + 1] * v[1] + r[3 * i + 2] * v[2]
            for j in range(6):
                s += b[3 * j + i] * y[j]
            space.gradient[3 * k + i] = s
        g = triple(space.gradient, k)
        gap += form3(problem.r_inverse, loose(problem, v, g))
        for i in range(6):
            s = 0.0
            for j in range(6):
                s += q[6 * i + j] * x[6 * k + j] + a[6 * j + i] * y[j]
            y[6 + i] = s
        for i in range(6):
            y[i] = y[6 + i]
    return 0.5 * gap


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


@compiled
def sweep(problem, plan, space, free):
    """One backward Riccati sweep: the Newton step as a policy, step + feedback (x - x of the plan). With `free`
    nothing is held and there is no gradient, which gives the policy without limits. Returns the Newton decrement and
    the number of limits held."""
    a, b, q, r, value, small = problem.a, problem.b, problem.q, problem.r, space.value, space.small
    n = plan.size // 3
    va, vb, qux = 0, 36, 54
    decrement, holding = 0.0, 0
    for i in range(36):
        value[i] = problem.p[i]
    for i in range(36, 42):
        value[i] = 0.0
    for k in range(n - 1, -1, -1):
        for i in range(6):
            w0, w1, w2, w3, w4, w5 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            y0, y1, y2 = 0.0, 0.0, 0.0
            for j in range(6):
                s = value[6 * i + j]
                w0 += s * a[6 * j]
                w1 += s * a[6 * j + 1]
                w2 += s * a[6 * j + 2]
                w3 += s * a[6 * j + 3]
                w4 += s * a[6 * j + 4]
                w5 += s * a[6 * j + 5]
                y0 += s * b[3 * j]
                y1 += s * b[3 * j + 1]
                y2 += s * b[3 * j + 2]
            small[va + 6 * i], small[va + 6 * i + 1], small[va + 6 * i + 2] = w0, w1, w2
            small[va + 6 * i + 3], small[va + 6 * i + 4], small[va + 6 * i + 5] = w3, w4, w5
            small[vb + 3 * i], small[vb + 3 * i + 1], small[vb + 3 * i + 2] = y0, y1, y2
        m0, m1, m2, m3, m4, m5 = r[0], r[1], r[2], r[4], r[5], r[8]
        g0, g1, g2 = 0.0, 0.0, 0.0
        for j in range(6):
            b0, b1, b2 = b[3 * j], b[3 * j + 1], b[3 * j + 2]
            y0, y1, y2 = small[vb + 3 * j], small[vb + 3 * j + 1], small[vb + 3 * j + 2]
            m0 += b0 * y0
            m1 += b0 * y1
            m2 += b0 * y2
            m3 += b1 * y1
            m4 += b1 * y2
            m5 += b2 * y2
            s = value[36 + j]
            g0 += b0 * s
            g1 += b1 * s
            g2 += b2 * s
        m = (m0, m1, m2, m3, m4, m5)
        for i in range(3):
            w0, w1, w2, w3, w4, w5 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            for j in range(6):
                s = b[3 * j + i]
                w0 += s * small[va + 6 * j]
                w1 += s * small[va + 6 * j + 1]
                w2 += s * small[va + 6 * j + 2]
                w3 += s * small[va + 6 * j + 3]
                w4 += s * small[va + 6 * j + 4]
                w5 += s * small[va + 6 * j + 5]
            small[qux + 6 * i], small[qux + 6 * i + 1], small[qux + 6 * i + 2] = w0, w1, w2
            small[qux + 6 * i + 3], small[qux + 6 * i + 4], small[qux + 6 * i + 5] = w3, w4, w5
        if free:
            w = inverse3(m)
        else:
            v, g = triple(plan, k), triple(space.gradient, k)
            g0, g1, g2 = g0 + g[0], g1 + g[1], g2 + g[2]
            space.stiffness[k] = m0 + m3 + m5
            if problem.ball:
                normal, multiplier = pressure(problem, v, g)
                if multiplier > 0.0:
                    holding += 1
                    w = plane_inverse(m, normal, multiplier)
                else:
                    w = inverse3(m)
            else:
                fixed = held(problem, v, g)
                holding += fixed[0] + fixed[1] + fixed[2]
                w = box_inverse(m, fixed)
        e0 = -(w[0] * g0 + w[1] * g1 + w[2] * g2)
        e1 = -(w[1] * g0 + w[3] * g1 + w[4] * g2)
        e2 = -(w[2] * g0 + w[4] * g1 + w[5] * g2)
        decrement -= e0 * g0 + e1 * g1 + e2 * g2
        put(space.step, k, (e0, e1, e2))
        o = 18 * k
        feedback = space.feedback
        for j in range(6):
            s0, s1, s2 = small[qux + j], small[qux + 6 + j], small[qux + 12 + j]
            feedback[o + j] = -(w[0] * s0 + w[1] * s1 + w[2] * s2)
            feedback[o + 6 + j] = -(w[1] * s0 + w[3] * s1 + w[4] * s2)
            feedback[o + 12 + j] = -(w[2] * s0 + w[4] * s1 + w[5] * s2)
        if k > 0:
            for i in range(6):
                s0, s1, s2 = small[qux + i], small[qux + 6 + i], small[qux + 12 + i]
                t = s0 * e0 + s1 * e1 + s2 * e2
                for j in range(6):
                    t += a[6 * j + i] * value[36 + j]
                small[72 + i] = t
                w0 = q[6 * i] + s0 * feedback[o] + s1 * feedback[o + 6] + s2 * feedback[o + 12]
                w1 = q[6 * i + 1] + s0 * feedback[o + 1] + s1 * feedback[o + 7] + s2 * feedback[o + 13]
                w2 = q[6 * i + 2] + s0 * feedback[o + 2] + s1 * feedback[o + 8] + s2 * feedback[o + 14]
                w3 = q[6 * i + 3] + s0 * feedback[o + 3] + s1 * feedback[o + 9] + s2 * feedback[o + 15]
                w4 = q[6 * i + 4] + s0 * feedback[o + 4] + s1 * feedback[o + 10] + s2 * feedback[o + 16]
                w5 = q[6 * i + 5] + s0 * feedback[o + 5] + s1 * feedback[o + 11] + s2 * feedback[o + 17]
                for j in range(6):
                    s = a[6 * j + i]
                    w0 += s * small[va + 6 * j]
                    w1 += s * small[va + 6 * j + 1]
                    w2 += s * small[va + 6 * j + 2]
                    w3 += s * small[va + 6 * j + 3]
                    w4 += s * small[va + 6 * j + 4]
                    w5 += s * small[va + 6 * j + 5]
                value[6 * i], value[6 * i + 1], value[6 * i + 2] = w0, w1, w2
                value[6 * i + 3], value[6 * i + 4], value[6 * i + 5] = w3, w4, w5
            for i in range(6):
                value[36 + i] = small[72 + i]
                for j in range(i):
                    # Kept symmetric against rounding, which long horizons would amplify.
                    s = 0.5 * (value[6 * i + j] + value[6 * j + i])
                    value[6 * i + j], value[6 * j + i] = s, s
    return decrement, holding
