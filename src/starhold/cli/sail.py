"""The command `sail`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from starhold.cli.arguments import Force, number_or_text
from starhold.errors import InputError
from starhold.report.commands import Column, Table

if TYPE_CHECKING:
    from starhold.synthesis.circle import Station

_DAY = 86400.0


def sail(
    primaries: Annotated[str, typer.Option(help="the Sun and which body")] = "sun-earth",
    point: Annotated[str, typer.Option(help="libration point: L1 or L2")] = "L2",
    radius: Annotated[str | None, typer.Option(help='of the circle, "20000 km"; the body\'s diameter if not given')] = None,
    mass: Annotated[str, typer.Option(help='of the craft, "300 kg"')] = "300 kg",
    area: Annotated[str | None, typer.Option(help='sail that there is, "200 m^2", for its margin')] = None,
    reflectivity: Annotated[str, typer.Option(help="part of the light reflected as by a mirror")] = "1",
    diffuse: Annotated[str, typer.Option(help="part of the light reflected in all directions")] = "0",
    pressure: Annotated[
        str | None, typer.Option(help='of the whole Sun\'s light on black, "4.5e-6 N/m^2"; by distance if not given')
    ] = None,
    output: Annotated[Path | None, typer.Option("-o", "--output", metavar="FILE.csv", help="write the table")] = None,
    force: Force = False,
) -> None:
    """How large a sail keeps a craft on a circle about a libration point: best rate, peak demand, area, margin, deficits."""
    from starhold.cli.console import console
    from starhold.parts.bodies.libration_point import PRIMARIES
    from starhold.report.tables import write_sail
    from starhold.scenario.reading import nearest
    from starhold.synthesis.circle import Station
    from starhold.synthesis.sail import check_optics

    if primaries not in PRIMARIES:
        raise InputError("sail", "--primaries", primaries, nearest(primaries, _solar()))
    if primaries not in _solar():
        raise InputError("sail", "--primaries", primaries, f"a pair with the Sun: {', '.join(_solar())}")
    if point not in ("L1", "L2"):
        raise InputError("sail", "--point", point, "L1 or L2")
    pair = PRIMARIES[primaries]
    across = 2.0 * pair.radius_smaller if radius is None else _number("--radius", radius, "m")
    kilograms = _number("--mass", mass, "kg")
    there_is = None if area is None else _number("--area", area, "m^2")
    parts = [_part(name, text) for name, text in (("--reflectivity", reflectivity), ("--diffuse", diffuse))]
    try:
        check_optics(*parts)
    except ValueError as error:
        raise InputError("sail", "--diffuse", diffuse, str(error)) from None
    given = None if pressure is None else _number("--pressure", pressure, "N/m^2")
    station = Station(pair, point, across, parts[0], parts[1], given)
    if across > abs(station.plant.from_smaller) * station.units.length:
        raise InputError("sail", "--radius", radius or "", "a circle smaller than the distance of the point from the body")
    if station.pressure == 0.0:
        clear = f"{1e-3 * station.clear_radius:.0f} km"
        raise InputError("sail", "--radius", radius or "", f"a circle that the Sun reaches; the whole Sun from {clear} on")
    if output is not None and output.exists() and not force:
        raise InputError(str(output), "", "a file that exists", "another name, or --force")
    print_sail(station, point, kilograms, there_is)
    if output is not None:
        write_sail(station, output)
        console.print(f"Table: {output}", soft_wrap=True)


def _solar() -> list[str]:
    from starhold.parts.bodies.libration_point import PRIMARIES

    return [name for name in PRIMARIES if name.startswith("sun-")]


def _number(option: str, text: str, unit: str) -> float:
    """A positive quantity; a plain number is SI."""
    from starhold.laws.interface import Gain

    return _read(option, text, Gain(unit, above=0.0))


def _part(option: str, text: str) -> float:
    from starhold.laws.interface import Gain

    return _read(option, text, Gain("1", at_least=0.0, at_most=1.0))


def _read(option: str, text: str, gain: Any) -> float:
    from pydantic_core import PydanticCustomError

    from starhold.scenario.quantity import reader

    try:
        return reader(gain)(number_or_text(text))
    except PydanticCustomError as error:
        raise InputError("sail", option, text, error.message()) from None


def print_sail(station: Station, point: str, mass: float, area: float | None) -> None:
    """The design in words, then the tables."""
    from starhold.cli.console import console
    from starhold.cli.show import print_rows
    from starhold.studies.sail import dearer
    from starhold.synthesis.circle import demand

    plant, units = station.plant, station.units
    away = 1e-3 * abs(plant.from_smaller) * units.length
    scaled, peak, needed = demand(station.rate, plant), station.peak(), station.area_per_mass()
    lines = [
        f"{station.pair.name}, {point}: {away:.0f} km from the smaller body, C = {plant.stiffness:.6g} Ω², "
        f"Ω = {units.rate:.6g} rad/s",
        f"circle: radius {1e-3 * station.radius:.6g} km, best rate √(C − 2Ω²) = {station.rate:.5g} Ω, "
        f"period {station.period() / _DAY:.5g} days",
        f"peak demand: 2Ω√(C − Ω²) = {scaled:.5g} Ω² × radius = {peak:.5g} m/s² (scaled: "
        f"{scaled * station.radius / units.length:.5g}); {100.0 * dearer(station):+.2g} % in the full three-body problem",
        _light(station),
        f"sail: {needed:.4g} m²/kg, {needed * mass:.4g} m² for {mass:g} kg",
    ]
    if area is not None:
        lines.append(_margin(station, area, mass))
    console.print("\n".join(lines), highlight=False, markup=False, soft_wrap=True)
    print_rows(_rates(station), apart=True)
    print_rows(_deficits(station, None if area is None else 1.0 - station.margin(area, mass)), apart=True)
    console.print(
        "largest radius: held at the best rate by what is left; whether the full circle then bends or is lost, flights"
    )
    console.print("tell. radius in that light: where the sail loses with the Sun what the body hides.")


def _light(station: Station) -> str:
    part = f"light: {100.0 * station.light(station.radius):.4g} % of the Sun's disc, {station.pressure:.4g} N/m² on black"
    if station.clear_radius == 0.0:
        return part
    return f"{part}; the whole disc from {1e-3 * station.clear_radius:.6g} km on"


def _margin(station: Station, area: float, mass: float) -> str:
    from starhold.synthesis.circle import demand, rates_held

    margin = station.margin(area, mass)
    held = rates_held(margin * demand(station.rate, station.plant), station.plant)
    rates = "no rate is held" if held is None else f"rates from {held[0]:.4g} to {held[1]:.4g} Ω are held"
    return f"margin of {area:g} m²: {margin:.4g}; {rates}"


def _rates(station: Station) -> Table:
    from starhold.studies.sail import reflectivities, rows

    mirrors = reflectivities(station)
    columns = [Column("rate", "Ω", ".4g"), Column("period", "days", ".4g"), Column("peak/radius", "Ω²", ".4g")]
    columns += [Column("peak", "m/s²", ".4g"), *(Column(f"{mirror:g}", "m²/kg", ".4g") for mirror in mirrors)]
    found = rows(station, mirrors)
    cells = [[row.rate, row.period / _DAY, row.scaled, row.peak, *row.areas] for row in found]
    best = [number for number, row in enumerate(found) if row.rate == station.rate]
    return Table(columns, cells, "Sail over the rate and the reflectivity", bold=best)


def _deficits(station: Station, own: float | None) -> Table:
    """Tell what deficits leave of what the circle asks; `own` is that of the sail there is, negative for a margin."""
    from starhold.studies.sail import DEFICITS

    columns = [Column("deficit", "%", ".4g"), Column("largest radius", "km", ".6g"), Column("Sun seen there", "%", ".4g")]
    columns += [Column("radius in that light", "km", ".6g"), Column("on its limit, full circle", "% of the time", ".3g")]
    rows: list[list[float]] = []
    for missing in sorted({*DEFICITS, 0.0 if own is None else own}):
        left = station.deficit(missing)
        shown = [100.0 * missing, 1e-3 * left.radius, 100.0 * left.light, 1e-3 * left.radius_dimmed, 100.0 * left.on_limit]
        rows.append(shown)
    return Table(columns, rows, "What a deficit of control leaves")
