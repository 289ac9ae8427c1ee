"""The surface s = w + Kq of a sliding-mode law and its switching torque, taken from its equations."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, cast

from flint import fmpq

from starhold.algebra.polynomial import Polynomial, jointly, pieces
from starhold.certification.matrices import Rows
from starhold.certification.motion import AXES, RATE, Motion, Truths
from starhold.certification.subject import as_tuple


@dataclass(frozen=True)
class Surface:
    """s = w + Kq with J s' = (torque from outside) - T; T_i is `reach` with the sign of s_i, within |s_i| <= layer
    proportional to it."""

    K: Rows
    reach: list[Any]
    layer: Any


def take_surface(motion: Motion) -> Surface:
    """The surface and the switching torque; ArithmeticError where they are not of that form."""
    plain: list[Polynomial] = list(motion.subject.law.module.surface(motion.measurement, motion.gains))
    K = [[component.terms.get((name,), fmpq(0)) for name in AXES] for component in plain]
    for component, axis in zip(plain, RATE, strict=True):
        if (component.only(lambda m: not (len(m) == 1 and m[0] in AXES)) - Polynomial.variable(axis)).terms:
            raise ArithmeticError(f"the surface is not w + Kq: {component}")
    J = as_tuple(motion.subject.inertia)
    slopes = [motion.along(component) for component in plain]
    momentum = [row[0] * slopes[0] + row[1] * slopes[1] + row[2] * slopes[2] for row in J]  # type: ignore[index]
    reach: list[Any] = [fmpq(0)] * 3
    slopes_in_layer: list[Any] = [None] * 3
    for truths, parts in jointly(cast(Any, momentum)):
        for i, part in enumerate(parts):
            outside = Polynomial.variable(f"e{i + 1}") + Polynomial.variable(f"m{i + 1}")
            switched = outside - part
            value = switched.value
            if value is not None and value != 0:
                if not _side(truths, plain[i], value > 0):
                    raise ArithmeticError(f"axis {i + 1} does not switch with the sign of its surface")
                reach[i] = max(reach[i], abs(value))
                continue
            slope = switched.terms.get((RATE[i],), fmpq(0))
            if (switched - slope * plain[i]).terms or slope <= 0:
                raise ArithmeticError(f"J s' has the terms {switched}")
            slopes_in_layer[i] = slope
    if any(g == 0 for g in reach):
        raise ArithmeticError("an axis does not switch")
    layers = [_layer(motion, i, slope, g, plain[i]) for i, (slope, g) in enumerate(zip(slopes_in_layer, reach, strict=True))]
    return Surface(K, reach, max(layers))


def _side(truths: Truths, s: Polynomial, positive: bool) -> bool:
    """Whether the conditions say that s > c or s < -c for a c that is not negative."""
    for condition, truth in truths:
        if not truth:
            continue
        factor, offset = _along(condition.positive, s)
        if offset is not None and offset <= 0 and factor != 0 and (factor > 0) == positive:
            return True
    return False


def _along(polynomial: Polynomial, s: Polynomial) -> tuple[Any, Any | None]:
    """The factor and offset with which a polynomial is factor s + offset; None for an offset that is not constant."""
    first, c = next(iter(s.terms.items()))
    factor = polynomial.terms.get(first, fmpq(0)) / c
    return factor, (polynomial - factor * s).value


def _layer(motion: Motion, axis: int, slope: Any, reach: Any, s: Polynomial) -> Any:
    """The thickness at which the torque within the layer meets that outside; zero where it switches by sign."""
    thickness = reach / slope
    for case in pieces(motion.torque[axis]):
        for condition, _ in case.truths:
            factor, offset = _along(condition.positive, s)
            if offset == 0:
                return fmpq(0)
            if factor != 0 and offset is not None and abs(offset / factor) == thickness:
                return thickness
    raise ArithmeticError("the boundary layer is not where its torque meets the switching torque")
