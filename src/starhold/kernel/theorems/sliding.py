"""The theorem that a sliding-mode law reaches its surface, and what becomes of the motion then. Proof: docs/kernel.md, 6."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from fractions import Fraction

from ..loops import AXES, HYSTERESIS, SHORTEST, AttitudeLoop, slopes
from ..numbers import Rows, demand, plus, scalar, times, transpose
from ..polynomials import Poly, apply, dot, multiple, poly
from ..programs import Case, single
from ..reading import Claim
from ..rules import Definite, Exceeds, Obligation, Shown, Squares, Vanishes
from ..sentences import Statement, above, below
from .attitude import contents


@dataclass(frozen=True)
class Axis:
    """(J s')_i - e_i is -reach sign(s_i) at most, or where `slope` is told -slope s_i within a boundary layer."""

    reach: Fraction
    slope: Fraction | None


def reaches_surface(claim: Claim) -> Generator[tuple[str, Obligation], None, Statement]:
    """The motion reaches s = w + Kq = 0 in a finite time, against any torque from outside that is at most as told, and
    slides to rest on target; with a boundary layer it ends within |s| <= surface, and so near the target."""
    loop = AttitudeLoop(claim)
    numbers = claim.numbers
    s, K, moved = yield from declared(loop)
    yield "q0 grows on the surface", Squares(dot(loop.q[1:], apply(K, loop.q[1:])), loop.q[1:], 3)
    axes, outside = list[Axis](), [numbers[f"outside.{i}"] if loop.outside else Fraction(0) for i in AXES]
    for i in AXES:
        axes.append(taken_apart(loop, i, moved[i], s[i]))
        yield f"reach {i}", Exceeds(axes[i].reach, outside[i])
    layered = any(axis.slope is not None for axis in axes)
    squares, ending = Fraction(0), "slides to rest on target, on either quaternion"
    if layered and any(outside):
        squares = yield from losses(loop, axes, outside)
        ending = yield from ending_in_the_layer(loop, squares, K)
    said, begun = "approaches" if layered else "reaches in a finite time", "every attitude and rate"
    signed = bool(claim.taken.get(SHORTEST) or claim.taken.get(HYSTERESIS))
    if signed:
        # At q0 = 0 q0' = (q.Kq - s.q)/2 > 0 while |s| < k, and low |s|^2 <= s.Js.
        level, low, k = numbers["level"], numbers["inertia.low"], numbers["surface.low"]
        yield from bounded(loop, K)
        yield (
            "the sign never changes",
            Exceeds(low * k * k, max(2 * level, numbers["inertia.high"] * squares if squares else 0)),
        )
        held = yield from contents(loop, dot(s, apply(loop.J, s)) * Fraction(1, 2))
        begun = " ".join([f"{{s.Js/2 <= {below(level)}}}", *(f"({part})" for part in held)])
    text = f"from {begun} the motion {said} the law's surface and {ending}"
    torque = "bounded-outside-torque" if loop.outside else "no-outside-torque"
    target = "known-target" if loop.moving else "target-at-rest"
    assumptions = ("rigid-body", "inertia-as-given", "exact-measurement", "ideal-actuators", "continuous-torque")
    demand(not loop.wheels, "no law of this kind is taken with wheels")
    return Statement(
        text,
        (*assumptions, "unlimited-torque", torque, target, "no-wheels", "sign-at-once" if signed else "quaternion-as-fed"),
        "sliding",
    )


def declared(loop: AttitudeLoop) -> Generator[tuple[str, Obligation], None, tuple[list[Poly], Rows, list[Poly]]]:
    """Show that the law's surface is s = w + Kq, and return s, K, and J s' less the torques of the law and from outside."""
    yield from loop.sound()
    s = [single(cases) for cases in loop.read("surface", 3, loop.told)]
    K = slopes(s, "q", {})
    for k, (p, row) in enumerate(zip(s, K, strict=True)):
        yield f"surface {k}", Vanishes(p - loop.w[k] - dot(row, loop.q[1:]))
    # J s' = J w' + J K q'.
    without = zip(loop.balance([Poly({})] * 3), loop.e, apply(loop.J, apply(K, loop.turning[1:])), strict=True)
    return s, K, [own - e + turned for own, e, turned in without]


def taken_apart(loop: AttitudeLoop, i: int, moved: Poly, s: Poly) -> Axis:
    """Return the axis: in each case of the law (J s')_i - e_i is a number against the sign of s_i, or -slope s_i."""
    reaches, linear = list[Fraction](), list[Fraction]()
    for case in loop.law[i]:
        found = case.value + moved
        sides = [sign for sign in (1, -1) if on_side(case, sign * s)]
        if len(sides) == 1 and not found.names:
            reaches.append(-sides[0] * found.number)
        elif not on_surface(case, s):
            slope = -found.slope(f"w{i + 1}").number
            demand(not (found + slope * s).terms and slope > 0, "the law is neither a switch nor a layer about its surface")
            linear.append(slope)
    demand(bool(reaches), "the law does not switch")
    return Axis(min(reaches), min(linear) if linear else None)


def on_side(case: Case, s: Poly) -> bool:
    """Tell whether a case says that s > c with a c that is not negative."""
    found = (multiple(Poly(dict(p)), s) for p, truth in case.guards if truth)
    return any(factor > 0 and offset <= 0 for factor, offset in found)


def on_surface(case: Case, s: Poly) -> bool:
    """Tell whether a case is about s = 0 alone."""
    found = [multiple(Poly(dict(p)), s) for p, truth in case.guards if not truth]
    return all(any(sign * factor > 0 and offset == 0 for factor, offset in found) for sign in (1, -1))


def losses(
    loop: AttitudeLoop, axes: list[Axis], outside: list[Fraction]
) -> Generator[tuple[str, Obligation], None, Fraction]:
    """Show that s.Js/2 falls outside of the box |s_i| <= far_i, and return the sum of far_i^2."""
    total, squares = Fraction(0), Fraction(0)
    for axis, m in zip(axes, outside, strict=True):
        total += m * m / (4 * axis.slope) if axis.slope is not None else 0
    for i, (axis, m) in enumerate(zip(axes, outside, strict=True)):
        far = loop.claim.numbers[f"far.{i}"]
        yield f"beyond the layer {i}", Exceeds((axis.reach - m) * far, total)
        if axis.slope is not None:
            yield f"in the layer {i}", Exceeds(axis.slope * far * far - m * far, total)
        squares += far * far
    return squares


def bounded(loop: AttitudeLoop, K: Rows) -> Shown:
    """low |x|^2 <= x.Jx, and k |x|^2 <= x.Kx."""
    low, k = loop.claim.numbers["inertia.low"], loop.claim.numbers["surface.low"]
    J: Rows = [[poly(x).number for x in row] for row in loop.J]
    yield "least moment", Definite(plus(J, scalar(1), -low))
    yield "least slope", Definite(plus([[x / 2 for x in row] for row in plus(K, transpose(K))], scalar(1), -k))


def ending_in_the_layer(loop: AttitudeLoop, squares: Fraction, K: Rows) -> Generator[tuple[str, Obligation], None, str]:
    """Show where motions end in a boundary layer."""
    numbers = loop.claim.numbers
    low, high, k, steep = (numbers[name] for name in ("inertia.low", "inertia.high", "surface.low", "surface.high"))
    size, angle, rate = numbers["surface"], numbers["end.angle"], numbers["end.rate"]
    demand(angle < 3, "an angle is too large")
    yield from bounded(loop, K)
    J: Rows = [[poly(x).number for x in row] for row in loop.J]
    yield "largest moment", Definite(plus(scalar(high), J, -1))
    yield "largest slope", Definite(plus(scalar(steep * steep), times(transpose(K), K), -1))
    yield "surface", Exceeds(size * size * low, high * squares)
    # sin^2 = 1 - cos^2 from below, as cos x <= 1 - x^2/2 + x^4/24.
    half = angle * angle / 4
    cosine = 1 - half / 2 + half * half / 24
    yield "cosine", Exceeds(cosine)
    yield "angle", Exceeds((1 - cosine * cosine) * k * k, size * size)
    yield "less than a half turn", Exceeds(k, size)
    yield "rate", Exceeds(rate, size + steep * size / k)
    return f"ends turned by no more than {above(angle)} rad at no more than {above(rate)} rad/s"
