"""The command `sail`, the sail area that a circle about a libration point requires."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from starhold.errors import InputError
from starhold.report.commands import Column, Command, Option, Result, Table, number_or_text

if TYPE_CHECKING:
    from starhold.synthesis.circle import Station

DAY = 86400.0
RATES = (0.8, 1.0, 1.2, 1.6, 1.8, 2.0)
"""Rates on the circle in units of Omega, to which the best rate is added."""
REFLECTIVITIES = (1.0, 0.9, 0.8, 0.7, 0.6, 0.5)
DEFICITS = (0.0, 0.05, 0.1)
UNITS = {"radius": "m", "mass": "kg", "area": "m^2", "pressure": "N/m^2"}
NOTE = (
    "largest radius: held at the best rate by the control left; flights show whether the full circle then bends or\n"
    "diverges. radius in that light: the sail then lacks the sunlight that the body hides."
)


def read(**given: Any) -> tuple[Station, float, float | None]:
    """Return the circle, the mass of the craft (kg), and the area of its sail (m2; None without one)."""
    from starhold.parts.bodies.libration_point import PRIMARIES
    from starhold.scenario.checking import nearest
    from starhold.synthesis.circle import Station
    from starhold.synthesis.sail import check_optics

    primaries, point, radius = given["primaries"], given["point"], given["radius"]
    solar = [name for name in PRIMARIES if name.startswith("sun-")]
    if primaries not in PRIMARIES:
        raise InputError("sail", "--primaries", primaries, nearest(primaries, solar))
    if primaries not in solar:
        raise InputError("sail", "--primaries", primaries, f"a pair with the Sun: {', '.join(solar)}")
    if point not in ("L1", "L2"):
        raise InputError("sail", "--point", point, "L1 or L2")
    pair, (across, mass, area, pressure) = PRIMARIES[primaries], (_number(name, given[name]) for name in UNITS)
    across = 2.0 * pair.radius_smaller if across is None else across
    mirror, diffuse = (_number(name, given[name]) for name in ("reflectivity", "diffuse"))
    try:
        check_optics(mirror, diffuse)
    except ValueError as error:
        raise InputError("sail", "--diffuse", given["diffuse"], str(error)) from None
    station = Station(pair, point, across, mirror, diffuse, pressure)
    if across > abs(station.plant.from_smaller) * station.units.length:
        raise InputError("sail", "--radius", radius or "", "a circle smaller than the distance of the point from the body")
    if station.pressure == 0.0:
        clear = f"{1e-3 * station.clear_radius:.0f} km"
        raise InputError("sail", "--radius", radius or "", f"a circle in sunlight; the whole Sun is seen from {clear} on")
    return station, mass, area


def _number(name: str, text: Any) -> Any:
    """Return a positive quantity, or a share of the light, read from its text; a plain number is SI."""
    from pydantic_core import PydanticCustomError

    from starhold.laws.interface import Gain
    from starhold.scenario.quantity import reader

    gain = Gain(UNITS[name], above=0.0) if name in UNITS else Gain("1", at_least=0.0, at_most=1.0)
    if text is None:
        return None
    try:
        return reader(gain)(number_or_text(text))
    except PydanticCustomError as error:
        raise InputError("sail", f"--{name}", text, error.message()) from None


def present(station: Station, mass: float, area: float | None, _same: Station) -> Result:
    """Return the result: the design, the sail over rates and reflectivities, and the control left at deficits relative to
    the circle's demand."""
    from starhold.parts.bodies.libration_point import nonlinear
    from starhold.synthesis.circle import demand

    plant, units = station.plant, station.units
    away = 1e-3 * abs(plant.from_smaller) * units.length
    scaled, peak, needed = demand(station.rate, plant), station.peak(), station.area_per_mass()
    dearer = station.peak_full(nonlinear) / peak - 1.0
    lines = [
        f"{station.pair.name}, {station.point}: {away:.0f} km from the smaller body, C = {plant.stiffness:.6g} Ω², "
        f"Ω = {units.rate:.6g} rad/s",
        f"circle: radius {1e-3 * station.radius:.6g} km, best rate √(C − 2Ω²) = {station.rate:.5g} Ω, "
        f"period {station.period() / DAY:.5g} days",
        f"peak demand: 2Ω√(C − Ω²) = {scaled:.5g} Ω² × radius = {peak:.5g} m/s² (scaled: "
        f"{scaled * station.radius / units.length:.5g}); {100.0 * dearer:+.2g} % in the full three-body problem",
        _light(station),
        f"sail: {needed:.4g} m²/kg, {needed * mass:.4g} m² for {mass:g} kg",
    ]
    deficits = {*DEFICITS, 0.0}
    if area is not None:
        lines.append(_margin(station, area, mass))
        deficits.add(1.0 - station.margin(area, mass))
    mirrors = sorted({*REFLECTIVITIES, station.specular} - {0.0}, reverse=True)
    rates = [
        [rate, station.period(rate), demand(rate, plant), station.peak(rate)] for rate in sorted({*RATES, station.rate})
    ]
    areas = [[station.area_per_mass(rate, mirror) for mirror in mirrors] for rate, *_ in rates]
    heads = ("rate", "period", "peak_scaled", "peak", "pressure", "radius", "specular", "diffuse", "area_per_mass")
    numbers = [
        [*rate, station.pressure, station.radius, mirror, min(station.diffuse, 1.0 - mirror), area]
        for rate, by_mirror in zip(rates, areas, strict=True)
        for mirror, area in zip(mirrors, by_mirror, strict=True)
    ]
    columns = [Column("rate", "Ω", ".4g"), Column("period", "days", ".4g"), Column("peak/radius", "Ω²", ".4g")]
    columns += [Column("peak", "m/s²", ".4g"), *(Column(f"{mirror:g}", "m²/kg", ".4g") for mirror in mirrors)]
    rows = [[rate, period / DAY, *peaks, *by_mirror] for (rate, period, *peaks), by_mirror in zip(rates, areas, strict=True)]
    best = [number for number, (rate, *_) in enumerate(rates) if rate == station.rate]
    table = Table(columns, rows, "Sail over the rate and the reflectivity", bold=best)
    blocks = [*lines, "", table, "", _deficits(station, sorted(deficits)), NOTE]
    return Result("The sail of a circle", blocks, Table([*map(Column, heads)], numbers))


def _light(station: Station) -> str:
    part = f"light: {100.0 * station.light(station.radius):.4g} % of the Sun's disc, {station.pressure:.4g} N/m² on black"
    if station.clear_radius == 0.0:
        return part
    return f"{part}; the whole disc from {1e-3 * station.clear_radius:.6g} km on"


def _margin(station: Station, area: float, mass: float) -> str:
    from starhold.synthesis.circle import demand, rates_held

    margin = station.margin(area, mass)
    rates_kept = rates_held(margin * demand(station.rate, station.plant), station.plant)
    rates = "no rate is held" if rates_kept is None else f"rates from {rates_kept[0]:.4g} to {rates_kept[1]:.4g} Ω are held"
    return f"margin of {area:g} m²: {margin:.4g}; {rates}"


def _deficits(station: Station, deficits: list[float]) -> Table:
    """Return a table with a row per deficit and the control that it leaves; a margin is a negative deficit."""
    columns = [Column("deficit", "%", ".4g"), Column("largest radius", "km", ".6g"), Column("Sun seen there", "%", ".4g")]
    columns += [Column("radius in that light", "km", ".6g"), Column("on its limit, full circle", "% of the time", ".3g")]
    rows: list[list[float]] = []
    for missing in deficits:
        left = station.deficit(missing)
        shown = [100.0 * missing, 1e-3 * left.radius, 100.0 * left.light, 1e-3 * left.radius_dimmed, 100.0 * left.on_limit]
        rows.append(shown)
    return Table(columns, rows, "What a deficit of control leaves")


COMMAND = Command(
    "How large a sail keeps a craft on a circle about a libration point: best rate, peak demand, area, margin, deficits.",
    "",
    lambda station, mass, area: station,
    present,
    doing=None,
    file=None,
    read=read,
    options={
        "primaries": Option("", "the Sun and the other body", default="sun-earth"),
        "point": Option("", "libration point: L1 or L2", default="L2"),
        "radius": Option("", 'radius of the circle, "20000 km"; the body\'s diameter if not given'),
        "mass": Option("", 'mass of the craft, "300 kg"', default="300 kg"),
        "area": Option("", 'actual sail area, "200 m^2", for its margin'),
        "reflectivity": Option("", "share of the light reflected as by a mirror", default="1"),
        "diffuse": Option("", "share of the light reflected diffusely", default="0"),
        "pressure": Option("", 'pressure of full sunlight on black, "4.5e-6 N/m^2"; by distance if not given'),
        "output": Option("", "write the table", file="csv"),
    },
)
