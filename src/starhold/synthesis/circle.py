"""A circle about a libration point kept by sunlight: its demands on the control and on the sail.

The circle lies across the X axis, so that the solar cells see the Sun past the body in front of it, and is flown at a
constant rate. Rates are in units of Omega, accelerations in scaled units per unit of the circle's radius, unless stated
otherwise. Source: the study of invariant sets near L2 in Izv. RAN TiSU 2023 no. 4. Its factor 2.786 for the peak demand is
2 Omega w; its own formula gives 3.429 for C = 3.94, which is what the circle needs.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from starhold.algebra.vector import Vector, norm, subtract
from starhold.parts.bodies.libration_point import AU, EARTH_DIAMETER, Libration, Primaries, Units, linear
from starhold.synthesis.sail import ball, lit_discs

SOLAR_CONSTANT = 1361.0
"""Power of sunlight (W/m2) at one astronomical unit (Kopp and Lean 2011)."""
LIGHT_SPEED = 299_792_458.0
"""m/s."""

Field = Callable[[Vector, Vector, Libration], Vector]
"""`libration.linear` or `libration.nonlinear`."""


def pressure_at(distance: float) -> float:
    """Return the pressure of sunlight (N/m2) on a black surface facing the Sun at this distance (m)."""
    return SOLAR_CONSTANT / LIGHT_SPEED * (AU / distance) ** 2


def best_rate(plant: Libration) -> float:
    """Return the rate w = sqrt(C - 2 Omega^2) at which a circle demands the least control. Raise ValueError if there is
    none above zero, as at L3."""
    square = plant.stiffness / plant.rate**2 - 2.0
    if square <= 0.0:
        raise ValueError(f"no rate is best here: C - 2 Omega^2 = {square:.6g} Omega^2 is not positive")
    return math.sqrt(square)


def demand(rate: float, plant: Libration) -> float:
    """Return the largest control acceleration on a circle of unit radius: sqrt(4 Omega^2 w^2 + (C - w^2)^2), where the
    circle crosses the plane y = 0. At the best rate it is 2 Omega sqrt(C - Omega^2)."""
    turning = rate * plant.rate
    return math.hypot(2.0 * plant.rate * turning, plant.stiffness - turning * turning)


def rates_held(resource: float, plant: Libration) -> tuple[float, float] | None:
    """Return the lowest and the highest rate at which this control acceleration keeps a circle of unit radius; None if it
    keeps none."""
    best, least = best_rate(plant), demand(best_rate(plant), plant)
    if resource < least:
        return None
    spread = math.sqrt(resource * resource - least * least) / plant.rate**2
    return math.sqrt(max(0.0, best * best - spread)), math.sqrt(best * best + spread)


def time_on_limit(resource: float, rate: float, plant: Libration) -> float:
    """Return the share of a revolution in which a circle of unit radius demands more than this control acceleration."""
    turning = rate * plant.rate
    least = plant.stiffness - plant.rate**2 - turning * turning
    # |u|^2 is peak^2 sin^2 + least^2 cos^2 of the phase.
    low, high = least * least, demand(rate, plant) ** 2
    ratio = min(max((resource * resource - low) / (high - low), 0.0), 1.0)
    return 1.0 - 2.0 / math.pi * math.asin(math.sqrt(ratio))


def required(
    phase: float, rate: float, radius: float, plant: Libration, field: Field = linear, centre: float = 0.0
) -> Vector:
    """Return the control acceleration (scaled) that keeps the craft on a circle of this radius (scaled) about a point on
    the X axis, at this phase from Y towards Z."""
    turning = rate * plant.rate
    y, z = radius * math.cos(phase), radius * math.sin(phase)
    inward = (0.0, -turning * turning * y, -turning * turning * z)
    return subtract(inward, field((centre, y, z), (0.0, -turning * z, turning * y), plant))


def peak_required(
    rate: float, radius: float, plant: Libration, field: Field = linear, centre: float = 0.0, push: float = 0.0
) -> float:
    """Return the largest control acceleration (scaled) around the circle, in addition to a steady push along X (scaled),
    sampled around it."""
    phases: list[float] = np.linspace(0.0, 2.0 * math.pi, 3601).tolist()
    steady = (push, 0.0, 0.0)
    return max(norm(subtract(required(phase, rate, radius, plant, field, centre), steady)) for phase in phases)


class Deficit(NamedTuple):
    """The effects of a control below the circle's demand: the largest radius kept by the formula (m), the visible share of
    the Sun there, the largest radius if the sail loses that light too (m; 0 for none), the rates at which the full circle is
    still kept (Omega; None for none), and the share of a revolution with saturated control there."""

    missing: float
    radius: float
    light: float
    radius_dimmed: float
    rates: tuple[float, float] | None
    on_limit: float


@dataclass(frozen=True)
class Station:
    """A circle about a libration point and the sail that keeps it: two bodies, the larger being the Sun, the name of the
    point (L1 or L2), the circle's radius (m), the specular and diffuse reflectivity, and the pressure of the whole Sun's
    light (N/m2; None: that at the point)."""

    pair: Primaries
    point: str
    radius: float
    specular: float = 1.0
    diffuse: float = 0.0
    full_pressure: float | None = None

    @property
    def plant(self) -> Libration:
        """Return the libration point, lengths in Earth diameters."""
        return self.pair.point(self.point)

    @property
    def units(self) -> Units:
        """Return the scaled units of `plant`."""
        return self.pair.units()

    def light(self, offset: float) -> float:
        """Return the visible share of the Sun at this distance from the X axis (m), with the real sizes of both discs."""
        plant = self.plant
        if plant.from_smaller <= 0.0:
            return 1.0
        sun, body = plant.from_larger * EARTH_DIAMETER, plant.from_smaller * EARTH_DIAMETER
        apart = offset * (1.0 / body - 1.0 / sun)
        return float(lit_discs(apart, self.pair.radius_larger / sun, self.pair.radius_smaller / body))

    @property
    def clear_radius(self) -> float:
        """Return the distance from the X axis (m) beyond which the whole Sun is visible; 0 if nothing occults it."""
        plant = self.plant
        if plant.from_smaller <= 0.0:
            return 0.0
        sun, body = plant.from_larger * EARTH_DIAMETER, plant.from_smaller * EARTH_DIAMETER
        return (self.pair.radius_larger / sun + self.pair.radius_smaller / body) / (1.0 / body - 1.0 / sun)

    @property
    def pressure(self) -> float:
        """Return the pressure of the light that reaches the circle (N/m2)."""
        full = (
            pressure_at(abs(self.plant.from_larger) * EARTH_DIAMETER) if self.full_pressure is None else self.full_pressure
        )
        return full * self.light(self.radius)

    @property
    def rate(self) -> float:
        """Return the best rate (Omega)."""
        return best_rate(self.plant)

    def period(self, rate: float | None = None) -> float:
        """Return the time of one revolution of the circle (s), at the best rate if none is given."""
        return self.pair.period / (self.rate if rate is None else rate)

    def peak(self, rate: float | None = None) -> float:
        """Return the peak demand (m/s2), at the best rate if none is given."""
        scaled = demand(self.rate if rate is None else rate, self.plant)
        return scaled * self.radius * self.units.rate**2

    def area_per_mass(self, rate: float | None = None, specular: float | None = None) -> float:
        """Return the least sail area per mass for this circle (m2/kg), at the best rate if none is given: peak demand over
        pressure times the radius of the largest ball of forces. With another specular share, the diffuse one is at most the
        rest."""
        mirror = self.specular if specular is None else specular
        return self.peak(rate) / (self.pressure * ball(mirror, min(self.diffuse, 1.0 - mirror)).radius)

    def margin(self, area: float, mass: float) -> float:
        """Return the control from a sail of this area (m2) on a craft of this mass (kg), as a multiple of the circle's
        demand."""
        return area / (mass * self.area_per_mass())

    def peak_full(self, field: Field) -> float:
        """Return the peak demand (m/s2) at the best rate around the circle in a given field, with the circle moved towards
        the Sun as far as the steady push of the smallest sail moves it in the linear field."""
        plant, units = self.plant, self.units
        steady = ball(self.specular, self.diffuse)
        push = self.peak() * steady.centre / steady.radius / units.acceleration
        centre = -push / (plant.rate**2 + 2.0 * plant.stiffness)
        return peak_required(self.rate, self.radius / units.length, plant, field, centre, push) * units.acceleration

    def deficit(self, missing: float) -> Deficit:
        """Return the effects on the circle at the best rate if this share of its demand is missing (negative: to spare)."""
        plant, share = self.plant, 1.0 - missing
        least, radius = demand(self.rate, plant), share * self.radius
        return Deficit(
            missing,
            radius,
            self.light(radius),
            self._dimmed(radius),
            rates_held(share * least, plant),
            time_on_limit(share * least, self.rate, plant),
        )

    def _dimmed(self, radius: float) -> float:
        """Return the largest radius at which a sail keeps the circle in the local light, if in the light of the planned
        circle it keeps `radius`."""
        here = self.light(self.radius)
        # The light increases with the radius, so steps from above only shrink, towards the largest solution.
        largest = radius if radius <= self.radius else radius / here
        for _ in range(10_000):
            before, largest = largest, radius * self.light(largest) / here
            if not largest < before * (1.0 - 1e-13):
                break
        return largest
