"""The loop of a law that makes a circle attractive, read off the law's and the model's equations.

Variables: x1..x3 position, v1..v3 velocity, t2 and t3 what the damping takes off the control. What the damping is needs a
square root, which polynomials have not: there the equations are read in symbols, for all numbers at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

from flint import arb

from starhold.algebra.polynomial import Polynomial, constants
from starhold.algebra.symbolic import sympy
from starhold.algebra.vector import add, subtract
from starhold.checker.exact import ZERO, Dual, demand, dual, floating, rational, up
from starhold.checker.subject import named, variables
from starhold.checker.symbols import expanded, in_symbols, positive
from starhold.laws.catalogue import Law
from starhold.laws.point import PointMeasurement
from starhold.parts.bodies.libration_point import Libration, linear

TAKEN = ("t2", "t3")


@dataclass(frozen=True)
class CircleLoop:
    """Law, gains, plant and motion of a loop, all numbers exact."""

    law: Law
    gains: Any
    plant: Libration
    full: bool

    @cached_property
    def measurement(self) -> PointMeasurement:
        """The measurement that the law gets, of which it must not read the period and the limit."""
        return PointMeasurement(variables(named("x")), variables(named("v")), *variables(("period", "limit")))

    @cached_property
    def neutral(self) -> Any:
        """The control that keeps V, as polynomials."""
        return self.law.module.neutral(self.measurement, constants(self.gains), constants(self.plant))

    @cached_property
    def moving(self) -> PointMeasurement:
        """Position and velocity with their derivatives under the neutral control without what is taken off."""
        measurement = self.measurement
        taken: Any = (Polynomial({}), *variables(TAKEN))
        pull = linear(measurement.position, measurement.velocity, constants(self.plant))
        swing = subtract(add(pull, self.neutral), taken)
        position, velocity = (
            tuple(Dual(x, rate) for x, rate in zip(values, rates, strict=True))
            for values, rates in ((measurement.position, measurement.velocity), (measurement.velocity, swing))
        )
        return PointMeasurement(position, velocity, *dual(measurement[2:]))  # pyright: ignore

    @cached_property
    def lyapunov(self) -> Dual:
        """V and its derivative, in what is taken off too."""
        found: Any = self.law.lyapunov
        demand(found is not None, "the law declares no V")
        return found(self.moving, dual(self.gains), dual(self.plant))

    @cached_property
    def errors(self) -> tuple[Any, Any, Any]:
        """f1, f2 and f3 with their derivatives, as the certificate's reader is told of them."""
        y, z = self.moving.position[1:]
        v, w = self.moving.velocity[1:]
        radius, rate = dual(self.gains.radius), dual(self.gains.rate)
        return y * y + z * z - radius * radius, v + rate * z, w - rate * y  # pyright: ignore

    @cached_property
    def across(self) -> tuple[Any, Any]:
        """The coefficients of position and velocity along X that pull x back; x'' must depend on nothing else."""
        swing: Any = self.moving.velocity[0]
        demand(set(swing.slope.terms) <= {("x1",), ("v1",)}, "the motion along X depends on the other axes")
        return -swing.slope.terms.get(("x1",), ZERO), -swing.slope.terms.get(("v1",), ZERO)

    def form(self) -> str:
        """V, its derivative and those of f2 and f3 are as the argument needs them, for the motion that is flown."""
        demand(not self.full or self.gains.model == 1, "the law undoes the linear model, and the full problem is flown")
        demand(self.full or self.gains.model == 0, "the law undoes what the linear model does not have")
        f1, f2, f3 = self.errors
        y, z = self.measurement.position[1:]
        t2, t3 = variables(TAKEN)
        pull: Any = 2 * self.gains.alpha * f1.value
        V = (self.gains.alpha * f1.value * f1.value + f2.value * f2.value + f3.value * f3.value) / 2
        _same(self.lyapunov.value, V, "V is not (alpha f1^2 + f2^2 + f3^2)/2")
        _same(self.lyapunov.slope, -t2 * f2.value - t3 * f3.value, "the neutral control does not keep V")
        _same(f2.slope, -pull * y - t2, "f2 changes in another way")
        _same(f3.slope, -pull * z - t3, "f3 changes in another way")
        self.across  # noqa: B018
        relay, layered = self.gains.feedback == 1, self.gains.boundary_layer > 0
        demand(_flies(self.law.module, relay, layered, self.full), "the law damps in another way")
        return "the acceleration flown is the linear one, the neutral control and the damping"

    def descent(self) -> str:
        """The damping is a positive multiple of (f2, f3)."""
        demand(self.gains.k > 0, "the damping is not positive")
        return "V' = -(f2, f3).(t2, t3), and t is a positive multiple of f"

    def only(self) -> str:
        """Motions with V' = 0 for all time are on the circle or at rest in its middle: where f2 = f3 = 0 and so t2 = t3 = 0,
        `form` has left f1 y = f1 z = 0."""
        gains = self.gains
        demand(not self.bare, "a relay without a layer holds other circles")
        demand(gains.rate != 0, "the circle is not run through")
        return "V' = 0 for all time leaves f1 y = f1 z = 0"

    def centre_outside(self, level: Any) -> str:
        """Rest in the middle is outside; then y^2 + z^2 > 0 wherever V <= level, so that no motion meets a body either."""
        gains = self.gains
        demand(level > 0, "the level is not positive")
        demand(2 * level < gains.alpha * gains.radius**4, "the centre is in the level set")
        return "V at rest in the middle is above the level"

    def returns(self) -> str:
        """Both coefficients of the motion along X pull it back."""
        position, velocity = self.across
        demand(position > 0 and velocity > 0, "x does not return")
        return "x'' pulls back and damps"

    @property
    def bare(self) -> bool:
        """Whether the feedback is a relay without a layer."""
        return self.gains.feedback == 1 and self.gains.boundary_layer == 0

    def on_it(self, angle: Any) -> dict[str, Any]:
        """A state on the circle near an angle from Y, at which all is rational: by the tangent of half of it, of which none
        is large."""
        turns = round(floating(angle) / floating(up(arb.pi())))
        half = rational(floating(up(((arb(angle) - turns * arb.pi()) / 2).tan())))
        side = -1 if turns % 2 else 1
        y, z = (side * self.gains.radius * part / (1 + half**2) for part in (1 - half**2, 2 * half))
        state = (ZERO, y, z, ZERO, -self.gains.rate * z, self.gains.rate * y)
        return dict(zip((*named("x"), *named("v")), state, strict=True))


def _same(one: Any, other: Any, otherwise: str) -> None:
    demand(not (one - other).terms, otherwise)


# --- in symbols -------------------------------------------------------------------------------------------------------


@cache
def _flies(law: Any, relay: bool, layered: bool, full: bool) -> bool:
    """Whether the acceleration that is flown, of model and command, is the linear one with the neutral control less
    share (0, f2, f3): share is k, of a relay k over |(f2, f3)| or over the layer if that is more. For all states and all
    numbers of the loop, as those are symbols; the feed-forward is that of the motion.
    """
    if not relay:
        return _agrees(law, None, None, full)
    if not layered:
        # At f2 = f3 = 0 a relay has no direction.
        return _agrees(law, positive("n"), sympy.Integer(0), full)
    small, more, least = positive("m"), positive("p"), sympy.Symbol("n", nonnegative=True)
    # |(f2, f3)| beyond the layer, as large, and within.
    return all(_agrees(law, n, layer, full) for n, layer in ((small + more, small), (small, small), (least, least + more)))


def _agrees(law: Any, size: Any, layer: Any, full: bool) -> bool:
    """Whether `_flies` holds where |(f2, f3)| is `size` and the layer is `layer`, in symbols of known sign; without a size
    for smooth feedback, whatever the layer."""
    relay = size is not None
    told = {"feedback": int(relay), "model": int(full), **({"boundary_layer": layer} if relay else {})}
    loop = in_symbols(law, told)
    gains, measurement, velocity = loop.gains, loop.measurement, loop.measurement.velocity
    wrong = (velocity[1] + gains.rate * measurement.position[2], velocity[2] - gains.rate * measurement.position[1])
    share = gains.k if not relay else gains.k / (size if layer == 0 or (size - layer).is_positive else layer)
    flown, meant = loop.flown(law, full), add(loop.natural, law.neutral(measurement, gains, loop.plant))
    damping: Sequence[Any] = (sympy.Integer(0), share * wrong[0], share * wrong[1])
    for have, want, taken in zip(flown, meant, damping, strict=True):
        left = have - want + taken
        if relay:
            left = left.subs(wrong[0] ** 2 + wrong[1] ** 2, size**2)
        if expanded(left) != 0:
            return False
    return True
