# pyright: basic
# Basic, not strict: every function is compiled, and Numba's own types are not visible to a type checker.
"""Passes over the horizon of a predictive program, each in time proportional to its length: states under a plan, the
gradient, and the Newton step by a backward Riccati sweep."""

from __future__ import annotations

from starhold.algebra.scalar import equation
from starhold.laws.predictive.limits import (
    box_inverse,
    held,
    inverse3,
    loose,
    plane_inverse,
    pressure,
    put,
    repelled,
    triple,
)
from starhold.laws.predictive.problem import compiled


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


@compiled
def sweep(problem, plan, space, barrier):
    """One backward Riccati sweep: the Newton step as a policy, step + feedback (x - x of the plan). With a
    gradient of zeros nothing is held, which gives the policy without limits. Returns the Newton decrement and the number
    of limits held.

    A barrier above zero asks for the step of the interior-point method instead: nothing is held, and the limits repel.
    """
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
        v, g = triple(plan, k), triple(space.gradient, k)
        g0, g1, g2 = g0 + g[0], g1 + g[1], g2 + g[2]
        space.stiffness[k] = m0 + m3 + m5
        if barrier > 0.0:
            m, push = repelled(problem, v, triple(space.multipliers, k), barrier, m)
            g0, g1, g2 = g0 + push[0], g1 + push[1], g2 + push[2]
            w = inverse3(m)
        elif problem.ball:
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


@compiled
def unroll(plan, problem, space):
    """Turn the policy into a direction: step becomes the Newton step without limits."""
    bend, feedback = space.bend, space.feedback
    for i in range(6):
        bend[i] = 0.0
    for k in range(plan.size // 3):
        d0, d1, d2 = triple(space.step, k)
        o = 18 * k
        for j in range(6):
            s = bend[6 * k + j]
            d0 += feedback[o + j] * s
            d1 += feedback[o + 6 + j] * s
            d2 += feedback[o + 12 + j] * s
        put(space.step, k, (d0, d1, d2))
        transition(problem, bend, 6 * k, (d0, d1, d2), bend, 6 * k + 6)
