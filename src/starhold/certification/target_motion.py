"""Bounds of the motion of a loop's target, as its part declares them on the orbit of the loop."""

from __future__ import annotations

from math import inf, isfinite

from flint import arb

from starhold.algebra.polynomial import exact
from starhold.algebra.vector import ZERO, cross, unit
from starhold.certification.matrices import above, upper
from starhold.certification.orbit_band import band_of, extremes
from starhold.errors import InputError
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.contract import Motion, Orbit

NOWHERE = Orbit(0.0, inf, inf, inf, 0.0, ZERO)
"""The orbit given to a target that does not depend on one."""


def motion_of(loop: ClosedLoop) -> Motion | None:
    """Return the bounds of the target's motion; None for a target that declares none, or that has none."""
    tell = loop.target.part.hook("motion")
    if tell is None:
        return None
    motion: Motion = tell(loop.target.params, orbit_of(loop) if "two-body" in loop.target.needs else NOWHERE)
    return motion if all(map(isfinite, motion[:4])) else None


def orbit_of(loop: ClosedLoop) -> Orbit:
    """Return the bounds of a loop's orbit."""
    nearest, momentum, eccentricity, gravity = perigee(loop)
    band = band_of(loop)
    # The orbital frame turns by h/r2, and this changes by -2 h r'/r3 with |r'| at most mu e/h.
    share, change, rate, acceleration, _ = map(exact, band)
    nearest, more = nearest * (1 - share), 1 + share
    turn = upper(momentum * more / nearest**2) + rate
    slope = upper(2 * (gravity * eccentricity + momentum * change) * more / nearest**3) + acceleration
    low, _, fast = extremes(loop)
    return Orbit(
        low * (1.0 - band.share) * (1.0 - 1e-9),
        fast * (1.0 + band.share) * (1.0 + 1e-9),
        above(turn),
        above(slope),
        loop.craft.gravity,
        unit(cross(loop.start.position, loop.start.velocity)),
        band.force,
        band.rate,
        band.acceleration,
    )


def perigee(loop: ClosedLoop) -> tuple[arb, arb, arb, arb]:
    """Least distance (m), angular momentum (m2/s), eccentricity and gravitational parameter of two-body motion, as balls."""
    r = [arb(x) for x in loop.start.position]
    v = [arb(x) for x in loop.start.velocity]
    gravity = arb(loop.craft.gravity)
    across = [r[i] * v[j] - r[j] * v[i] for i, j in ((0, 1), (1, 2), (2, 0))]
    # Not ** 2, which has no value for a ball around zero.
    h2 = sum((part * part for part in across), arb(0))
    distance = sum((x * x for x in r), arb(0)).sqrt()
    energy = sum((x * x for x in v), arb(0)) / 2 - gravity / distance
    if not h2 > 0:
        raise InputError("orbit", "", "a path through the centre of attraction", "an orbit that passes beside it")
    squared = 1 + 2 * energy * h2 / gravity**2
    # Of a circle the ball of e2 may reach below zero, which e2 itself does not.
    eccentricity = squared.nonnegative_part().sqrt()
    return h2 / gravity / (1 + eccentricity), h2.sqrt(), eccentricity, gravity
