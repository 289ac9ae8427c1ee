"""Limits of a move, a box or a ball around a centre, and inverses of 3x3 matrices that respect them."""

from __future__ import annotations

from functools import reduce
from typing import NamedTuple, TypeAlias

from starhold.algebra.scalar import (
    Scalar,
    Truth,
    absolute,
    both,
    divide,
    either,
    less,
    less_equal,
    maximum,
    minimum,
    opposite,
    sqrt,
    where,
)
from starhold.algebra.vector import ZERO, Vector, add, cross, dot, scale, subtract, times

ON_SPHERE = 1.0 - 1e-12
"""The share of the bound's square from which a move counts as lying on the sphere."""

Symmetric: TypeAlias = tuple[Scalar, Scalar, Scalar, Scalar, Scalar, Scalar]
"""A symmetric 3x3 matrix: m00, m01, m02, m11, m12, m22."""
Truths: TypeAlias = tuple[Truth, Truth, Truth]


class Limits(NamedTuple):
    """Limits of a move v: |v - centre| <= bound (N m; inf: none), in norm (ball) or on each axis, low <= v <= high."""

    centre: Vector
    bound: Scalar
    low: Vector
    high: Vector
    ball: bool


def make_limits(centre: Vector, bound: Scalar, *, ball: bool) -> Limits:
    """Return the limits of size `bound` (N m) about a centre."""
    wide = (bound, bound, bound)
    return Limits(centre, bound, subtract(centre, wide), add(centre, wide), ball)


def choose(truth: Truth, a: Vector, b: Vector) -> Vector:
    """Return a where the truth holds, else b."""
    return (where(truth, a[0], b[0]), where(truth, a[1], b[1]), where(truth, a[2], b[2]))


def project(limits: Limits, v: Vector) -> tuple[Vector, Truth]:
    """Return the point within the limits nearest to v, and whether v was outside."""
    if limits.ball:
        d = subtract(v, limits.centre)
        square = dot(d, d)
        outside = less(limits.bound * limits.bound, square)
        nearest = add(limits.centre, scale(divide(limits.bound, sqrt(square)), d))
        return choose(outside, nearest, v), outside
    low, high = limits.low, limits.high
    w = (
        minimum(high[0], maximum(low[0], v[0])),
        minimum(high[1], maximum(low[1], v[1])),
        minimum(high[2], maximum(low[2], v[2])),
    )
    inside = [both(less_equal(a, x), less_equal(x, b)) for a, x, b in zip(low, v, high, strict=True)]
    return w, opposite(reduce(both, inside))


def pressing(limits: Limits, v: Vector, g: Vector) -> Truths:
    """Return which axes of a box press against a limit, for the gradient g."""

    def presses(i: int) -> Truth:
        above = both(less(g[i], 0.0), less_equal(limits.high[i], v[i]))
        return either(above, both(less(0.0, g[i]), less_equal(v[i], limits.low[i])))

    return (presses(0), presses(1), presses(2))


def pressure(limits: Limits, v: Vector, g: Vector) -> tuple[Vector, Scalar]:
    """Return for a ball the outward normal (zero inside) and the multiplier of (|v - centre|^2 - bound^2)/2, zero when not
    pressing."""
    d = subtract(v, limits.centre)
    square = dot(d, d)
    on_it = less_equal(ON_SPHERE * limits.bound * limits.bound, square)
    normal = scale(divide(1.0, sqrt(square)), d)
    outward = -dot(g, normal)
    multiplier = divide(maximum(0.0, outward), limits.bound)
    return choose(on_it, normal, ZERO), where(on_it, multiplier, 0.0)


def loose(limits: Limits, v: Vector, g: Vector) -> Vector:
    """Return the part of the gradient along free directions."""
    if limits.ball:
        normal, multiplier = pressure(limits, v, g)
        along = add(g, scale(multiplier * limits.bound, normal))
        return choose(less(0.0, multiplier), along, g)
    fixed = pressing(limits, v, g)
    return (where(fixed[0], 0.0, g[0]), where(fixed[1], 0.0, g[1]), where(fixed[2], 0.0, g[2]))


def slack(limits: Limits, v: Vector) -> Vector:
    """Return (bound^2 - d^2)/2 for d = v - centre on each axis of a box, or three times that of a ball; positive inside."""
    d, bound = subtract(v, limits.centre), limits.bound

    def room(away: Scalar) -> Scalar:
        # As a product, which does not cancel near the limit.
        return 0.5 * (bound - away) * (bound + away)

    if limits.ball:
        s = room(sqrt(dot(d, d)))
        return (s, s, s)
    return (room(d[0]), room(d[1]), room(d[2]))


def repelled(limits: Limits, v: Vector, multipliers: Vector, barrier: Scalar, m: Symmetric) -> tuple[Symmetric, Vector]:
    """Return a symmetric matrix plus the curvature of the barrier, and the barrier's gradient: the interior-point step."""
    d, s = subtract(v, limits.centre), slack(limits, v)
    push = times((divide(barrier, s[0]), divide(barrier, s[1]), divide(barrier, s[2])), d)
    y0, y1, y2 = multipliers
    if limits.ball:
        z = divide(y0, s[0])
        curved: Symmetric = (
            m[0] + y0 + z * d[0] * d[0],
            m[1] + z * d[0] * d[1],
            m[2] + z * d[0] * d[2],
            m[3] + y0 + z * d[1] * d[1],
            m[4] + z * d[1] * d[2],
            m[5] + y0 + z * d[2] * d[2],
        )
        return curved, push
    return (
        m[0] + y0 * (1.0 + divide(d[0] * d[0], s[0])),
        m[1],
        m[2],
        m[3] + y1 * (1.0 + divide(d[1] * d[1], s[1])),
        m[4],
        m[5] + y2 * (1.0 + divide(d[2] * d[2], s[2])),
    ), push


def inverse(m: Symmetric) -> Symmetric:
    """Return the inverse of a symmetric matrix."""
    c0 = m[3] * m[5] - m[4] * m[4]
    c1 = m[2] * m[4] - m[1] * m[5]
    c2 = m[1] * m[4] - m[2] * m[3]
    s = divide(1.0, m[0] * c0 + m[1] * c1 + m[2] * c2)
    d0 = m[0] * m[5] - m[2] * m[2]
    d1 = m[1] * m[2] - m[0] * m[4]
    return (s * c0, s * c1, s * c2, s * d0, s * d1, s * (m[0] * m[3] - m[1] * m[1]))


def box_inverse(m: Symmetric, fixed: Truths) -> Symmetric:
    """Return the inverse of a symmetric matrix on the axes that are not fixed, zero on the others."""
    f0, f1, f2 = fixed
    w = inverse(
        (
            where(f0, 1.0, m[0]),
            where(either(f0, f1), 0.0, m[1]),
            where(either(f0, f2), 0.0, m[2]),
            where(f1, 1.0, m[3]),
            where(either(f1, f2), 0.0, m[4]),
            where(f2, 1.0, m[5]),
        )
    )
    return (where(f0, 0.0, w[0]), w[1], w[2], where(f1, 0.0, w[3]), w[4], where(f2, 0.0, w[5]))


def plane_inverse(m: Symmetric, n: Vector, multiplier: Scalar) -> Symmetric:
    """Return the inverse, on the plane normal to n, of a symmetric matrix plus `multiplier` times E; zero along n."""
    t = _tangent(n)
    u = cross(n, t)
    mt, mu = apply(m, t), apply(m, u)
    tt, tu, uu = dot(t, mt) + multiplier, dot(u, mt), dot(u, mu) + multiplier
    s = divide(1.0, tt * uu - tu * tu)
    # Columns of the inverse in the tangent basis, transformed back to the axes.
    y = scale(s, subtract(scale(uu, t), scale(tu, u)))
    z = scale(s, subtract(scale(tt, u), scale(tu, t)))
    return (
        t[0] * y[0] + u[0] * z[0],
        t[0] * y[1] + u[0] * z[1],
        t[0] * y[2] + u[0] * z[2],
        t[1] * y[1] + u[1] * z[1],
        t[1] * y[2] + u[1] * z[2],
        t[2] * y[2] + u[2] * z[2],
    )


def _tangent(n: Vector) -> Vector:
    """Return a unit vector across n: n crossed with the axis it is farthest from."""
    a0, a1, a2 = absolute(n[0]), absolute(n[1]), absolute(n[2])
    first = both(less_equal(a0, a1), less_equal(a0, a2))
    other = choose(less_equal(a1, a2), (-n[2], 0.0, n[0]), (n[1], -n[0], 0.0))
    t = choose(first, (0.0, n[2], -n[1]), other)
    return scale(divide(1.0, sqrt(dot(t, t))), t)


def apply(m: Symmetric, x: Vector) -> Vector:
    """Return m x."""
    return (
        m[0] * x[0] + m[1] * x[1] + m[2] * x[2],
        m[1] * x[0] + m[3] * x[1] + m[4] * x[2],
        m[2] * x[0] + m[4] * x[1] + m[5] * x[2],
    )
