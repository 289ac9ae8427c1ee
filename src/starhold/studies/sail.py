"""The sail that a circle about a libration point takes, over the circle's rate and the reflectivity."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from starhold.parts.bodies.libration_point import nonlinear
from starhold.synthesis.circle import Station, demand

RATES = (0.8, 1.0, 1.2, 1.6, 1.8, 2.0)
"""Omega; the best rate comes beside them."""
REFLECTIVITIES = (1.0, 0.9, 0.8, 0.7, 0.6, 0.5)
DEFICITS = (0.0, 0.05, 0.1)


class Row(NamedTuple):
    """One rate of the circle (Omega), its period (s), the peak demand a unit of radius (scaled) and in m/s2, and the area
    per mass (m2/kg) for each reflectivity."""

    rate: float
    period: float
    scaled: float
    peak: float
    areas: tuple[float, ...]


def rows(station: Station, reflectivities: Sequence[float]) -> list[Row]:
    """A row a rate, in order; the best rate is one of them."""
    found: list[Row] = []
    for rate in sorted({*RATES, station.rate}):
        areas = tuple(station.area_per_mass(rate, mirror) for mirror in reflectivities)
        found.append(Row(rate, station.period(rate), demand(rate, station.plant), station.peak(rate), areas))
    return found


def reflectivities(station: Station) -> tuple[float, ...]:
    """The columns of the table, the station's own among them."""
    return tuple(sorted({*REFLECTIVITIES, station.specular} - {0.0}, reverse=True))


def dearer(station: Station) -> float:
    """By which part the full three-body problem asks for more than the formula."""
    return station.peak_full(nonlinear) / station.peak() - 1.0
