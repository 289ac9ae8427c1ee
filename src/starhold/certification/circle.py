"""Claims about the circle that the law `l2-circle` makes attractive, read off the law's and the model's own equations.

With f1 = y^2 + z^2 - radius^2, f2 = y' + rate z, f3 = z' - rate y and V = (alpha f1^2 + f2^2 + f3^2)/2 the law's neutral
control keeps V, and what it takes off is k (f2, f3), or of a relay k (f2, f3)/max(|(f2, f3)|, layer); so V' <= 0, and
V' = 0 only where f2 = f3 = 0. There f2' = -2 alpha f1 y and f3' = -2 alpha f1 z: a motion that stays there has f1 = 0, which
is the circle, or y = z = 0, where V = alpha radius^4/2. Along X the motion is linear and on its own. In the full problem a
level below that also keeps the motion off the bodies, which lie at y = z = 0.

A relay without a layer is a set of controls where f2 = f3 = 0, all of norm up to k. It holds every circle with
2 alpha |f1| r <= k: V stays there, and the circle attracts nothing but the band around it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.intervals import Intervals
from starhold.algebra.polynomial import Polynomial, constants, exact
from starhold.algebra.vector import add
from starhold.certification.boxes import Sides, holds_on
from starhold.certification.certificate import BALLS, EXACT, EXACT_SIGN, LASALLE, Claim
from starhold.certification.convergence import ALMOST, Obligations
from starhold.certification.matrices import number, root_float
from starhold.certification.station_terms import UNLIMITED, assumed, mismatch, point_measurement
from starhold.certification.subject import above, below, enclosed
from starhold.laws import l2_circle as law
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.bodies.libration_point import linear

IN_PLANE = "starts in the plane x = 0 without a rate along X"
MOST = 400_000
TOO_NEAR = "a relay without a layer holds other circles, but no float tells one from this one"
LESS = (1e-2, 0.03, 0.1, 0.2, 0.4, 0.7)
"""How far below the level that points of a grid suggest a proof is tried."""


@dataclass(frozen=True)
class CircleNumbers:
    """The numbers of the law and the plant, exact."""

    plant: Any
    gains: Any

    @property
    def centre(self) -> Any:
        """V at rest in the middle of the circle."""
        return self.gains.alpha * self.gains.radius**4 / 2


def _numbers(loop: ClosedLoop) -> CircleNumbers:
    return CircleNumbers(*(type(values)(*map(exact, values)) for values in (loop.craft, loop.gains)))


def attracts(loop: ClosedLoop) -> Claim:
    """That all motions from {V <= level} end on the circle."""
    found, told, circle = Obligations(), dict[str, Any](), _numbers(loop)

    def finish() -> Claim:
        return Claim("circle", told, {}, assumed(loop, UNLIMITED), tuple(found))

    reason = mismatch(loop)
    if reason:
        found.add("form", EXACT, None, {"reason": reason})
        return finish()
    if not _is_neutral(circle):
        found.add("form", EXACT, None, {"reason": "V is not kept by the law's neutral control"})
        return finish()
    found.add("form", EXACT, True)
    g = circle.gains
    if g.feedback == 1 and g.boundary_layer == 0:
        held = _held_circle(circle)
        apart = held["radius"] != number(g.radius) and 0.0 < held["needs"] <= number(g.k)
        found.add("only the circle", LASALLE, False if apart else None, held if apart else {"reason": TOO_NEAR})
        return finish()
    found.add("descent", EXACT_SIGN, g.k > 0)
    found.add("only the circle", LASALLE, g.rate != 0 or None, {} if g.rate != 0 else {"reason": "the rate is zero"})
    level = below(circle.centre * ALMOST)
    below_it = 0 < exact(level) < circle.centre
    found.add(
        "centre outside", EXACT_SIGN, below_it or None, {} if below_it else {"reason": "no float is between V and zero"}
    )
    steep = circle.plant.rate**2 + 2 * circle.plant.stiffness
    found.add("x returns", EXACT_SIGN, g.k_x > steep and g.k_velocity > 0)
    told.update(_told(circle, level))
    return finish()


def control_limit(loop: ClosedLoop) -> Claim:
    """That the control stays within its limit on motions from a smaller set, in the plane x = 0."""
    found, circle = Obligations(), _numbers(loop)
    told: dict[str, Any] = {"limit": loop.saturation_limit(), "kind": loop.limit}

    def finish() -> Claim:
        return Claim("control-limit", told, {}, assumed(loop, IN_PLANE), tuple(found))

    if loop.gains.model:
        found.add("control", BALLS, None, {"reason": "only for a law that undoes the linear model alone"})
        return finish()
    asked = _on_circle(circle, loop.limit)
    if asked[0] > exact(loop.saturation_limit()) ** 2 * (1 + exact(1e-12)):
        found.add("control", BALLS, False, {"control": math.sqrt(number(asked[0])), "angle": asked[1]})
        return finish()
    demand = _Demand(circle, loop.saturation_limit(), loop.limit)
    guess = demand.guess()
    for level in (guess * (1.0 - less) for less in LESS):
        if level > 0.0 and demand.within(level):
            for name, how in (("form", EXACT), ("descent", EXACT_SIGN), ("only the circle", LASALLE)):
                found.add(name, how, True)
            found.add("centre outside", EXACT_SIGN, True)
            found.add("control", BALLS, True)
            told.update(_told(circle, level))
            return finish()
    found.add("control", BALLS, None, {"reason": "no level is small enough"})
    return finish()


def _told(circle: CircleNumbers, level: float) -> dict[str, Any]:
    """The level; the radii between which all circles at the right rate are in its set, and the largest velocity error on
    the circle, all rounded inward."""
    square, reach = circle.gains.radius**2, root_float(2 * exact(level) / circle.gains.alpha)
    inner, outer = square - exact(reach), square + exact(reach)
    return {
        "level": level,
        "inner": root_float(inner, up=True) if inner > 0 else 0.0,
        "outer": root_float(outer),
        "velocity": root_float(2 * exact(level)),
    }


def _is_neutral(circle: CircleNumbers) -> bool:
    """Whether, along the linear model under the neutral control, V' = 0, f2' = -2 alpha f1 y, f3' = -2 alpha f1 z, and x''
    is a linear function of x and x' alone with the coefficients of the feedback."""
    measurement, plant, gains = point_measurement(), constants(circle.plant), constants(circle.gains)
    acceleration: Any = add(
        linear(measurement.position, measurement.velocity, plant), law.neutral(measurement, gains, plant)
    )
    names = [f"x{i}" for i in (1, 2, 3)], [f"v{i}" for i in (1, 2, 3)]
    rates = dict(zip((*names[0], *names[1]), (*measurement.velocity, *acceleration), strict=True))

    def along(function: Any) -> Polynomial:
        total: Any = Polynomial.constant(0)
        for name, rate in rates.items():
            total = total + function.slope(name) * rate
        return total

    f1, f2, f3 = law.errors(measurement, gains)
    y, z = measurement.position[1], measurement.position[2]
    pulled = 2 * gains.alpha * f1
    steep = circle.plant.rate**2 + 2 * circle.plant.stiffness
    x = (steep - circle.gains.k_x) * measurement.position[0] - circle.gains.k_velocity * measurement.velocity[0]
    parts = (
        along(law.lyapunov(measurement, gains, plant)),
        along(f2) + pulled * y,
        along(f3) + pulled * z,
        acceleration[0] - x,
    )
    return not any(part.terms for part in parts)


def _held_circle(circle: CircleNumbers) -> dict[str, Any]:
    """Another circle that a relay without a layer holds, and how much of the relay that takes."""
    g = circle.gains
    # Half of what the relay could hold near the circle, where f1 is 2 radius (r - radius).
    radius = number(g.radius)
    r = radius + min(0.1 * radius, number(g.k) / (8.0 * number(g.alpha) * radius * radius))
    held = 2 * g.alpha * (exact(r) ** 2 - g.radius**2) * exact(r)
    return {"radius": r, "needs": number(held), "of": number(g.k)}


def _on_circle(circle: CircleNumbers, kind: str) -> tuple[Any, float]:
    """The largest square of the control on the circle itself, of its norm or of an axis, and at which angle from Y."""
    p, g = circle.plant, circle.gains
    x = 2 * p.rate * g.rate * g.radius
    y = (p.stiffness - p.rate**2 - g.rate**2) * g.radius
    z = (p.stiffness - g.rate**2) * g.radius
    if kind == "axis":
        return max((x * x, 0.5 * math.pi), (y * y, 0.0), (z * z, 0.5 * math.pi), key=lambda item: item[0])
    return max((x * x + z * z, 0.5 * math.pi), (y * y, 0.0), key=lambda item: item[0])


@dataclass(frozen=True)
class _Demand:
    """The control on the plane x = 0, x' = 0 as a function of y, f1, f2, f3 and the sign of z."""

    circle: CircleNumbers
    limit: float
    kind: str

    def within(self, level: float) -> bool:
        """Whether the control is shown to be within its limit wherever V <= level."""
        top = math.nextafter(level, math.inf)
        error = math.sqrt(2.0 * top) * (1.0 + 1e-12)
        off = error / math.sqrt(below(self.circle.gains.alpha)) * (1.0 + 1e-12)
        width = math.sqrt(above(self.circle.gains.radius) ** 2 + off) * (1.0 + 1e-12)

        def shown(sides: Sides, sign: float) -> NDArray[np.bool_]:
            v, most, nowhere = self._at(sides, sign)
            return nowhere | (v.low > top) | (most.high <= self.limit * self.limit * (1.0 - 1e-15))

        # The control only changes its sign where y, z, f2 and f3 all do, so that y >= 0 is enough.
        box = ((0.0, width), (-off, off), (-error, error), (-error, error))
        return all(holds_on(box, lambda sides, sign=sign: shown(sides, sign), MOST, first=6) for sign in (1.0, -1.0))

    def guess(self) -> float:
        """The largest level on whose surface points of a grid need no more than the limit, up to the centre's."""
        s, turn, angle = np.meshgrid(np.linspace(-1.0, 1.0, 13), *(np.linspace(0.0, 2.0 * np.pi, 49)[:-1],) * 2)
        s, turn, angle = s.ravel(), turn.ravel(), angle.ravel()
        low, high = 0.0, below(self.circle.centre * ALMOST)
        for step in range(24):
            level = high if step == 0 else 0.5 * (low + high)
            f1 = s * math.sqrt(2.0 * level / number(self.circle.gains.alpha))
            error = np.sqrt(2.0 * level * (1.0 - s * s))
            y = np.sqrt(np.maximum(number(self.circle.gains.radius) ** 2 + f1, 0.0)) * np.cos(turn)
            points = tuple(Intervals(side) for side in (y, f1, error * np.cos(angle), error * np.sin(angle)))
            within = all((self._at(points, sign)[1].low <= self.limit * self.limit).all() for sign in (1.0, -1.0))
            if within and step == 0:
                return level
            low, high = (level, high) if within else (low, level)
        return low

    def _at(self, sides: Sides, sign: float) -> tuple[Intervals, Intervals, NDArray[np.bool_]]:
        """V, the square of the control's norm or largest axis, and whether there is no such place."""
        y, f1, f2, f3 = sides
        p, g = (type(values)(*map(enclosed, values)) for values in (self.circle.plant, self.circle.gains))
        square = g.radius.square() + f1 - y.square()
        z = sign * square.sqrt()
        wrong = f2.square() + f3.square()
        share = g.k
        if self.circle.gains.feedback == 1:
            length = wrong.sqrt()
            share = g.k / Intervals(
                np.maximum(length.low, g.boundary_layer.low), np.maximum(length.high, g.boundary_layer.high)
            )
        across, up, pull = f2 - g.rate * z, f3 + g.rate * y, 2.0 * g.alpha * f1
        u = (
            -2.0 * p.rate * across,
            (p.stiffness - p.rate.square() - pull) * y - g.rate * up - share * f2,
            (p.stiffness - pull) * z + g.rate * across - share * f3,
        )
        v = 0.5 * (g.alpha * f1.square() + wrong)
        x2, y2, z2 = (part.square() for part in u)
        if self.kind == "norm":
            return v, x2 + y2 + z2, square.high < 0.0
        low, high = (np.maximum(np.maximum(a, b), c) for a, b, c in ((x2.low, y2.low, z2.low), (x2.high, y2.high, z2.high)))
        return v, Intervals(low, high), square.high < 0.0
