"""Rescales all inputs of a law by their declared units, to test physics in other units."""

from functools import cache
from typing import Any

from starhold.algebra.quantity import quantities
from starhold.laws.catalogue import Law
from starhold.laws.interface import Measurement
from starhold.parts.craft import Craft
from starhold.parts.part import Part
from starhold.scenario.units import unit_registry

SYSTEMS = ((7.0, 1.0, 1.0), (1.0, 3.0, 1.0), (1.0, 1.0, 0.2), (2.0, 0.3, 5.0))
"""Systems of units of mass, length and time, in kg, m and s, in which physics must be the same."""


def rescaled(
    law: Law, measurement: Measurement, gains: Any, craft: Craft, factors: tuple[float, float, float]
) -> tuple[Measurement, Any, Craft, float]:
    """Return the arguments of a law in a system of units in which 1 kg, 1 m and 1 s are `factors` units, and the factor
    that converts its torque back to N m."""

    return (
        rescale(measurement, _units(Measurement), factors),
        rescale_params(law, gains, factors),
        rescale(craft, _units(Craft), factors),
        1.0 / _factor("N m", factors),
    )


@cache
def _units(cls: Any) -> list[str]:
    return [quantity.unit for quantity in quantities(cls).values()]


def times(value: Any, factor: float) -> Any:
    """Return a number, or nested tuples of numbers, times a factor."""
    return tuple(times(part, factor) for part in value) if isinstance(value, tuple) else value * factor


def _factor(unit: str, factors: tuple[float, float, float]) -> float:
    product = 1.0
    for power, factor in zip(_powers(unit), factors, strict=True):
        product *= factor**power
    return product


@cache
def _powers(unit: str) -> tuple[float, float, float]:
    """Return the exponents of mass, length and time in a unit."""
    dimensions: Any = unit_registry().parse_units("dimensionless" if unit == "1" else unit).dimensionality
    return (dimensions.get("[mass]", 0.0), dimensions.get("[length]", 0.0), dimensions.get("[time]", 0.0))


def rescale(values: Any, units: Any, factors: tuple[float, float, float]) -> Any:
    """Return a tuple whose fields have these units in another system of units, as the same type."""
    parts = [times(value, _factor(unit, factors)) for value, unit in zip(values, units, strict=True)]
    return type(values)(*parts) if hasattr(values, "_fields") else tuple(parts)


def rescale_params(part: Part, params: Any, factors: tuple[float, float, float]) -> Any:
    """Return the parameters of a part in another system of units."""
    if part.table:
        return params
    values = [
        value if item.gain.choices or item.gain.whole else times(value, _factor(item.gain.unit, factors))
        for item, value in zip(part.fields(), params, strict=True)
    ]
    return type(params)(*values)
