"""The J2 acceleration of an oblate Earth, which turns the plane of an orbit and its perigee."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from starhold.algebra.scalar import Scalar
from starhold.algebra.vector import Vector, scale
from starhold.parts.contract import Card, Parameter
from starhold.parts.craft import Craft
from starhold.parts.environments.two_body import attraction
from starhold.parts.orbit import BODIES

CARD = Card(
    title="Oblateness",
    summary="r'' = -3/2 J2 mu R^2/r^5 ((1 - 5 z^2/r^2) r + 2 z e_z), beside the point mass",
    sources=("Fundamentals of Astrodynamics and Applications (2013)",),
    assumptions=("the third inertial axis is that of the flattened body", "no harmonics of the field beyond the second"),
)
ROLE = "environment"
NEEDS = ("two-body",)


class Params(NamedTuple):
    """The oblateness of the central body; the Earth's by default."""

    j2: Annotated[float, Parameter("1", text="second zonal harmonic, not normalised")] = 1.08262668e-3
    radius: Annotated[float, Parameter("m", above=0.0, text="equatorial radius to which J2 refers")] = BODIES["Earth"].radius


def acceleration(state: Any, params: Params, craft: Craft, memory: Any) -> Vector:
    """Return the acceleration of the centre of mass in addition to that of a point mass (inertial, m/s2)."""
    n2, inverse_square = attraction(state.position, craft)
    size: Scalar = 1.5 * params.j2 * params.radius * params.radius * (n2 * inverse_square)
    x, y, z = scale(size, state.position)
    slope = 5.0 * (state.position[2] * state.position[2]) * inverse_square
    return (x * (slope - 1.0), y * (slope - 1.0), z * (slope - 3.0))


def perturbation(params: Params, craft: Craft, distance: float) -> tuple[float, float]:
    """Return the largest acceleration (m/s2) and gradient (1/s2) of it from a distance (m) on: both above the poles."""
    size = params.j2 * craft.gravity * (params.radius / distance) ** 2 / distance**2
    return 3.0 * abs(size), 12.0 * abs(size) / distance


def examples() -> list[Params]:
    """Return the Earth, and Mars."""
    return [Params(), Params(1.96045e-3, BODIES["Mars"].radius)]
