"""Forces that move the orbit: the parameters that parts declare for them, and shared functions."""

from __future__ import annotations

import math
from typing import Any

from starhold.parts.contract import Parameter

MOVES = Parameter(choices=("no", "yes"), text="whether its force moves the orbit as well")
"""The declaration of the choice, common to all parts with a force, which name the parameter `moves_orbit`."""
MASS = Parameter(
    "kg",
    above=0.0,
    text="of the spacecraft, for forces that move the orbit; scenarios give it by mass in [spacecraft]",
    shared="spacecraft.mass",
)
"""The declaration of the mass, common to all parts; a scenario gives it to all of them."""


def inverse_mass(moves_orbit: int, mass: float) -> Any:
    """Return one over the mass (1/kg) for a part that moves the orbit, else None. Raise ValueError without a mass."""
    if isinstance(mass, float) and math.isinf(mass) and moves_orbit:
        raise ValueError("a force that moves the orbit needs the spacecraft's mass: mass in [spacecraft]")
    return 1.0 / mass if moves_orbit else None


def moves(params: Any) -> bool:
    """Return whether a part with these parameters moves the orbit by its force."""
    return bool(getattr(params, "moves_orbit", 0))
