"""Measures of section 3: the linear model, and flights at the equilibrium and on the circle near L2."""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from starhold.laws import l2_circle
from starhold.laws.interface import NoMemory
from starhold.laws.point import PointMeasurement
from starhold.parts.bodies.libration_point import EARTH_DIAMETER, PRIMARIES, Libration, linear
from starhold.publications.desk import Desk
from starhold.publications.figure import Curve, Figure, Panel
from starhold.publications.verdicts import Finding
from starhold.synthesis.circle import best_rate, demand, peak_required, required

REST, EDGE, DEFICIT = "l2-equilibrium", "near-the-edge", "l2-deficit"
LINES = 0.015
"""The width of two adjacent lines as a share of a picture's width."""


def plant_of(desk: Desk, C: float | None = None) -> Libration:
    """Return the point L2 of the Sun and the Earth, with the printed C where it is given."""
    plant = desk.scenario(DEFICIT).craft
    return plant if C is None else plant._replace(stiffness=C)


def matrix(plant: Libration, feedback: Callable[[PointMeasurement], Any] | None = None) -> Any:
    """Return the matrix (6, 6) of the linear model for position and velocity, with the feedback of a linear law."""
    zero = PointMeasurement((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0, math.inf)
    constant = np.zeros(3) if feedback is None else np.array(feedback(zero))
    whole = np.zeros((6, 6))
    whole[:3, 3:] = np.eye(3)
    for column, unit in enumerate(np.eye(6)):
        position, velocity = tuple(unit[:3]), tuple(unit[3:])
        whole[3:, column] = linear(position, velocity, plant)
        if feedback is not None:
            whole[3:, column] += np.array(feedback(PointMeasurement(position, velocity, 0.0, math.inf))) - constant
    return whole


def stiffness(desk: Desk) -> Finding:
    """Return C of the Sun and the Earth, from their masses and the position of L2."""
    return Finding(plant_of(desk).stiffness, f"without the Moon {PRIMARIES['sun-earth-alone'].point().stiffness:.4f}")


def roots(desk: Desk) -> Finding:
    """Return whether the characteristic polynomial has one positive, one negative and two imaginary roots."""
    whole = matrix(plant_of(desk))
    flat = [0, 1, 3, 4]
    eigenvalues = {"in the plane X, Y": np.linalg.eigvals(whole[np.ix_(flat, flat)]), "with Z": np.linalg.eigvals(whole)}

    def counts(values: Any) -> tuple[int, int, int]:
        still = np.abs(values.real) < 1e-9
        return int((values.real > 1e-9).sum()), int((values.real < -1e-9).sum()), int(still.sum())

    real, turning = eigenvalues["with Z"].real.max(), sorted({round(abs(z.imag), 3) for z in eigenvalues["with Z"]} - {0.0})
    note = f"real roots ±{real:.3f}, imaginary ones ±{' and ±'.join(f'{w:.3f}' for w in turning)}"
    return Finding({where: counts(values) == (1, 1, 2) for where, values in eigenvalues.items()}, note)


def feed_forward(desk: Desk, C: float) -> Finding:
    """Return whether rest at a distance rho along Y and Z takes the control (C - Omega^2) rho and C rho."""
    plant, demands = plant_of(desk, C), {}
    for name in ("beside Y", "beside Z"):
        entry = desk.scenario(REST).pick(name)
        place = (0.0, entry.gains.y, entry.gains.z)
        rest = PointMeasurement(place, (0.0, 0.0, 0.0), 0.0, math.inf)
        command, _ = entry.law.command(rest, entry.gains, plant, NoMemory())
        left = np.add(command, linear(place, (0.0, 0.0, 0.0), plant))
        demands[name] = float(np.linalg.norm(command)) if np.abs(left).max() < 1e-12 else math.nan
    right = abs(demands["beside Y"] - (C - 1.0)) < 1e-12 and abs(demands["beside Z"] - C) < 1e-12
    circle = demand(best_rate(plant), plant)
    note = f"{demands['beside Y']:.2f} and {demands['beside Z']:.2f}; the circle asks for {circle:.2f} at most"
    return Finding(right, note)


def degree(desk: Desk) -> Finding:
    """Return whether each axis has a double root, and any other damping gives a smaller degree of stability."""
    entry, plant = desk.scenario(REST).pick("beside Y"), plant_of(desk)

    def slowest(gains: Any) -> list[float]:
        whole = matrix(plant, lambda measurement: entry.law.command(measurement, gains, plant, NoMemory())[0])
        return [float(np.linalg.eigvals(whole[np.ix_([k, k + 3], [k, k + 3])]).real.max()) for k in range(3)]

    # The Coriolis acceleration is cancelled, so that axes are independent.
    best = slowest(entry.gains)
    others = [slowest(entry.gains._replace(k_velocity=tuple(f * k for k in entry.gains.k_velocity))) for f in (0.9, 1.1)]
    right = all(other[k] > best[k] + 0.01 for other in others for k in range(3))
    return Finding(right, "degrees of stability along X, Y, Z: " + ", ".join(f"{-rate:.3f}" for rate in best))


def _unit(desk: Desk) -> dict[str, Any]:
    """Return changes that give the X axis its unit form: a limit of Omega^2 + 2 C moves the saddles to a distance of 1."""
    plant = plant_of(desk)
    return {"law.beside Y.limit": plant.rate**2 + 2.0 * plant.stiffness}


def saddles(desk: Desk) -> Finding:
    """Return whether the unit form has equilibria at x = -1 and 1, each with one positive and one negative root, and whether
    the law has this form."""
    plant, gains = plant_of(desk), desk.scenario(REST).pick("beside Y").gains
    steep = plant.rate**2 + 2.0 * plant.stiffness
    form = max(abs(gains.k_x / steep - 2.0), abs(gains.k_velocity[0] / math.sqrt(steep) - 2.0)) < 1e-12
    rest = max(abs(_slope(np.array([side, 0.0]))[1]) for side in (-1.0, 1.0)) == 0.0
    return Finding(bool(form and rest), "there x'' = x ∓ 1, of which the roots are ±1")


def _slope(state: Any) -> Any:
    return np.stack([state[1], state[0] + np.clip(-2.0 * state[0] - 2.0 * state[1], -1.0, 1.0)])


def zone_ratio(desk: Desk) -> Finding:
    """Return the largest x at rest from which the craft returns, divided by the largest x at which the control is linear."""
    edge = largest(lambda x: desk.flight(REST, "beside Y", {**_unit(desk), "initial.position": [x, 0.0, 0.0]}).lost is None)
    shown = desk.claims(REST, "beside Y")["saturated-axis"]
    share = shown.numbers["width"] / shown.numbers["boundary"]
    return Finding(edge / 0.5, f"{shown.outcome}: {100.0 * share:.1f} % of the strip between the separatrices comes back")


def largest(comes_back: Callable[[float], bool], high: float = 2.0, steps: int = 16) -> float:
    """Return, by bisection, the largest start that comes back; 0 does, `high` does not."""
    low = 0.0
    for _ in range(steps):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if comes_back(middle) else (low, middle)
    return low


def figure_4(desk: Desk) -> Figure:
    """The phase portrait of the X axis in unit form."""
    from scipy.integrate import solve_ivp

    edge, side = np.linspace(-2.0, 2.0, 21), np.linspace(0.2, 2.0, 10)
    above = np.concatenate([[edge, np.full(21, 2.0)], [np.full(10, -2.0), side]], axis=1)
    starts = np.concatenate([above, -above], axis=1)
    times = np.linspace(0.0, 7.0, 281)
    wide = np.array([-4.0, 4.0, 4.0, -4.0])
    curves = [
        Curve(wide, np.array([1.0, 1.0, -1.0, -1.0]) - wide, "region of attraction", "area", 5),
        Curve(wide, np.array([0.5, 0.5, -0.5, -0.5]) - wide, "linear zone", "area", 0),
    ]
    for start in starts.T:
        path = solve_ivp(lambda _, state: _slope(state), (0.0, 7.0), start, t_eval=times, rtol=1e-7).y
        curves.append(Curve.along(path, style="faint"))
    for k, side in enumerate((-1.0, 1.0)):
        curves.append(Curve([-4.0, 4.0], [side + 4.0, side - 4.0], "" if k else "separatrices", "dashed", 1))
    curves.append(Curve([-1.0, 1.0], [0.0, 0.0], "saddles", "points", 1))
    for k, x in enumerate((0.95, -0.95, 1.05)):
        run = desk.recording(REST, "beside Y", {**_unit(desk), "initial.position": [x, 0.0, 0.0]})
        s = math.sqrt(plant_of(desk).rate ** 2 + 2.0 * plant_of(desk).stiffness)
        curves.append(
            Curve(run["position"][:, 0], run["velocity"][:, 0] / s, "" if k else "flown from x = ±0.95, 1.05", hue=2)
        )
    span = (-2.0, 2.0)
    return Figure([Panel("x", "x'", curves, x_span=span, y_span=span, equal=True)])


def falls(desk: Desk) -> Finding:
    """Return whether V' under (3.7) is -k (f2^2 + f3^2), from the law's equations and in symbols throughout."""
    import sympy

    x, y, z, a, b, c = sympy.symbols("x y z a b c", real=True)
    symbols = sympy.symbols("Omega C rho omega alpha k k_x k_v", positive=True)
    plant = Libration(*symbols[:2], *[sympy.Integer(1)] * 4)
    gains, measurement = l2_circle.Gains(*symbols[2:]), PointMeasurement((x, y, z), (a, b, c), 0.0, math.inf)
    control, V = l2_circle.feedback(measurement, gains, plant), l2_circle.lyapunov(measurement, gains, plant)
    acceleration = [p + q for p, q in zip(linear(measurement.position, measurement.velocity, plant), control, strict=True)]
    rates = zip((x, y, z, a, b, c), (a, b, c, *acceleration), strict=True)
    slope: Any = sum(sympy.diff(V, name) * rate for name, rate in rates)
    _, f2, f3 = l2_circle.errors(measurement, gains)
    return Finding(bool(sympy.simplify(slope + gains.k * (f2**2 + f3**2)) == 0), "an identity in state, gains, Omega and C")


def indicator(desk: Desk) -> Finding:
    """Return whether the law's certificate proves that the circle attracts, with the level of V."""
    circle = desk.claims("l2-circle", "smooth")["circle"]
    note = f"{circle.outcome} up to V = {circle.numbers['level']:.7g}; on the axis, where V = 0.5, V' is zero too"
    return Finding(circle.outcome == "proved", note)


def relay(desk: Desk) -> Finding:
    """Return whether the relay brings the craft to the circle, with and without a boundary layer."""
    laws = {"with a layer": "relay with layer", "without one": "relay"}
    off = {name: _off(desk.flight("l2-circle", law)) for name, law in laws.items()}
    outcome = desk.claims("l2-circle", "relay")["circle"].outcome
    note = f"off by {off['with a layer']:.4f} and {off['without one']:.4f} radii after two years; without a layer {outcome}"
    return Finding({name: value < 0.005 for name, value in off.items()}, note)


def steepest(desk: Desk) -> Finding:
    """Return whether the control that minimizes V' brings the craft to the circle, for (3.5) and for a V with a pull towards
    the circle."""
    changes = {"V with a pull towards the circle": None, "V of (3.5)": {"law.l2-optimal.pull": 1e-9}}
    off = {name: _off(desk.flight("l2-circle", "l2-optimal", change)) for name, change in changes.items()}
    note = "off by " + " and ".join(f"{value:.3f}" for value in off.values()) + " radii after two years"
    return Finding({name: value < 0.005 for name, value in off.items()}, note)


def at_the_axis(desk: Desk, C: float) -> Finding:
    """Return whether the nominal control is largest where y = 0 for every rate, and its peak follows the formula."""
    plant = plant_of(desk, C)
    right: list[bool] = []
    for rate in (0.5, 1.0, best_rate(plant), 2.0, 3.0):
        sizes = [np.linalg.norm(required(phase, rate, 1.0, plant)) for phase in np.linspace(0.0, np.pi, 181)]
        peak = peak_required(rate, 1.0, plant)
        right.append(int(np.argmax(sizes)) == 90 and abs(peak / demand(rate, plant) - 1.0) < 1e-9)
    return Finding(all(right), "going round circles of five rates")


def extremes(desk: Desk, C: float) -> Finding:
    """Return whether the peak demand has a local maximum at rate 0 and its minimum at sqrt(C - 2 Omega^2)."""
    from scipy.optimize import minimize_scalar

    plant = plant_of(desk, C)
    least: Any = minimize_scalar(
        lambda rate: demand(rate, plant), bounds=(0.1, 4.0), method="bounded", options={"xatol": 1e-9}
    )
    top = demand(1e-3, plant) < demand(0.0, plant)
    note = f"{demand(0.0, plant):.3f} at rate 0, {float(least.fun):.3f} at {float(least.x):.4f}"
    return Finding(top and abs(float(least.x) - best_rate(plant)) < 1e-6, note)


def rate(desk: Desk, C: float) -> Finding:
    """Return the rate at which the circle has the smallest demand."""
    return Finding(best_rate(plant_of(desk, C)))


def factor(desk: Desk, C: float) -> Finding:
    """Return the peak demand per unit of radius at the best rate, by the printed formula."""
    plant = plant_of(desk, C)
    turning = best_rate(plant)
    return Finding(demand(turning, plant), f"2 Omega omega, its Coriolis part, is {2.0 * turning:.4f}")


def holds_with(desk: Desk, law: str) -> Finding:
    """Return whether a law of `l2-deficit` keeps the circle to a hundredth of its radius."""
    flight = desk.flight(DEFICIT, law)
    if flight.lost is not None:
        return Finding(False, f"lost after {flight.lost / 86400.0:.0f} days")
    return Finding(_off(flight) < 0.01, f"off by {_off(flight):.4f} radii")


def coriolis_share(desk: Desk, C: float, least: float) -> Finding:
    """Return whether the Coriolis acceleration is more than a share of the peak demand."""
    plant = plant_of(desk, C)
    share = 2.0 * best_rate(plant) / demand(best_rate(plant), plant)
    return Finding(share > least, f"{100.0 * share:.0f} % of the norm where it is largest")


def farthest(desk: Desk) -> Finding:
    """Return whether the craft returns to the circle from x close to the largest such x, towards and away from the Sun."""
    dark, sun = (side * largest(lambda x, s=side: _from(desk, s * x).lost is None, 1.0) for side in (1.0, -1.0))
    off = max(_off(_from(desk, 0.99 * x)) for x in (dark, sun))
    note = f"from x = {sun:.3f} to {dark:.3f}; started 1 % within that, off by {off:.4f} radii after two years"
    return Finding(off < 0.001, note)


def _off(flight: Any) -> float:
    """Return the distance of a flight from the circle, in radii."""
    return flight.metrics["deviation"] / EARTH_DIAMETER


def _from(desk: Desk, x: float) -> Any:
    return desk.flight(EDGE, "circle", {"initial.position": [x, 0.0, 0.0]})


def deficit(desk: Desk, law: str, tells: str) -> Finding:
    """Return whether under a deficit x is not zero ("x"), the path is not the circle ("circle"), or the control repeatedly
    saturates ("limit")."""
    flight = desk.flight(DEFICIT, law)
    position, control = flight.recording["position"], flight.recording["command"]
    half = len(position) // 2
    if tells == "x":
        most = flight.metrics["largest_x"] / EARTH_DIAMETER
        return Finding(most > 0.01, f"|x| up to {most:.3f} radii")
    if tells == "circle":
        radii = np.hypot(position[half:, 1], position[half:, 2])
        return Finding(float(np.ptp(radii)) > 0.01, f"{radii.min():.3f} to {radii.max():.3f} radii from the X axis")
    full = np.linalg.norm(control[half:], axis=1) >= desk.scenario(DEFICIT).pick(law).options.limit * (1.0 - 1e-9)
    begun = np.flatnonzero(np.diff(full.astype(int)) == 1) * 0.01
    turn = 2.0 * math.pi / best_rate(plant_of(desk))
    share, times = flight.metrics["limit_share"], len(begun)
    note = f"{times} times in two years, {100.0 * share:.0f} % of the time; half a revolution takes {turn / 2.0:.2f}"
    return Finding(times >= 4, note + f", between two onsets {np.diff(begun).min():.2f} to {np.diff(begun).max():.2f} pass")


def lag_hours(desk: Desk, lag: float) -> Finding:
    """Return the duration (h) of a lag given in the unit of time in which a year is 2 pi."""
    time = desk.scenario(DEFICIT).table.libration.units.time
    half_a_day = 43200.0 / time
    return Finding(lag * time / 3600.0, f"12 h are {half_a_day:.4f}, or {half_a_day / (2.0 * math.pi):.4f} of a year")


def settles(desk: Desk, lag_h: float, days: float, left: float) -> Finding:
    """Return whether a first-order lag leaves less than the share `left` of a step after `days` days."""
    remains = math.exp(-days * 24.0 / lag_h)
    return Finding(remains < left, f"after {days:g} days {100.0 * remains:.0f} % of a turn remains")


def alike(desk: Desk, lags: Sequence[float]) -> Finding:
    """Return for each lag whether figures 6 and 7 look as they do without it, with lines nowhere two widths apart."""
    notes: list[str] = []
    cases: dict[str, bool] = {}
    for lag in lags:
        apart = [_apart(desk, *flight, lag) for flight in ((EDGE, "circle"), (DEFICIT, "deficit 10"))]
        cases[f"T = {lag:g}"] = max(apart) < LINES
        notes.append(f"{100.0 * apart[0]:.1f} and {100.0 * apart[1]:.1f} % for T = {lag:g}")
    return Finding(cases, "lines apart in figures 6 and 7, of their width: " + "; ".join(notes))


def _lagging(law: str, lag: float) -> dict[str, Any]:
    return {f"law.{law}.lag": lag, "simulation.substeps": 2}


def _apart(desk: Desk, file: str, law: str, lag: float) -> float:
    changes = _lagging(law, lag)
    return farthest_place(desk.recording(file, law)["position"], desk.recording(file, law, changes)["position"])


def farthest_place(path: Any, other: Any) -> float:
    """Return the largest distance of another path (m, 3) from a path (n, 3), in x, y and in y, z, as a share of the
    picture's width."""
    from scipy.spatial import KDTree

    wide = np.ptp(path, axis=0)
    distances = [KDTree(path[:, pair] / wide[pair]).query(other[:, pair] / wide[pair])[0].max() for pair in ([0, 1], [1, 2])]
    return float(max(distances))


def figure_6(desk: Desk) -> Figure:
    """Return projections of motion and control at zero control margin, from close to the largest x in both directions."""
    runs = {f"x = {x:g}": _from(desk, x).recording for x in (0.5, -0.22)}
    return Figure([*_planes(runs, desk.scenario(EDGE).pick("circle").options.limit)], 3)


def figure_7(desk: Desk, law: str) -> Figure:
    """Return projections as in figure 6, with a deficit and starting on the circle."""
    return Figure(_planes({law: desk.recording(DEFICIT, law)}, desk.scenario(DEFICIT).pick(law).options.limit), 3)


def lag_figure(desk: Desk, lags: Sequence[float], after: float) -> Figure:
    """Return figure 7 with and without lags, from a time on."""
    runs = {"no lag": desk.recording(DEFICIT, "deficit 10")}
    runs |= {f"T = {lag:g}": desk.recording(DEFICIT, "deficit 10", _lagging("deficit 10", lag)) for lag in lags}
    both = ("position", "control")
    kept = {name: {key: run[key][run["time"] >= after] for key in both} for name, run in runs.items()}
    return Figure(_planes(kept, desk.scenario(DEFICIT).pick("deficit 10").options.limit), 3)


def _planes(runs: dict[str, Any], limit: float) -> list[Panel]:
    """Return panels of (x, y) and (y, z) with the circle, and of (u_y, u_z) with the limit, as published."""
    turn = np.linspace(0.0, 2.0 * np.pi, 181)
    round_ = np.array([np.cos(turn), np.sin(turn)])
    pairs = (("position", 0, 1), ("position", 1, 2), ("control", 1, 2))
    panels: list[Panel] = []
    for k, (quantity, i, j) in enumerate(pairs):
        name = "u_" if quantity == "control" else ""
        labels = runs if not k or len(runs) == 1 else [""] * len(runs)
        paths = [run[quantity][:, [i, j]].T for run in runs.values()]
        lines = [Curve.along(path, label, hue=n) for n, (path, label) in enumerate(zip(paths, labels, strict=True))]
        guides = ([], [Curve.along(round_, "circle", "dashed", 6)], [Curve.along(limit * round_, "limit", "dashed", 6)])[k]
        panels.append(Panel(name + "xyz"[i], name + "xyz"[j], [*lines, *guides], equal=k > 0))
    return panels
