"""How fast a target moves that follows the rotation spline through the knots in a certificate.

From a knot the attitude is q exp(phi), phi(s) = a s + b s2 + c s3 for s from 0 to 1. The rate is W = sum over n of
(-1)^n/(n+1)! (phi x)^n phi', at points exact but for balls. In between, h apart, a vector is no longer than at the ends and
h2/8 of the longest second derivative: with R the rotation by -u phi, W is the mean of R phi' over u from 0 to 1, a rotation
turns by u |phi'| at most, and so, with x1, x2, x3 the lengths of the derivatives of phi,

    |W''| <= x3 + 3 x1 x2/2 + x1^3/2,    |(W')''| <= 2 x1 x3 + 3 x2^2/2 + 3 x1^2 x2 + 3 x1^4/4.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from math import factorial
from typing import Any

from flint import acb, arb, fmpq

from starhold.algebra.quaternion import relative
from starhold.algebra.vector import add, cross, dot, scale, subtract
from starhold.checker.exact import ONE, ZERO, demand, rational, root_above, up

MOST = 4096
"""Points of a stretch between two knots that may be looked at."""


def moves_within(given: Mapping[str, Any], rate: Any, acceleration: Any) -> None:
    """A CheckError unless rate (rad/s) and acceleration (rad/s2) keep within bounds on the whole spline."""
    times = [rational(t) for t in given["times"]]
    attitudes, rates = ([tuple(map(rational, row)) for row in given[key]] for key in ("attitudes", "rates"))
    demand(len(times) >= 2, "the target's history has fewer than two knots")
    demand(len(times) == len(attitudes) == len(rates), "a knot of the target's history has no time, attitude or rate")
    for k, (first, last) in enumerate(pairwise(times)):
        demand(first < last, "the times of the target's history do not increase")
        span = last - first
        cubic = _cubic(relative(attitudes[k], attitudes[k + 1]), rates[k], rates[k + 1], span)  # pyright: ignore
        where = f"from {float(given['times'][k]):g} s"
        kept = _slower(*cubic, (rate * span, acceleration * span**2))
        demand(kept, f"the target may turn faster, or its rate change faster, {where}")


def _cubic(turn: Any, rate: Sequence[Any], later: Sequence[Any], span: Any) -> tuple[Any, Any, Any]:
    """a, b and c from the turn between two knots, up to its length, and the rates at both."""
    if turn[0] < 0:
        turn = tuple(-x for x in turn)
    square = sum((x * x for x in turn[1:]), ZERO)
    demand(turn[0] ** 2 * 10**13 > square, "two knots of the target's history are half a turn apart")
    a: Any = tuple(arb(x) * span for x in rate)
    end: Any = tuple(arb(x) * span for x in later)
    phi: Any = (arb(0),) * 3
    if square > 0:
        length: Any = arb(square).sqrt()
        half: Any = acb(arb(turn[0]), length).arg()
        u: Any = tuple(arb(x) / length for x in turn[1:])
        phi = scale(2 * half, u)
        # phi' = W + phi x W/2 + (1 - |phi|/2 cot(|phi|/2)) u x (u x W) about the axis u.
        across: Any = cross(u, end)
        end = add(end, add(scale(half, across), scale(1 - half / half.tan(), cross(u, across))))
    c: Any = subtract(add(a, end), add(phi, phi))
    return a, subtract(subtract(phi, a), c), c


def _slower(a: Any, b: Any, c: Any, limits: Sequence[Any]) -> bool:
    """Whether W and W' are shown to keep within limits on a stretch."""
    third: Any = fmpq(1, 3)
    # A curve is within the hull of its points in Bezier's form.
    size = _longest(scale(third, a), scale(third, add(add(a, a), b)), add(add(a, b), c))
    demand(size < 20, "the target's history swings too far between two knots")
    first, second = _longest(a, add(a, b), _slope(a, b, c, ONE)), _longest(_bend(b, c, ZERO), _bend(b, c, ONE))
    # What is left out is at most a geometric series of ratio 1/2.
    terms = next(n for n in range(2, 200) if n > 2 * size + 2 and size**n < fmpq(factorial(n), 10**30))
    left = 4 * size ** (terms - 1) / factorial(terms)
    tail = left * size * first, left * (terms * first**2 + size * second)
    squares: dict[Any, list[Any]] = {}

    def at(s: Any) -> list[Any]:
        if s not in squares:
            squares[s] = [up(dot(W, W)) for W in _motion(a, b, c, s, terms)]
        return squares[s]

    x3, waiting = 6 * _longest(c), [(ZERO, ONE)]
    while waiting:
        low, high = waiting.pop()
        width: Any = high - low
        begun, bent = _slope(a, b, c, low), _bend(b, c, low)
        x1 = _longest(begun, add(begun, scale(width / 2, bent)), _slope(a, b, c, high))
        x2 = _longest(bent, _bend(b, c, high))
        curved = x3 + 3 * x1 * x2 / 2 + x1**3 / 2, 2 * x1 * x3 + 3 * x2**2 / 2 + 3 * x1**2 * x2 + 3 * x1**4 / 4
        for place, (limit, most, error) in enumerate(zip(limits, curved, tail, strict=True)):
            square, room = max(at(low)[place], at(high)[place]), limit - most * width**2 / 8 - error
            if square > limit**2:
                return False
            if room < 0 or square > room**2:
                waiting += [(low, (low + high) / 2), ((low + high) / 2, high)]
                break
        if len(squares) > MOST:
            return False
    return True


def _slope(a: Any, b: Any, c: Any, s: Any) -> Any:
    return add(a, scale(s, add(add(b, b), scale(3 * s, c))))


def _bend(b: Any, c: Any, s: Any) -> Any:
    return add(add(b, b), scale(6 * s, c))


def _longest(*vectors: Any) -> Any:
    return root_above(max(up(dot(v, v)) for v in vectors))  # pyright: ignore


def _motion(a: Any, b: Any, c: Any, s: Any, terms: int) -> tuple[Any, Any]:
    """W and W' at a point, from so many terms of the sum."""
    phi: Any = scale(s, add(a, scale(s, add(b, scale(s, c)))))
    first, change = _slope(a, b, c, s), _bend(b, c, s)
    term = total = first
    slope = change
    for n in range(1, terms):
        share: Any = fmpq(-1, n + 1)
        change = scale(share, add(cross(first, term), cross(phi, change)))
        term = scale(share, cross(phi, term))
        total, slope = add(total, term), add(slope, change)
    return total, slope
