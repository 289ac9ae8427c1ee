"""Measures of sections 3.1 and 3.4: the visibility of the Sun, and the control by its light."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from starhold.algebra.vector import add, clip_norm, scale
from starhold.laws.interface import NoMemory
from starhold.laws.point import PointMeasurement
from starhold.parts.bodies.libration_point import EARTH_DIAMETER, PRIMARIES, linear
from starhold.parts.craft import vector
from starhold.publications.desk import Desk
from starhold.publications.figure import Curve, Figure, Panel
from starhold.publications.verdicts import Finding
from starhold.synthesis import sail as sails
from starhold.synthesis.circle import Station, pressure_at

PAIR = PRIMARIES["sun-earth"]
TURN = np.linspace(0.0, 2.0 * np.pi, 181)
RING = np.array([np.cos(TURN), np.sin(TURN)])


def station() -> Station:
    """Return the circle with a radius of one Earth diameter around L2, with a perfect mirror as the sail."""
    return Station(PAIR, "L2", EARTH_DIAMETER, 1.0)


def discs() -> tuple[float, float]:
    """Return the angular diameters (degrees) of the Sun and the Earth from L2."""
    plant = station().plant
    pairs = ((PAIR.radius_larger, plant.from_larger), (PAIR.radius_smaller, plant.from_smaller))
    sun, earth = (math.degrees(2.0 * radius / (away * EARTH_DIAMETER)) for radius, away in pairs)
    return sun, earth


def angles(desk: Desk) -> Finding:
    """Angular diameters of the Sun and the Earth from L2 (degrees)."""
    return Finding(discs())


def same_angle(desk: Desk) -> Finding:
    """Return whether both discs look equal, to within a tenth and to within a hundredth."""
    sun, earth = discs()
    share = earth / sun
    ring = 100.0 * station().light(0.0)
    note = f"the Earth's is {share:.3f} of the Sun's: on the axis a ring with {ring:.0f} % of the light is left"
    return Finding({"within a tenth": abs(share - 1.0) < 0.1, "within a hundredth": abs(share - 1.0) < 0.01}, note)


def clear_offset(desk: Desk) -> Finding:
    """Return the offset, in Earth diameters, beyond which the whole Sun is visible."""
    here = station()
    return Finding(
        here.clear_radius / EARTH_DIAMETER, f"at 1 diameter {100.0 * here.light(EARTH_DIAMETER):.1f} % of the Sun is seen"
    )


def lit_share(desk: Desk, count: int) -> Finding:
    """Return whether the formula for equal discs gives the share of points of one disc that the other does not cover."""
    side = (np.arange(count) + 0.5) / count * 2.0 - 1.0
    x, y = np.meshgrid(side, side)
    inside = x * x + y * y < 1.0
    # Offsets are in Earth radii, which equal the distance of the discs' centres in disc radii.
    offsets = np.linspace(0.0, 2.0, 9)
    free = [float(((x - s) ** 2 + y * y >= 1.0)[inside].mean()) for s in offsets]
    off = float(np.abs(np.array(free) - sails.lit(offsets)).max())
    return Finding(off < 5e-3, f"counted on a grid of {count} by {count} points: within {off:.0e}")


def mirror_force(desk: Desk) -> Finding:
    """Return whether the force on a mirror is p S cos g (1 + cos 2g)/cos g = 2 p S cos^2 g along its normal, by the momentum
    of the reflected light."""
    sail, off = sails.make_sail(4.5e-6, 150.0, 300.0), 0.0
    for cone in np.linspace(0.0, 1.5, 31):
        setting = sails.Setting(sail.area, float(cone), 0.7)
        normal = np.array(sails.normal_of(setting))
        light = np.array([1.0, 0.0, 0.0])
        reflected = light - 2.0 * normal[0] * normal
        lost = sail.pressure * sail.area * normal[0] * (light - reflected)
        printed = sail.pressure * sail.area * (1.0 + math.cos(2.0 * cone)) * normal
        off = max(
            off, float(np.abs(np.subtract(sails.given(setting, sail), lost)).max()), float(np.abs(printed - lost).max())
        )
    return Finding(off < 1e-15, "light of this momentum, reflected at 31 angles, loses as much")


def ball(desk: Desk) -> Finding:
    """Return whether a ball of controls is attainable: every vector on its boundary is given by an area and two angles."""
    sail = sails.make_sail(4.5e-6, 150.0, 300.0)
    reach, off, most = sails.reach(sail), 0.0, 0.0
    for lean in np.linspace(0.0, np.pi, 25):
        for clock in np.linspace(-3.0, 3.0, 12):
            across = math.sin(lean)
            wanted = scale(reach, (math.cos(lean), across * math.cos(clock), across * math.sin(clock)))
            setting = sails.steer(wanted, sail)
            off = max(off, float(np.linalg.norm(np.subtract(sails.steered(setting, sail), wanted))) / reach)
            most = max(most, setting.area / sail.area)
    radius = sails.MIRROR_RADIUS / 2.0
    note = f"radius {radius:.4f} of 2 p S/m; its border asks for at most {100.0 * most:.1f} % of the area"
    return Finding(off < 1e-9 and most < 1.0 + 1e-9, note)


def shifted(desk: Desk) -> Finding:
    """Return whether the linear model is unchanged under a constant push, about a point closer to the Sun."""
    plant, push = station().plant, 2.3
    back = push / (plant.rate**2 + 2.0 * plant.stiffness)
    draw = np.random.default_rng(5)
    off = 0.0
    for _ in range(20):
        position, velocity = (vector(draw.normal(size=3)) for _ in range(2))
        moved = add(linear((position[0] - back, position[1], position[2]), velocity, plant), (push, 0.0, 0.0))
        off = max(off, float(np.abs(np.subtract(moved, linear(position, velocity, plant))).max()))
    steady = sails.MIRROR_CENTRE / sails.MIRROR_RADIUS * station().peak() / station().units.acceleration / (push / back)
    return Finding(off < 1e-12, f"the smallest mirror's push moves it {steady:.2f} Earth diameters towards the Sun")


def area(desk: Desk, low: float, high: float, pressure: float) -> Finding:
    """Return for each reflectivity whether the area per mass lies between two numbers (m2/kg), at a pressure (N/m2)."""
    here = station()

    def least(mirror: float) -> float:
        return here.peak() / (pressure * sails.MIRROR_RADIUS * mirror)

    ends = " and ".join(f"{least(1.0) / value:.2f}" for value in (low, high))
    note = (
        f"{low:g} and {high:g} belong to reflectivities {ends}; a perfect mirror takes {least(1.0):.3f} m²/kg, in the light "
        f"at the circle ({here.pressure * 1e6:.2f} µN/m²) {here.area_per_mass():.3f}"
    )
    return Finding({f"reflectivity {one:g}": low <= least(one) <= high for one in (1.0, 0.9, 0.8, 0.7, 0.6)}, note)


def solar_cells(desk: Desk, efficiency: float, most: float) -> Finding:
    """Return whether solar cells with the sail's area suit a craft with a power per mass of at most `most` (W/kg)."""
    flux = pressure_at(station().plant.from_larger * EARTH_DIAMETER) * 299_792_458.0
    power = station().area_per_mass() * flux * efficiency
    return Finding(
        power < most, f"of the area of the smallest mirror, cells of {100.0 * efficiency:g} % give {power:.0f} W/kg"
    )


def area_figure(desk: Desk) -> Figure:
    """Return a figure of the area per mass over the reflectivity."""
    here, mirror = station(), np.linspace(0.4, 1.0, 61)
    areas = [here.area_per_mass(specular=float(one)) for one in mirror]
    panel = Panel("reflectivity", "area per mass, m²/kg", [Curve(mirror, areas)], levels=(0.6, 1.0), y_span=(0.4, 1.3))
    return Figure([panel])


def fly_sail(desk: Desk, margin: float, lag_h: float, years: float) -> dict[str, Any]:
    """Fly the circle with a mirror whose two angles lag and whose area follows at once, by SciPy's integrator instead of the
    loop. Returns time (revolutions), position (m, 3; radii), and commanded and actual settings (m, 3; share of the area,
    degrees)."""
    from scipy.integrate import solve_ivp

    def make() -> dict[str, Any]:
        here = station()
        units, plant = here.units, here.plant
        entry = desk.scenario("l2-circle").pick("smooth")
        sail = sails.make_sail(here.pressure, (1.0 + margin) * here.area_per_mass(), 1.0)
        lag, reach = lag_h * 3600.0 / units.time, sails.reach(sail)

        def commanded(state: Any) -> sails.Setting:
            measurement = PointMeasurement(tuple(state[:3]), tuple(state[3:6]), 0.0, math.inf)
            command, _ = entry.law.command(measurement, entry.gains, plant, NoMemory())
            # Slightly within the attainable set, so that rounding does not exceed it.
            wanted = clip_norm(scale(units.acceleration, command), reach * (1.0 - 1e-9))
            return sails.steer(wanted, sail)

        def turned(clock: float, to: float) -> float:
            return math.remainder(to - clock, 2.0 * math.pi)

        def slope(_: float, state: Any) -> list[float]:
            setting = commanded(state)
            cone, clock = state[6:] if lag else setting[1:]
            given = sails.steered(sails.Setting(setting.area, cone, clock), sail)
            field = linear(tuple(state[:3]), tuple(state[3:6]), plant)
            pulled = [a + b / units.acceleration for a, b in zip(field, given, strict=True)]
            rates = [(setting.cone - state[6]) / lag, turned(state[7], setting.clock) / lag] if lag else [0.0, 0.0]
            return [*state[3:6], *pulled, *rates]

        start = [0.0, 1.0, 0.0, 0.0, 0.0, entry.gains.rate]
        first = commanded(start)
        times = np.linspace(0.0, 2.0 * np.pi * years, round(1000 * years) + 1)
        states = solve_ivp(
            slope, (0.0, times[-1]), [*start, first.cone, first.clock], t_eval=times, rtol=1e-8, max_step=0.02
        ).y
        settings = np.array([commanded(state) for state in states.T])
        share = settings[:, :1] / sail.area
        return {
            "time": times * entry.gains.rate / (2.0 * np.pi),
            "position": states[:3].T,
            "asked": np.concatenate([share, np.degrees(settings[:, 1:])], axis=1),
            "set": np.concatenate([share, np.degrees(states[6:].T)], axis=1) if lag else None,
        }

    return desk.once(("sail", margin, lag_h, years), make)


def sail_keeps(desk: Desk, margin: float, lags_h: Sequence[float], years: float) -> Finding:
    """Return whether a mirror whose angles lag keeps the craft on the circle to within a hundredth of its radius."""
    off: dict[str, float] = {}
    for lag in lags_h:
        position = fly_sail(desk, margin, lag, years)["position"]
        half = position[len(position) // 2 :]
        off[f"{lag:g} h"] = float(np.hypot(np.hypot(half[:, 1], half[:, 2]) - 1.0, half[:, 0]).max())
    note = "off by " + ", ".join(f"{value:.4f} radii at {name}" for name, value in off.items())
    return Finding({name: value < 0.01 for name, value in off.items()}, note)


def sail_figure(desk: Desk, margin: float, lag_h: float, years: float) -> Figure:
    """Return a figure of the mirror's area and angles over the last revolution, commanded and actual."""
    flown = fly_sail(desk, margin, lag_h, years)
    last = flown["time"] >= flown["time"][-1] - 1.0
    time = flown["time"][last]
    panels: list[Panel] = []
    for k, label in enumerate(("area, share of all", "cone angle, degrees", "clock angle, degrees")):
        commanded, given = flown["asked"][last, k], flown["set"][last, k]
        if k == 2:
            # Whole turns are removed; the line has a gap where a turn ends.
            commanded, given = (_broken(np.remainder(angle + 180.0, 360.0) - 180.0) for angle in (commanded, given))
        lines = [Curve(time, commanded, "command"), *([Curve(time, given, "as it is", "dashed")] if k else [])]
        panels.append(Panel("revolutions", label, lines))
    return Figure(panels, 3)


def _broken(angle: Any) -> Any:
    return np.where(np.abs(np.diff(angle, prepend=angle[0])) > 180.0, np.nan, angle)


def figure_2(desk: Desk) -> Figure:
    """Return a figure of the axes at L2: the line from the Sun through the Earth, to scale, and the circle across it."""
    earth = -station().plant.from_smaller * EARTH_DIAMETER / 1e9
    side = [
        *_arrow((0.0, 0.0), (0.5, 0.0), 1),
        *_arrow((0.0, 0.0), (0.0, 0.35), 1),
        *_arrow((earth, 0.0), (earth, 0.35), 0),
        Curve([earth - 0.35, 0.5], [0.0, 0.0], style="faint"),
        Curve([earth, 0.0], [0.0, 0.0], style="points", hue=0),
    ]
    notes = [
        (0.55, -0.07, "X"),
        (0.08, 0.37, "Y"),
        (0.0, -0.09, "L2"),
        (earth, -0.09, "Earth"),
        (earth + 0.27, 0.33, "its velocity"),
        (earth - 0.28, 0.07, "to the Sun"),
    ]
    across = [
        Curve.along(RING, "circle", hue=0),
        *_arrow((0.0, 0.0), (1.5, 0.0), 1),
        *_arrow((0.0, 0.0), (0.0, 1.5), 1),
        *_arrow((math.sqrt(0.5), math.sqrt(0.5)), (math.sqrt(0.5) - 0.5, math.sqrt(0.5) + 0.5), 2),
        Curve([0.0, -math.sqrt(0.5)], [0.0, -math.sqrt(0.5)], style="dashed", hue=6),
    ]
    words = [(1.55, -0.15, "Y"), (0.15, 1.55, "Z"), (-0.15, -0.5, "ρ"), (0.75, 1.2, "ωρ")]
    left = Panel("million km", "", side, "in the Earth's orbit", (earth - 0.45, 0.7), (-0.9, 0.9), equal=True, notes=notes)
    right = Panel("Earth diameters", "", across, "across X", (-1.8, 1.8), (-1.8, 1.8), equal=True, notes=words)
    return Figure([left, right], 2)


def _arrow(start: tuple[float, float], end: tuple[float, float], hue: int) -> list[Curve]:
    """Return the curves of an arrow."""
    along = np.subtract(end, start)
    size = float(np.hypot(*along))
    ahead, aside = along / size, np.array([-along[1], along[0]]) / size
    barbs = [np.array(end) - 0.16 * size * (ahead + sign * 0.45 * aside) for sign in (1.0, -1.0)]
    line = np.array([start, end, barbs[0], end, barbs[1]]).T
    return [Curve.along(line, hue=hue)]


def figure_3(desk: Desk) -> Figure:
    """Return a figure of the Sun behind the Earth as seen by the craft at some offsets, and of its visible share."""
    here, (sun, earth) = station(), discs()
    panels: list[Panel] = []
    plant = here.plant
    for offset in (0.5, 1.0):
        apart = math.degrees(offset * (1.0 / plant.from_smaller - 1.0 / plant.from_larger))
        shapes = [
            Curve(0.5 * sun * RING[0], 0.5 * sun * RING[1], "Sun", "area", 4),
            Curve(0.5 * earth * RING[0] - apart, 0.5 * earth * RING[1], "Earth", "area", 0),
        ]
        title = f"offset {offset:g} diameter: {100.0 * here.light(offset * EARTH_DIAMETER):.0f} %"
        panels.append(Panel("degrees", "", shapes, title, (-1.0, 0.5), (-0.6, 0.75), equal=True))
    offsets = np.linspace(0.0, 1.2, 121)
    curves = [
        Curve(offsets, sails.lit(2.0 * offsets), "equal discs, formula"),
        Curve(offsets, [here.light(float(one) * EARTH_DIAMETER) for one in offsets], "real discs", "dashed"),
    ]
    panels.append(Panel("offset, Earth diameters", "part of the Sun that is seen", curves, "k(s)"))
    return Figure(panels, 3)


def figure_5(desk: Desk, margin: float, lag_h: float, years: float) -> Figure:
    """Return a figure of a mirror that deflects light sideways, and of the attainable forces, with those that the circle
    demands."""
    flown = fly_sail(desk, margin, lag_h, years)
    shares = flown["asked"][-400:]
    lean = math.radians(float(shares[:, 1].max()))
    normal, along = np.array([math.cos(lean), math.sin(lean)]), np.array([-math.sin(lean), math.cos(lean)])
    panel = [
        Curve.along(np.array([-0.8 * along, 0.8 * along]).T, "mirror", hue=0),
        *(curve for height in (-0.35, 0.0, 0.35) for curve in _arrow((-1.3, height), (-0.15 - 0.5 * height, height), 4)),
        *_arrow((0.0, 0.0), (0.9 * normal[0], 0.9 * normal[1]), 1),
        Curve([0.0, 1.0], [0.0, 0.0], style="dashed", hue=6),
    ]
    bend = np.linspace(0.0, lean, 40)
    panel.append(Curve(0.5 * np.cos(bend), 0.5 * np.sin(bend), hue=6))
    notes = [
        (0.66, 0.17, "γ"),
        (0.92 * normal[0] + 0.12, 0.92 * normal[1] + 0.1, "F"),
        (1.08, -0.1, "X"),
        (-1.0, 0.5, "light"),
    ]
    outline = sails.outline(1.0, 0.0)
    both = np.concatenate([outline, outline[::-1] * [1.0, -1.0]])
    centre, radius = sails.MIRROR_CENTRE, sails.MIRROR_RADIUS
    settings = [(math.cos(cone) ** 2, math.sin(cone), share) for share, cone, _ in shares * [1.0, math.pi / 180.0, 1.0]]
    push = np.array([2.0 * share * c2 * np.array([math.sqrt(c2), s]) for c2, s, share in settings]).T
    reach = [
        Curve.along(both.T, style="area", hue=0),
        Curve(centre + radius * RING[0], radius * RING[1], hue=1),
        Curve([centre], [0.0], style="points", hue=1),
        Curve.along(push, hue=2),
    ]
    names = [(1.09, 0.68, "largest ball"), (1.09, 0.3, "asked for round the circle"), (0.2, -0.6, "all pushes")]
    left = Panel("", "", panel, "F = 2 p S cos²γ along the normal", (-1.4, 1.4), (-1.15, 1.15), equal=True, notes=notes)
    right = Panel(
        "along X, p S",
        "across X, p S",
        reach,
        "within reach of area and angles",
        (-0.1, 2.2),
        (-1.0, 1.0),
        equal=True,
        notes=names,
    )
    return Figure([left, right], 2)
