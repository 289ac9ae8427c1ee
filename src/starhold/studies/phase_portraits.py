"""Phase portraits of a system with its certified sets, one per claim."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from starhold.algebra.polynomial import Polynomial
from starhold.algebra.structure import runge_kutta
from starhold.certification.certificate import Certificate, Claim
from starhold.certification.invariant import InvariantProblem, System, WantedSet
from starhold.certification.invariant.search import Candidate, Values
from starhold.certification.invariant.theorems import common, indicator

POINTS = 400
"""The number of points along each side of a portrait."""
COARSE, STEPS = 121, 10
"""The number of points per side with more than two variables, and the number of times that a grid over the others
shrinks."""
AHEAD = 60.0
"""The time over which a motion is followed backwards to the boundary of the true region of attraction."""
TINY = 1e-12
"""Rates below this count as zero."""


@dataclass(frozen=True)
class Portrait:
    """The plane of the first two variables with the sets of a claim, for parameters at the midpoints of their intervals.

    x, y: (n,); V: (n, n), indexed by y, then x; with further variables its minimum (for instability maximum) over them; u,
    v: the vector field, (n, n), None with further variables; orbit: the boundary (2, points) of the true region, with its
    area; marks: states that refute the claim; sets: functions (n, n), nonnegative in the start and unsafe sets. With one
    variable there are no arrays."""

    claim: Claim
    names: tuple[str, ...]
    x: Any = None
    y: Any = None
    V: Any = None
    u: Any = None
    v: Any = None
    orbit: Any = None
    orbit_area: float | None = None
    marks: tuple[tuple[float, float], ...] = ()
    equilibrium: tuple[float, float] | None = None
    sets: tuple[Any, ...] = ()


def portraits(problem: InvariantProblem, certificate: Certificate) -> list[Portrait]:
    """Return a portrait of each claim, computed in floating point."""
    pairs = zip(problem.claims, certificate.claims, strict=True)
    return [_portrait(problem, wanted, claim, problem.orbit(k)) for k, (wanted, claim) in enumerate(pairs)]


def paths(system: System, box: Sequence[tuple[float, float]], starts: Any, length: float, steps: int = 400) -> Any:
    """Return motions (N, n, steps + 1) from starts (n, N), in steps of arc length, backwards in time for a negative length,
    with parameters at the midpoints of their intervals. A motion that would reverse, as at an equilibrium, ends."""
    what = Candidate(system, Polynomial.constant(0), tuple(box))
    moving, count = len(system.variables), np.shape(starts)[1]
    others = [np.full(count, 0.5 * (low + high)) for low, high in what.box[moving:]]

    def heading(state: Any) -> Any:
        rates, _ = what.rates(np.array([*state, *others]))
        return rates / np.maximum(np.linalg.norm(rates, axis=0), TINY)

    step, state, going, advance = length / steps, np.array(starts, dtype=float), np.ones(count, bool), runge_kutta(heading)
    states, before = [state], heading(state)
    for _ in range(steps):
        ahead = advance(state, step)
        after = heading(ahead)
        going &= (before * after).sum(axis=0) > 0.0
        state, before = np.where(going, ahead, state), after
        states.append(state)
    return np.stack(states, axis=-1).swapaxes(0, 1)


def _portrait(problem: InvariantProblem, wanted: WantedSet, claim: Claim, start: tuple[float, ...] | None) -> Portrait:
    names = problem.system.names
    if len(problem.system.variables) < 2:
        return Portrait(claim, names)
    what = Candidate(problem.system, indicator(wanted), wanted.box)
    flat = len(problem.system.variables) == 2
    x, y = (np.linspace(*side, POINTS if flat else COARSE) for side in wanted.box[:2])
    points = np.array([np.full(len(x) * len(y), 0.5 * (low + high)) for low, high in wanted.box])
    points[0], points[1] = (side.ravel() for side in np.meshgrid(x, y))
    values = Values(what, points)
    shape = (len(y), len(x))
    u, v = (rate.reshape(shape) for rate in what.rates(points)[0]) if flat else (None, None)
    # The rest, from all of which some motions start.
    sign = -1.0 if wanted.theorem == "unstable" else 1.0
    V = (values.V if flat else sign * _least(what, points, len(problem.system.variables), sign)).reshape(shape)
    marks = [o.evidence["state"] for o in claim.obligations if o.outcome == "refuted"]
    orbit = None if start is None or len(problem.system.variables) != 2 else _orbit(what, np.array(start))
    marked = tuple((mark[names[0]], mark[names[1]]) for mark in marks)
    equilibrium = None if wanted.equilibrium is None else (float(wanted.equilibrium[0]), float(wanted.equilibrium[1]))
    area = None if orbit is None else _area(orbit)
    least = (common(functions) for functions in (wanted.start, wanted.unsafe) if flat and functions)
    sets = tuple(Values(Candidate(problem.system, f, wanted.box), points).V.reshape(shape) for f in least)
    return Portrait(claim, names, x, y, V, u, v, orbit, area, marked, equilibrium, sets)


def _least(what: Candidate, points: Any, moving: int, sign: float) -> Any:
    """Return the minimum of sign * V at points (n, N) over the third and further variables, by grids that shrink around the
    best point."""
    best, values = points.copy(), np.full(points.shape[1], np.inf)
    width = np.array([0.5 * (high - low) for low, high in what.box[2:moving]])
    for step in range(STEPS):
        centre = best.copy()
        side = np.linspace(-1.0, 1.0, 9 if step == 0 and len(width) < 4 else 3)
        for offset in np.array(np.meshgrid(*[side] * len(width))).reshape(len(width), -1).T:
            tried = centre.copy()
            tried[2:moving] += (offset * width)[:, None]
            value = sign * Values(what, tried).V
            better = value < values
            values[better], best[:, better] = value[better], tried[:, better]
        width = width * (0.25 if step == 0 else 0.6)
    return values


def _orbit(what: Candidate, start: Any) -> Any:
    """Return one period of the closed orbit to which the motion from a state converges backwards in time, or None."""
    from scipy.integrate import solve_ivp

    others = [0.5 * (low + high) for low, high in what.box[2:]]

    def back(time: float, state: Any) -> Any:
        return -what.rates(np.array([*state, *others])[:, None])[0][:, 0]

    options: dict[str, Any] = {"rtol": 1e-8, "atol": 1e-9}
    settled = solve_ivp(back, (0.0, AHEAD), start, **options)
    times = np.linspace(0.0, AHEAD, 12_001)
    turned = solve_ivp(back, (0.0, AHEAD), settled.y[:, -1], t_eval=times, **options)
    centre = np.array(what.box[:2]).mean(axis=1)
    angle = np.unwrap(np.arctan2(turned.y[1] - centre[1], turned.y[0] - centre[0]))
    after = np.flatnonzero(np.abs(angle - angle[0]) >= 2.0 * np.pi)
    if not len(after) or not np.isfinite(turned.y).all():
        return None
    orbit = turned.y[:, : after[0]]
    gap = np.linalg.norm(orbit[:, 0] - turned.y[:, after[0]])
    return orbit if gap < 0.05 * np.ptp(orbit, axis=1).max() else None


def _area(orbit: Any) -> float:
    x, y = orbit
    return float(0.5 * abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))))
