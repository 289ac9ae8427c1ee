"""Orbits around the flattened Earth."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np

from starhold.parts.catalogue import fit
from starhold.parts.environments import oblateness
from starhold.parts.orbit import BODIES, Elements, from_elements
from tests.making import ORBIT as GRAVITY
from tests.making import ORBITAL, hub

MU = BODIES["Earth"].gravity
FLATTENED = fit("environment", "oblateness")


def flattened(eccentricity, inclination, perigee, *parts, period=10.0):
    """A body on an orbit around the flattened Earth."""
    size = 6.878e6 / (1.0 - eccentricity)
    position, velocity = from_elements(Elements(size, eccentricity, inclination, 0.3, perigee, 0.7), MU)
    loop = hub(*GRAVITY, FLATTENED, ORBITAL, *parts, rate=(0.0, 0.0, 0.0), period=period, command_limit=0.0)
    return replace(loop, start=loop.start._replace(position=position, velocity=velocity))


def pull(loop, place):
    """The acceleration (m/s2) at a place."""
    state = SimpleNamespace(position=tuple(place))
    near = np.array(place) * -MU / np.linalg.norm(place) ** 3
    return near + oblateness.acceleration(state, FLATTENED.params, loop.craft, ())
