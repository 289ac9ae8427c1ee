"""Loops that hold a craft at an equilibrium beside a libration point, for the tests of their certificates."""

import json
import math

from starhold.algebra.vector import ZERO
from starhold.certification.station import described_station
from starhold.checker.station import read_station
from starhold.laws import l2_equilibrium
from starhold.laws.catalogue import catalogue
from starhold.parts.bodies.libration_point import PRIMARIES, PointState, make_libration
from tests.making import point_loop

EARTH = PRIMARIES["sun-earth"]
PLANT = make_libration(EARTH.larger, EARTH.smaller, EARTH.separation)
GAINS = l2_equilibrium.design(PLANT, l2_equilibrium.Degree(y=1.0, z=-0.5))
STEEP = 1.0 + 2.0 * PLANT.stiffness
STEEPNESS = math.sqrt(STEEP)
STRONG = GAINS._replace(k_x=6.0 * STEEP, k_velocity=(6.0 * STEEPNESS, 1.0, 1.0))
WEAK = GAINS._replace(k_x=1.2 * STEEP, k_velocity=(1.2 * STEEPNESS, 1.0, 1.0))
OFF = GAINS._replace(k_x=GAINS.k_x * (1.0 + 1e-8))


def loop_of(gains=GAINS, limit=math.inf, kind="axis", plant=PLANT, **changes):
    start = PointState((0.0, gains.y, gains.z), ZERO, ZERO)
    return point_loop(
        plant, catalogue("libration-point")["l2-equilibrium"], gains, start, 1e-3, limit=limit, kind=kind, **changes
    )


def station(gains=GAINS, limit=math.inf, kind="axis", **changes):
    """What the checker reads of such a loop."""
    return read_station(json.loads(json.dumps(described_station(loop_of(gains, limit, kind, **changes)))))
