"""Numbers in sentences, rounded so that no more is said than is proved."""

import math
from collections.abc import Iterator, Sequence
from decimal import ROUND_CEILING, ROUND_FLOOR, Context, Decimal


def shown(value: float, unit: str = "", up: bool = False) -> str:
    """Show a number as it was written, if that takes at most seven digits; else with four, rounded down, or up where it
    bounds from above, so that no more is said than is proved."""
    written = Decimal(f"{value:.15g}")
    if len(written.normalize().as_tuple().digits) <= 7:
        # Converting a unit loses the last bits.
        return f"{float(written):.7g}{unit}"
    rounding = ROUND_CEILING if up else ROUND_FLOOR
    return f"{float(Context(prec=4, rounding=rounding).create_decimal(Decimal(value))):g}{unit}"


def angle(radians: float, up: bool = False) -> str:
    """An angle in degrees."""
    return shown(math.degrees(radians), "°", up)


def speed(rate: float, up: bool = False) -> str:
    """A rate in degrees a second."""
    return shown(math.degrees(rate), "°/s", up)


def growing(sizes: Sequence[float] | None) -> Iterator[str]:
    """Word the growth of measurement errors as the body moves."""
    sizes = sizes or (0.0,) * 4
    for name, units, (turning, hurrying) in (("attitude", (" s", " s^2"), sizes[:2]), ("rate", ("", " s"), sizes[2:4])):
        kinds = zip((turning, hurrying), units, ("rate", "acceleration"), strict=True)
        grown = [f"{shown(x, unit)} times the body's {of}" for x, unit, of in kinds if x]
        yield from [f"errors of the {name} of up to {' and '.join(grown)}"] if grown else []
