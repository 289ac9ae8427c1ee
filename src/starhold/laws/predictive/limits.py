# pyright: basic
# Basic, not strict: every function is compiled, and Numba's own types are not visible to a type checker.
"""The limits of a move, a box or a ball round `problem.centre`, and the small inverses that respect them."""

from __future__ import annotations

import math

from starhold.algebra.scalar import equation

ON_SPHERE = 1.0 - 1e-12


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
