"""Shows that a control stays within its limit on a level set round a circle, in the plane x = x' = 0.

In polar coordinates (y, z) = r (c, s), with c and s cosine and sine of the phase, and with the errors (f2, f3) along and
across that direction, a and b, V knows no phase, and each axis of the control is C c + S s with C and S polynomials in r, a,
b and the damping (p, q) along and across. So the largest control over all phases is known in closed form: of an axis its
square is C^2 + S^2, and of the norm the greater eigenvalue of the sum of (C, S)(C, S)'. What is left is a polynomial in
three variables: r, n = |(a, b)|, and the tangent t of half the angle of (a, b), or of its opposite.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from flint import arb

from starhold.algebra.polynomial import Polynomial
from starhold.checker.bernstein import negative_where
from starhold.checker.circle import CircleLoop
from starhold.checker.exact import ZERO, demand, down, floating, rational, replaced, sorted_by, up
from starhold.checker.subject import variables

SPAN = 1 + rational(2.0**-40)
"""By how much the ends of a box are moved outward, so that they can be short numbers."""


def keeps_within(circle: CircleLoop, level: Any, limit: Any, each_axis: bool) -> bool:
    """Whether the norm of the control, or each axis, is below the limit wherever V <= level and x = x' = 0."""
    gains = circle.gains
    r, n = variables(("r", "n"))
    off = r * r - gains.radius**2
    room = 2 * level - gains.alpha * off * off - n * n
    reach = (2 * arb(level) / arb(gains.alpha)).sqrt()
    square, most = arb(gains.radius) ** 2, _longer(up((2 * arb(level)).sqrt()))
    low, high = 1 / _longer(1 / down((square - reach).sqrt())), _longer(up((square + reach).sqrt()))
    rows = phases(circle)
    for push, part in _damping(gains, n, most):
        for side in (1, -1):
            box = {"r": (low, high), "n": part, "t": (rational(-1), rational(1))}
            turned = [(_at(C, push, side), _at(S, push, side)) for C, S in rows]
            if not all(negative_where(fall, room, box) for fall in _excess(turned, limit, each_axis)):
                return False
    return True


def phases(circle: CircleLoop) -> list[tuple[Polynomial, Polynomial]]:
    """C and S of each axis of the control."""
    r, c, s, a, b, p, q = variables(("r", "c", "s", "a", "b", "p", "q"))
    rate = circle.gains.rate
    still = Polynomial({})
    # On the circle's direction across, (-s, c), the velocity is b and what the circle is run through with.
    place = {"x1": still, "x2": r * c, "x3": r * s}
    speed = {"v1": still, "v2": a * c - b * s - rate * r * s, "v3": a * s + b * c + rate * r * c}
    taken = (still, p * c - q * s, p * s + q * c)
    found: list[tuple[Polynomial, Polynomial]] = []
    for part, less in zip(circle.neutral, taken, strict=True):
        axis = sorted_by(_on_unit_circle(replaced(part, {**place, **speed}) - less), lambda name: name not in ("c", "s"))
        demand(set(axis) <= {("c",), ("s",)}, "the control depends on the phase in another way")
        found.append((axis.get(("c",), still), axis.get(("s",), still)))
    return found


def _on_unit_circle(polynomial: Polynomial) -> Polynomial:
    """The polynomial with 1 - c^2 for s^2, as often as that occurs."""
    kept: Any = polynomial.only(lambda m: m.count("s") < 2)
    rest = polynomial.only(lambda m: m.count("s") >= 2)
    if not rest.terms:
        return kept
    c = variables(("c",))[0]
    fewer = Polynomial(
        {tuple(sorted([x for x in m if x != "s"] + ["s"] * (m.count("s") - 2))): k for m, k in rest.terms.items()}
    )
    return kept + _on_unit_circle(fewer - fewer * c * c)


def _damping(gains: Any, n: Any, most: Any) -> list[tuple[Any, tuple[Any, Any]]]:
    """The size of the damping as a polynomial in n, and where it is so."""
    if gains.feedback == 0:
        return [(gains.k * n, (ZERO, most))]
    demand(gains.boundary_layer > 0, "a relay without a layer has no size where nothing is wrong")
    within = (gains.k / gains.boundary_layer * n, (ZERO, min(gains.boundary_layer, most)))
    return (
        [within] if gains.boundary_layer >= most else [within, (Polynomial.constant(gains.k), (gains.boundary_layer, most))]
    )


def _at(polynomial: Polynomial, push: Any, side: int) -> Polynomial:
    """(1 + t^2) times a polynomial of degree one at most in a, b, p and q, of which (a, b) has the size n and (p, q) the
    size `push`, at the angle of which t tells, or at the opposite one."""
    n, t = variables(("n", "t"))
    cosine, sine = side * (1 - t * t), side * 2 * t
    values = {"a": n * cosine, "b": n * sine, "p": push * cosine, "q": push * sine}
    plain = polynomial.only(lambda m: not any(name in values for name in m))
    rest = polynomial.only(lambda m: any(name in values for name in m))
    demand(all(sum(name in values for name in m) == 1 for m in rest.terms), "the control is not linear in the errors")
    return plain * (1 + t * t) + replaced(rest, values)


def _excess(rows: Sequence[tuple[Any, Any]], limit: Any, each_axis: bool) -> list[Polynomial]:
    """Polynomials that are negative where the control is below the limit at every phase."""
    t = variables(("t",))[0]
    top = limit**2 * (1 + t * t) * (1 + t * t)
    if each_axis:
        return [C * C + S * S - top for C, S in rows]
    first: Any = sum((C * C for C, _ in rows), Polynomial({}))
    last: Any = sum((S * S for _, S in rows), Polynomial({}))
    mixed: Any = sum((C * S for C, S in rows), Polynomial({}))
    # A matrix of two rows is positive definite where one entry of its diagonal and its determinant are positive.
    return [first - top, mixed * mixed - (top - first) * (top - last)]


def _longer(x: Any) -> Any:
    """A short rational that is not less."""
    found = rational(floating(x)) * SPAN
    demand(found >= x, "a number is too large or too small")
    return found
