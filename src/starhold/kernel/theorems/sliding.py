"""The theorem that a sliding-mode law reaches its surface, and what follows for the motion. Proof: docs/kernel.md, 6."""

from __future__ import annotations

from fractions import Fraction
from typing import NamedTuple

from ..loops import AXES, NONE, TURNS, AttitudeLoop, slopes
from ..numbers import Rows, demand, plus, scalar, times, transpose
from ..polynomials import Poly, apply, dot, minus, multiple
from ..programs import Case
from ..reading import Claim
from ..rules import Definite, Exceeds, Part, Proof, Squares, vanish
from ..sentences import Statement, above, below
from .attitude import contents


class Axis(NamedTuple):
    """(J s')_i - e_i is at most -reach sign(s_i), or, if `slope` is given, -slope s_i within a boundary layer."""

    reach: Fraction
    slope: Fraction | None


def reaches_surface(claim: Claim) -> Proof:
    """The motion reaches s = w + Kq = 0 in finite time, against any external torque within its bounds, and slides to rest on
    target; with a boundary layer it ends within |s| <= surface, and so near the target."""
    loop, numbers = AttitudeLoop(claim), claim.numbers
    vector, J = loop.q[1:], loop.given
    s, K, moved = yield from declared(loop)
    yield "q0 grows on the surface", Squares(dot(vector, apply(K, vector)), vector, 3)
    outside = [numbers[f"outside.{i}"] if loop.outside else Fraction(0) for i in AXES]
    axes = [taken_apart(loop, i, moved[i], s[i]) for i in AXES]
    for i, (reach, _) in enumerate(axes):
        yield f"reach {i}", Exceeds(reach, outside[i])
    layered = any(slope is not None for _, slope in axes)
    said, begun, most = "approaches" if layered else "reaches in a finite time", "every attitude and rate", Fraction(0)
    if loop.signs or (layered and any(outside)):
        half = [[x / 2 for x in row] for row in plus(K, transpose(K))]
        yield "least moment", Definite(plus(J, scalar(1), -numbers["inertia.low"]))
        yield "least slope", Definite(plus(half, scalar(1), -numbers["surface.low"]))
    ending = "slides to rest on target, on either quaternion"
    if layered and any(outside):
        most = yield from losses(loop, axes, outside)
        ending = yield from ending_in_the_layer(loop, most, J, K)
    if loop.signs:
        low, k, level = numbers["inertia.low"], numbers["surface.low"], numbers["level"]
        yield "the sign never changes", Exceeds(low * k * k, max(2 * level, most))
        contained = yield from contents(loop, dot(s, apply(loop.J, s)) * Fraction(1, 2))
        begun = " ".join([f"{{s.Js/2 <= {below(level)}}}", *(f"({part})" for part in contained)])
    assumed = ["bounded-outside-torque" if name == "known-outside-torque" else name for name in loop.assumed]
    demand(not loop.wheels, "no law of this kind is taken with wheels")
    assumed += ["continuous-torque", "unlimited-torque", loop.sign_assumed]
    return Statement(f"from {begun} the motion {said} the law's surface and {ending}", tuple(assumed), "sliding")


def declared(loop: AttitudeLoop) -> Part[tuple[list[Poly], Rows, list[Poly]]]:
    """Show that the law's surface is s = w + Kq, and return s, K, and J s' without the law's and the external torques."""
    yield from loop.sound()
    s = loop.single("surface", 3)
    K = slopes(s, TURNS)
    yield from vanish("surface", minus(minus(s, loop.w), apply(K, loop.q[1:])))
    # J s' = J w' + J K q'.
    without = minus(loop.balance(NONE), loop.e)
    return s, K, [a + b for a, b in zip(without, apply(loop.J, apply(K, loop.turning[1:])), strict=True)]


def taken_apart(loop: AttitudeLoop, i: int, moved: Poly, s: Poly) -> Axis:
    """Return the axis: in each case of the law (J s')_i - e_i, its torque and the moved terms, is a number against the sign
    of s_i, or -slope s_i."""
    reaches, linear = list[Fraction](), list[Fraction]()
    for case in loop.law[i]:
        change = case.value + moved
        sides = [sign for sign in (1, -1) if on_side(case, sign * s)]
        if len(sides) == 1 and not change.names:
            reaches.append(-sides[0] * change.number)
        elif not on_surface(case, s):
            slope = -change.slope(f"w{i + 1}").number
            demand(not (change + slope * s).terms and slope > 0, "the law is neither a switch nor a layer about its surface")
            linear.append(slope)
    demand(bool(reaches), "the law does not switch")
    return Axis(min(reaches), min(linear) if linear else None)


def on_side(case: Case, s: Poly) -> bool:
    """Tell whether a case implies s > c with a nonnegative c."""
    multiples = (multiple(Poly(dict(p)), s) for p, truth in case.guards if truth)
    return any(factor > 0 and offset <= 0 for factor, offset in multiples)


def on_surface(case: Case, s: Poly) -> bool:
    """Tell whether a case is about s = 0 alone."""
    multiples = [multiple(Poly(dict(p)), s) for p, truth in case.guards if not truth]
    return all(any(sign * factor > 0 and offset == 0 for factor, offset in multiples) for sign in (1, -1))


def losses(loop: AttitudeLoop, axes: list[Axis], outside: list[Fraction]) -> Part[Fraction]:
    """Show that s.Js/2 decreases outside the box |s_i| <= far_i, and return the largest s.Js in it."""
    numbers, squares = loop.claim.numbers, Fraction(0)
    gain = sum((m * m / (4 * slope) for (_, slope), m in zip(axes, outside, strict=True) if slope is not None), Fraction(0))
    for i, ((reach, slope), m) in enumerate(zip(axes, outside, strict=True)):
        far = numbers[f"far.{i}"]
        yield f"beyond the layer {i}", Exceeds((reach - m) * far, gain)
        if slope is not None:
            yield f"in the layer {i}", Exceeds(slope * far * far - m * far, gain)
        squares += far * far
    return numbers["inertia.high"] * squares


def ending_in_the_layer(loop: AttitudeLoop, most: Fraction, J: Rows, K: Rows) -> Part[str]:
    """Show the ultimate bound of motions in a boundary layer in which s.Js is at most so much."""
    numbers = loop.claim.numbers
    k, steep, size, angle = (numbers[name] for name in ("surface.low", "surface.high", "surface", "end.angle"))
    demand(angle < 3, "an angle is too large")
    yield "largest moment", Definite(plus(scalar(numbers["inertia.high"]), J, -1))
    yield "largest slope", Definite(plus(scalar(steep * steep), times(transpose(K), K), -1))
    yield "surface", Exceeds(size * size * numbers["inertia.low"], most)
    # sin^2 = 1 - cos^2 from below, as 0 < cos x <= 1 - x^2/2 + x^4/24.
    half = angle * angle / 4
    cosine = 1 - half / 2 + half * half / 24
    yield "angle", Exceeds((1 - cosine * cosine) * k * k, size * size)
    yield "rate", Exceeds((numbers["end.rate"] - size) * k, steep * size)
    return f"ends turned by no more than {above(angle)} rad at no more than {above(numbers['end.rate'])} rad/s"
