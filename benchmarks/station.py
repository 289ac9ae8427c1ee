"""A year on the circle round L2 in the full three-body problem: one lane and many, beside SciPy with the same control, held
as long, and beside SciPy in continuous time. The end states are compared first."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from common import header, interleaved, show
from starhold.algebra.structure import flatten
from starhold.algebra.vector import ZERO
from starhold.laws import l2_circle
from starhold.laws.catalogue import catalogue
from starhold.laws.interface import NoMemory
from starhold.laws.point import PointMeasurement
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.bodies.libration_point import PRIMARIES, PointState, make_libration, nonlinear
from starhold.parts.catalogue import fit
from starhold.simulation.lane import fly
from starhold.simulation.lanes import simulate_many

EARTH = PRIMARIES["sun-earth"]
PLANT = make_libration(EARTH.larger, EARTH.smaller, EARTH.separation)
GAINS = l2_circle.design(PLANT, l2_circle.Best(1.0, model=1))
START = PointState((0.02, 1.05, 0.0), (0.0, 0.0, GAINS.rate), ZERO)
STEPS, LANES = 6283, 2048
PERIOD = 2.0 * math.pi / STEPS
LAW = catalogue("libration-point")["l2-circle"]
LOOP = ClosedLoop(PLANT, LAW, GAINS, START, PERIOD, parts=(fit("environment", "three-body-gravity"),), limit="none")
STARTS = np.repeat(np.array(flatten(START))[:, None], LANES, axis=1)
STARTS[1] += np.linspace(-0.1, 0.1, LANES)


def control(x: Any) -> Any:
    """The law's control at a state."""
    return l2_circle.control(PointMeasurement(tuple(x[:3]), tuple(x[3:]), PERIOD, math.inf), GAINS, PLANT, NoMemory())[0]


def held() -> Any:
    """SciPy from one control instant to the next."""
    x = np.array([*START.position, *START.velocity])
    for _ in range(STEPS // 20):
        u = np.array(control(x.tolist()))

        def rates(t: float, y: Any, u: Any = u) -> list[float]:
            return [*y[3:], *(np.array(nonlinear(tuple(y[:3]), tuple(y[3:]), PLANT)) + u)]

        x = solve_ivp(rates, (0.0, PERIOD), x, rtol=1e-9, atol=1e-12).y[:, -1]
    return x


def continuous() -> Any:
    """SciPy with the control renewed all the time."""

    def rates(t: float, y: Any) -> list[float]:
        now = y.tolist()
        free, u = nonlinear(tuple(now[:3]), tuple(now[3:]), PLANT), control(now)
        return [*now[3:], free[0] + u[0], free[1] + u[1], free[2] + u[2]]

    return solve_ivp(
        rates, (0.0, 2.0 * math.pi), [*START.position, *START.velocity], method="DOP853", rtol=1e-9, atol=1e-12
    ).y[:, -1]


def main() -> None:
    """Compare, measure and print."""
    print(header("scipy"))
    carry = fly(LOOP, STEPS, STEPS)[1]
    ours = np.array([*carry.state.position, *carry.state.velocity])
    print(f"end states differ by {np.abs(ours - continuous()).max():.1e} from continuous control (length unit)")
    early = fly(LOOP, STEPS // 20, STEPS)[1].state
    print(f"and by {np.abs(np.array([*early.position, *early.velocity]) - held()).max():.1e} from held control in SciPy\n")
    times = interleaved(
        {
            "one": lambda: fly(LOOP, STEPS, STEPS),
            "many": lambda: simulate_many(LOOP, STARTS, STEPS, threads=1),
            "held": held,
            "continuous": continuous,
        },
        5,
    )
    costs = {
        "starhold, one lane": times["one"].work / STEPS,
        f"starhold, {LANES} lanes, one core": times["many"].work / STEPS / LANES,
        "SciPy RK45, control held": times["held"].work / (STEPS // 20),
        "SciPy DOP853, continuous": times["continuous"].work / STEPS,
    }
    least = costs["starhold, one lane"]
    rows = [[name, f"{1e9 * cost:.1f}", f"{cost / least:.3g}"] for name, cost in costs.items()]
    show(["l2-circle, full problem", "ns per control period", "of one lane"], rows)


if __name__ == "__main__":
    main()
