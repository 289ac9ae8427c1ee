"""Loops that follow a circle round a libration point, for the tests of their certificates."""

import json
import math

from starhold.algebra.vector import ZERO
from starhold.certification.station import described_station
from starhold.checker.station import read_station
from starhold.laws import l2_circle
from starhold.laws.catalogue import catalogue
from starhold.parts.bodies.libration_point import PRIMARIES, PointState, make_libration
from tests.making import point_loop

EARTH = PRIMARIES["sun-earth"]
PLANT = make_libration(EARTH.larger, EARTH.smaller, EARTH.separation)
BEST = l2_circle.design(PLANT, l2_circle.Best(1.0))
RELAY = BEST._replace(feedback=1, k=0.3)
SOFT = RELAY._replace(boundary_layer=0.1)
WIDE = BEST._replace(alpha=3.0, k=0.2, radius=2.0)
BACK = BEST._replace(rate=-2.0, radius=5.0)


def loop_of(gains=BEST, limit=math.inf, kind="norm", plant=PLANT, **changes):
    start = PointState((0.0, gains.radius, 0.0), (0.0, 0.0, gains.rate * gains.radius), ZERO)
    return point_loop(
        plant, catalogue("libration-point")["l2-circle"], gains, start, 1e-3, limit=limit, kind=kind, **changes
    )


def peak(gains, kind="norm", plant=PLANT):
    """What the circle itself needs."""
    y = abs(plant.stiffness - 1.0 - gains.rate**2)
    x, z = 2.0 * abs(gains.rate), abs(plant.stiffness - gains.rate**2)
    return gains.radius * (max(x, y, z) if kind == "axis" else max(math.hypot(x, z), y))


def station(gains=BEST, limit=math.inf, kind="norm", **changes):
    """What the checker reads of such a loop."""
    return read_station(json.loads(json.dumps(described_station(loop_of(gains, limit, kind, **changes)))))
