"""A fit to telemetry with exact slopes, beside SciPy's `least_squares` with finite differences over the same flights.

A tumbling CubeSat with gyro and magnetometer for ten minutes, a sample a second: its inertia, the gyro's bias, and the start
are fitted. SciPy flies starhold's own compiled loop, one lane without slopes, once for each number and step. Both begin
where multiple shooting has led, near the end. Finite differences stop before the least squares: the sums are printed.
The processor's time is counted, the fastest of several rounds; the ratios are of one run.

Run: python benchmarks/identify.py
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from common import header, interleaved, show
from starhold.loop.kernels import Kernel, numbers_of
from starhold.scenario.building import build
from starhold.scenario.reading import parse
from starhold.simulation.lane import fly, label
from starhold.studies.fitting import START, Free, Predictor
from starhold.studies.identify import Fit
from starhold.studies.telemetry import read

SCENARIO = """
name = "tumble"
spacecraft.inertia = [0.05, 0.065, 0.025]
orbit = { altitude = "500 km", inclination = "97.4 deg", epoch = "2026-03-20T12:00:00Z" }
initial.rate = [0.1, -0.09, 0.11]
environment.gravity_gradient = true
simulation = { duration = 600.0, control_period = 1.0, substeps = 2 }
part = [
  { type = "gyro", noise = 1e-4, bias = [3e-4, -2e-4, 3e-4] },
  { type = "magnetometer", noise = "100 nT" },
  { type = "residual-dipole", dipole = [0.05, -0.03, 0.04] },
]
law = [{ type = "pd", k_rate = 1e-12, k_attitude = 1e-12 }]
"""
KEYS = ("spacecraft.inertia", "part.gyro.bias")


def flown(fit: Fit) -> Callable[[Any], Any]:
    """The residuals of a flight without slopes, of one lane."""
    predictor = fit.predictor
    begin, fly = (Kernel(program, 1) for program in predictor.programs)
    like, record = np.array(numbers_of(predictor.loop.carry())), np.empty((fit.steps + 1, predictor.row))

    def residuals(x: Any) -> Any:
        memory = {"carry": like.copy(), "free": np.ascontiguousarray(x)}
        begin(memory)
        fly(predictor.constant | memory | {"record": record, "given": fit.commands}, 0, fit.steps + 1)
        off = [(record[:, one.reading.rows] - one.rows) @ one.whiten.T for one in fit.weighed]
        return np.concatenate([part.ravel() for part in off])

    return residuals


def main() -> None:
    """Print the times of slopes and of fits, and how far the two estimates are apart."""
    scenario = parse(SCENARIO, "tumble.toml")
    loop = build(scenario, scenario.laws[0])
    telemetry = read(scenario, loop, label(loop, *fly(loop, 600), 1).dataset())
    predictor = Predictor(scenario, scenario.laws[0], Free.of(scenario, KEYS), True)
    fit = Fit(scenario, predictor, telemetry)
    begun = predictor.begun(loop.start.attitude, loop.start.rate)
    count, residuals = predictor.count, flown(fit)
    begun[3:count] += 1e-4 * np.abs(begun[3:count]) * np.random.default_rng(1).standard_normal(count - 3)

    def exact() -> Any:
        return fit.descended(begun)[0]

    def differences() -> Any:
        other = least_squares(
            lambda y: residuals(np.append(y, begun[count:])), begun[:count], x_scale="jac", ftol=1e-13, xtol=1e-13
        )
        return predictor.moved(np.append(other.x, begun[count:]), np.zeros(count))

    def jacobian() -> Any:
        step = 1e-8 * np.maximum(1.0, np.abs(begun[:count]))
        now = residuals(begun)
        return [(residuals(begun + np.pad(h * np.eye(count)[k], (0, 4))) - now) / h for k, h in enumerate(step)]

    spent = interleaved({
        "slopes, exact": lambda: fit.residuals(predictor(begun, fit.steps, fit.commands)),
        "slopes, differences": jacobian,
        "fit, exact": exact,
        "fit, least_squares": differences,
    }, 3)  # fmt: skip
    print(header("scipy"))
    rows = [[name, f"{1e3 * time.work:.1f}"] for name, time in spent.items()]
    show(["600 steps, 12 free numbers", "ms"], rows)
    for what, other in (("slopes", "differences"), ("fit", "least_squares")):
        print(f"{what}: {spent[f'{what}, {other}'].work / spent[f'{what}, exact'].work:.2f} times as fast")
    one, other = exact(), differences()
    sums = [float(values @ values) for values in map(residuals, (one, other))]
    deviations = fit.identified(one, predictor(one, fit.steps, fit.commands), 0, True).posterior.deviations
    apart = np.abs(one - other)[len(START) : count] / deviations
    print(f"Sums of squares: {sums[0]:.4f} and, by differences, {sums[1]:.4f}, up to {apart.max():.1e} deviations apart.")


if __name__ == "__main__":
    main()
