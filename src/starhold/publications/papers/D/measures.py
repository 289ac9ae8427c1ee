"""Measures of this publication's slews: the roots that slew fastest within limits, fits through them, the printed slew, and
the effects of the control period and of external torque on it. Measures of its linear model are in `placement`."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq

from starhold.algebra.vector import ZERO
from starhold.analysis.rigid_body import error_angle
from starhold.analysis.roots import PUBLISHED, TwoPieceFit
from starhold.analysis.transient import Limits
from starhold.laws.interface import Measurement
from starhold.parts.craft import tensor
from starhold.publications.desk import Desk
from starhold.publications.figure import Curve, Figure, Panel
from starhold.publications.verdicts import Finding
from starhold.studies.modal_roots import Study, pick_modal, problem_of, study
from starhold.trace.straight_line import evaluated

DEGREES = 180.0 / math.pi
SHORT = 0.002
"""The control step (s) that approximates the limit h -> 0 where roots are searched to 0.001."""
POINTS = {"below": (10.0, 45.0, 85.0), "above": (85.0, 135.0, 180.0)}
"""The angles (deg) of the points through which each piece of the published fit passes."""
TIGHT = 0.997
"""The share of a limit above which the limit counts as binding."""


def searched(desk: Desk) -> Study:
    """Return the search of the built-in scenario `landing-limits`: every 5 degrees, every root of [-3, 0) to 0.001."""
    scenario = desk.scenario("landing-limits")
    return desk.once(("searched",), lambda: study(scenario, pick_modal(scenario, "published")))


def fine_roots(desk: Desk) -> dict[float, float]:
    """Return the best roots (1/s) at the points (deg) of the published fit, with the torque held for SHORT at most."""

    def make() -> dict[float, float]:
        angles = sorted({angle for points in POINTS.values() for angle in points})
        changes = {"simulation.control_period": SHORT, "transient.angles": [f"{angle:g} deg" for angle in angles]}
        scenario = desk.scenario("landing-limits", changes)
        result = study(scenario, pick_modal(scenario, "published"))
        return dict(zip(angles, result.roots.tolist(), strict=True))

    return desk.once(("fine roots",), make)


def through(angles: ArrayLike, roots: ArrayLike) -> tuple[float, float, float]:
    """Return c, d, e of the curve c exp(d angle) + e, with d < 0, through three points (rad, 1/s) of decreasing slope."""
    x, y = np.asarray(angles, dtype=float), np.asarray(roots, dtype=float)

    def misses(d: float) -> float:
        first, second, third = np.exp(d * (x - x[0]))
        return float((first - second) * (y[1] - y[2]) - (second - third) * (y[0] - y[1]))

    # Beyond these ends the second step is negligible compared with the first, or the curve is a line.
    root: Any = brentq(misses, -50.0 / (x[2] - x[0]), -1e-6, xtol=1e-13)
    d = float(root)
    c = float((y[0] - y[1]) / (np.exp(d * x[0]) - np.exp(d * x[1])))
    return c, d, float(y[0] - c * math.exp(d * x[0]))


def three_point_fit(roots: Mapping[float, float]) -> TwoPieceFit:
    """The fit through roots (1/s) at the published points (deg)."""
    below, above = (through(np.radians(points), [roots[point] for point in points]) for points in POINTS.values())
    return TwoPieceFit(below, above, PUBLISHED.split)


def coefficients(desk: Desk, piece: str) -> Finding:
    """The printed positive numbers of a piece of (5.7): -c, -d, -e."""
    return _piece(fine_roots(desk), piece)


def in_whole_steps(desk: Desk, piece: str, step: float) -> Finding:
    """Return the numbers of a piece from roots whose times are counted in whole steps (s); of tied roots the slowest
    counts."""
    return _piece(_counted(desk, step), piece)


def no_other_step(desk: Desk, steps: Sequence[float]) -> Finding:
    """Return whether times counted in any other step (s) fail to give all six printed numbers."""
    printed = np.array([PUBLISHED.below, PUBLISHED.above])
    fits = {step: three_point_fit(_counted(desk, step)) for step in steps}
    giving = [step for step, f in fits.items() if (np.abs(np.array([f.below, f.above]) - printed) < 5e-4).all()]
    return Finding(not giving, f"tried: {', '.join(f'{step:g}' for step in steps)} s")


def off_the_printed_fit(desk: Desk, share: float) -> Finding:
    """Return whether the printed fit is within a share of the best roots, within the limits and with their tolerances."""
    search = searched(desk)
    hard, eased = (np.abs(PUBLISHED.errors(search.angles, roots)) for roots in (search.roots, _eased(search)))
    note = f"off by at most {100 * hard.max():.2f} %, and by {100 * eased.min():.1f} to {100 * eased.max():.1f} %"
    return Finding({"within the limits": bool(hard.max() < share), "with the tolerances": bool(eased.max() < share)}, note)


def least_squares(desk: Desk) -> Finding:
    """Return whether the least-squares fit through all roots is nearer to them than the printed one, rms and at worst."""
    search = searched(desk)
    assert search.fitted is not None
    fitted, printed = (np.abs(pieces.errors(search.angles, search.roots)) for pieces in (search.fitted, PUBLISHED))
    means = [100.0 * math.sqrt(float(np.mean(errors**2))) for errors in (fitted, printed)]
    c, d, e = search.fitted.below
    f, g, h = search.fitted.above
    split = search.fitted.split * DEGREES
    return Finding(
        bool(means[0] < means[1] and fitted.max() < printed.max()),
        f"{c:.3f} exp({d:.3f}ϑ) {e:+.3f} up to {split:g}°, {f:.3f} exp({g:.3f}ϑ) {h:+.3f} beyond: {means[0]:.2f} % rms, "
        f"{100 * fitted.max():.2f} % at most; the printed one {means[1]:.2f} %, {100 * printed.max():.2f} %",
    )


def which_limit(desk: Desk) -> Finding:
    """Return whether the acceleration limit is binding up to 85 degrees and the rate limit beyond, at every angle
    searched."""
    limits, results = _limits(desk), searched(desk).results
    decides: list[bool] = []
    for item in results:
        assert item.hard is not None
        seen = item.hard.transient
        shares = max(seen.peak_acceleration) / limits.acceleration, seen.peak_rate / limits.rate
        near, far = shares if item.angle < math.radians(87.5) else shares[::-1]
        decides.append(near > TIGHT and near > far)
    return Finding(all(decides), f"{sum(decides)} of {len(decides)} angles")


def inside_the_interval(desk: Desk) -> Finding:
    """Return whether every best root lies inside [-3, 0), with and without tolerances, and the next faster one breaks a
    limit."""
    scenario, search = desk.scenario("landing-limits"), searched(desk)
    problem, limits = problem_of(scenario, scenario.pick("published")), _limits(desk)
    every = np.r_[search.roots, _eased(search)]
    faster = [
        problem.fly(angle, [root - 1e-3])[0].keeps(limits) for angle, root in zip(search.angles, search.roots, strict=True)
    ]
    return Finding(
        bool(every.min() > -2.9 and every.max() < -0.1) and not any(faster), f"{every.min():g} to {every.max():g} 1/s"
    )


def printed_fit_flies(desk: Desk) -> Finding:
    """Return whether slews with the printed fit's roots keep the limits, without and with the smallest printed
    tolerances."""
    scenario, search = desk.scenario("landing-limits"), searched(desk)
    problem, hard = problem_of(scenario, scenario.pick("published")), _limits(desk)
    eased = Limits(hard.rate + math.radians(2.0), hard.acceleration + math.radians(3.0))
    flown = [problem.fly(angle, [root])[0] for angle, root in zip(search.angles, PUBLISHED.at(search.angles), strict=True)]
    longer = [one.time / item.hard.time for one, item in zip(flown, search.results, strict=True) if one.time and item.hard]
    rate, swing = max(one.peak_rate for one in flown), max(max(one.peak_acceleration) for one in flown)
    return Finding(
        {
            "within 2 °/s and 3 °/s²": all(one.keeps(eased) for one in flown),
            "without tolerance": all(one.keeps(hard) for one in flown),
        },
        f"{rate * DEGREES:.2f} °/s and {swing * DEGREES:.2f} °/s² at most; {100 * (max(longer) - 1):.1f} % longer at worst",
    )


def roots_over_angle(desk: Desk) -> Figure:
    """Return a figure of the best roots with the printed fit, the fit through our roots at its points, and the least-squares
    fit."""
    best = searched(desk)
    assert best.fitted is not None
    at = best.angles * DEGREES
    dense = np.linspace(10.0, 180.0, 341)
    fits = [("(5.7) as printed", PUBLISHED, "dashed"), ("through three points", three_point_fit(fine_roots(desk)), "line")]
    drawn: list[Any] = [*fits, ("least squares", best.fitted, "dotted")]
    points = Curve(at, -best.roots, "best within the limits", "points", 0)
    lines = [Curve(dense, -f.at(np.radians(dense)), name, style, n) for n, (name, f, style) in enumerate(drawn, 1)]
    errors = [
        Curve(at, 100.0 * f.errors(best.angles, best.roots), name, style, n) for n, (name, f, style) in enumerate(drawn, 1)
    ]
    return Figure(
        [
            Panel("initial angle, deg", "−a, 1/s", [points, *lines]),
            Panel("initial angle, deg", "off the best root, %", errors, levels=[0.0]),
        ]
    )


def times_over_angle(desk: Desk) -> Figure:
    """The least transient times, within the limits and with their tolerances."""
    search = searched(desk)
    hard, eased = ([getattr(item, kind).time for item in search.results] for kind in ("hard", "eased"))
    at = search.angles * DEGREES
    curves = [Curve(at, hard, "within the limits"), Curve(at, eased, "with 3 °/s and 5 °/s² more", "dashed")]
    return Figure([Panel("initial angle, deg", "least transient time, s", curves, y_span=(0.0, 30.0))])


def start(desk: Desk) -> Finding:
    """Return the initial angle (deg) of the printed slew."""
    attitude = np.array(desk.recording("landing", "rounded")["attitude_error"])[0]
    return Finding(float(error_angle(attitude)) * DEGREES)


def fitted_root(desk: Desk) -> Finding:
    """The root (1/s) that (5.7) gives at that angle."""
    return Finding(float(PUBLISHED.at([start(desk).value / DEGREES])[0]))  # type: ignore[operator]


def turn(desk: Desk, law: str, wanted: Sequence[str], changes: Mapping[str, Any] | None = None) -> Finding:
    """Return numbers of a slew: "time" (s), "rate" (deg/s), "accelerations" (deg/s2, three)."""
    flown = desk.flight("landing", law, changes).metrics
    numbers: dict[str, list[float]] = {
        "time": [flown["transient_time"]],
        "rate": [flown["peak_rate"] * DEGREES],
        "accelerations": [part * DEGREES for part in flown["peak_accelerations"]],
    }
    return Finding([number for name in wanted for number in numbers[name]])


def limits_kept(desk: Desk) -> Finding:
    """Return whether the printed turn keeps the limits without their tolerances."""
    return Finding(bool(desk.flight("landing", "fit").metrics["limits_kept"]), "without tolerances")


def one_root_for_all(desk: Desk, peaks: Sequence[str], time: str) -> Finding:
    """Return whether some root that rounds to -0.428 gives all printed peaks, digit by digit, but no such root the printed
    time."""
    scenario = desk.scenario("landing", {"simulation.control_period": 0.001})
    roots = np.linspace(-0.4285, -0.4275, 101)
    flown = problem_of(scenario, scenario.pick("rounded")).fly(scenario.table.transient.angles[0], roots)
    seen = DEGREES * np.vstack([flown.peak_rate, flown.peak_acceleration])
    halves = [(float(text), 0.5 * 10.0 ** -len(text.partition(".")[2])) for text in (*peaks, time)]
    all_peaks = np.all([np.abs(row - at) <= half for row, (at, half) in zip(seen, halves, strict=False)], axis=0)
    on_time = np.abs(flown.time - halves[-1][0]) <= halves[-1][1]
    note = f"{roots[all_peaks].min():.5f} to {roots[all_peaks].max():.5f}" if all_peaks.any() else "none"
    return Finding(bool(all_peaks.any() and not on_time.any()), f"{note}; times of {flown.time.min():.2f} s and more")


def faster_root(desk: Desk) -> Finding:
    """Return whether the root searched for exactly this start ends the slew sooner within the limits."""
    ours, fit = (desk.flight("landing", law).metrics for law in ("searched", "fit"))
    note = f"a = −0.454: {ours['transient_time']:.2f} s, {ours['peak_rate'] * DEGREES:.2f} °/s"
    return Finding(bool(ours["limits_kept"] and ours["transient_time"] < fit["transient_time"] - 1.0), note)


def scalar_root(desk: Desk, share: float) -> Finding:
    """Return whether the transient time with b = -0.01 differs by less than a share from that with a negligible b."""
    time, without = (
        desk.flight("landing", "rounded", {"law.rounded.b": b}).metrics["transient_time"] for b in (-0.01, -1e-6)
    )
    return Finding(bool(abs(time / without - 1.0) < share), f"{time:.2f} s beside {without:.2f} s for b → 0")


def periods(desk: Desk, seconds: Sequence[float]) -> Finding:
    """Return whether the printed turn keeps the limits without tolerance when its torque is held for each of these times
    (s)."""
    flown = {h: _held(desk, h) for h in seconds}
    note = ", ".join(
        f"{h:g} s: {seen['transient_time']:.1f} s, {seen['peak_rate'] * DEGREES:.1f} °/s"
        if seen["transient_time"] is not None
        else f"{h:g} s: does not end"
        for h, seen in flown.items()
    )
    return Finding({f"h = {h:g} s": bool(seen["limits_kept"]) for h, seen in flown.items()}, note)


def period_of_linear_motion(desk: Desk, at_least: float) -> Finding:
    """Return whether the linear motion near rest is proved stable for every control period up to `at_least` (s)."""
    claim = desk.claims("landing", "rounded")["sampling"]
    longest = claim.numbers["longest"]
    return Finding(
        bool(claim.outcome == "proved" and claim.numbers["every_shorter"] and longest > at_least), f"{longest:.3f} s"
    )


def over_periods(desk: Desk, seconds: Sequence[float]) -> Figure:
    """Transient time and peaks of the printed turn over the control period."""
    flown = [_held(desk, h) for h in seconds]
    drawn = [seen["transient_time"] for seen in flown], [seen["peak_rate"] * DEGREES for seen in flown]
    times, rates = ([Curve(seconds, y, "", style, n) for style in ("line", "points")] for n, y in enumerate(drawn))
    above, below = Panel("h, s", "transient time, s", times), Panel("h, s", "peak rate, deg/s", rates, levels=[30.0])
    return Figure([replace(above, log_x=True), replace(below, log_x=True)], columns=2)


def known_torque(desk: Desk) -> Finding:
    """Return whether the residual error under the gravity gradient is less than a thousandth of the error that this torque
    would cause if the law did not know it."""
    scenario = desk.scenario("known-torque")
    inertia, orbit = tensor(scenario.craft.inertia), np.array(desk.recording("known-torque", "modal")["position"])[-1]
    # At the target the body's axes are the inertial ones.
    size = np.linalg.norm(orbit)
    torque = 3.0 * scenario.craft.gravity / size**5 * np.cross(orbit, inertia @ orbit)
    left = _left(inertia, torque, _root(scenario))
    seen = float(desk.flight("known-torque", "modal").metrics["final_attitude_error"])
    return Finding(seen < 1e-3 * left, f"{seen:.0e} rad left; {left:.0e} rad if the law did not know it")


def unknown_torque(desk: Desk) -> Finding:
    """Return whether the residual error under an unknown torque M is 2 asin |J^-1 M / 2a^2|."""
    scenario = desk.scenario("unknown-torque")
    torque = np.array(next(part for part in scenario.parts if part.name == "constant-torque").params.torque)
    left = _left(tensor(scenario.craft.inertia), torque, _root(scenario))
    seen = float(desk.flight("unknown-torque", "modal").metrics["final_attitude_error"])
    return Finding(abs(seen / left - 1.0) < 1e-6, f"{seen * DEGREES:.4f}° flown, {left * DEGREES:.4f}° by the formula")


def inside_the_region(desk: Desk) -> Finding:
    """Return whether the printed start is inside the proved sets for every quaternion sign policy."""
    run = desk.recording("landing", "rounded")
    attitude, rate = (tuple(np.array(run[name])[0].tolist()) for name in ("attitude_error", "rate_error"))
    measured = Measurement(attitude, rate, rate, ZERO, ZERO, ZERO, ZERO, 0.0)
    levels: dict[str, tuple[float, float]] = {}
    for policy in ("as_published", "hysteresis"):
        claim = desk.claims("landing", "rounded", {"law.rounded.quaternion_sign": policy})["region"]
        if claim.proof is None or claim.outcome != "proved":
            return Finding(False, f"{policy}: {claim.outcome}")
        levels[policy] = float(evaluated(claim.proof.roles["lyapunov"], measurement=measured)[0]), claim.numbers["level"]
    words = "; ".join(f"{policy}: V = {value:.3f} of {level:.3f}" for policy, (value, level) in levels.items())
    return Finding(all(value < level for value, level in levels.values()), words)


def _counted(desk: Desk, step: float) -> dict[float, float]:
    """Return the best roots (1/s) at the published points (deg) by times in whole steps (s), the slowest of tied ones."""

    def make() -> dict[float, tuple[NDArray[np.float64], NDArray[np.float64]]]:
        limits, times = _limits(desk), dict[float, tuple[NDArray[np.float64], NDArray[np.float64]]]()
        # Times at h = 0, from those at two periods: the effect of holding the torque is of first order in the period.
        scenarios = [desk.scenario("landing-limits", {"simulation.control_period": h}) for h in (0.001, 0.002)]
        near, far = (problem_of(scenario, scenario.pick("published")) for scenario in scenarios)
        for angle, root in fine_roots(desk).items():
            roots: NDArray[np.float64] = np.arange(-4.0, 30.0) * 1e-3 + root
            flown, longer = (problem.fly(math.radians(angle), roots) for problem in (near, far))
            times[angle] = roots, np.where(flown.within(limits), 2.0 * flown.time - longer.time, np.inf)
        return times

    best: dict[float, float] = {}
    for angle, (roots, times) in desk.once(("times near the best roots",), make).items():
        counted = np.ceil(times / step)
        best[angle] = float(roots[np.flatnonzero(counted == counted.min())[-1]])
    return best


def _piece(roots: Mapping[float, float], piece: str) -> Finding:
    points = ", ".join(f"{roots[point]:.3f} at {point:g}°" for point in POINTS[piece])
    return Finding([-number for number in getattr(three_point_fit(roots), piece)], f"through {points}")


def _held(desk: Desk, period: float) -> dict[str, Any]:
    changes = {"simulation.control_period": period, "simulation.substeps": max(1, round(period / 0.05))}
    return desk.flight("landing", "rounded", changes).metrics


def _left(inertia: NDArray[np.float64], torque: NDArray[np.float64], a: float) -> float:
    """Return the angle (rad) at which the law balances an unknown torque M (3,; N m): 2a^2 q = J^-1 M."""
    return 2.0 * math.asin(float(np.linalg.norm(np.linalg.solve(inertia, torque))) / (2.0 * a * a))


def _root(scenario: Any) -> float:
    return float(scenario.pick("modal").gains.phi_0[0])


def _limits(desk: Desk) -> Limits:
    table: Any = desk.scenario("landing-limits").table.transient
    return Limits(table.rate_limit, table.acceleration_limit)


def _eased(search: Study) -> NDArray[np.float64]:
    return np.array([math.nan if item.eased is None else item.eased.root for item in search.results])
