"""Phase portraits of a system with the sets that were certified, one a claim."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from starhold.certification.certificate import Certificate, Claim
from starhold.certification.invariant import InvariantProblem, WantedSet
from starhold.certification.invariant.descent import Candidate
from starhold.certification.invariant.enclosure import EnclosedPolynomial
from starhold.certification.invariant.search import Values
from starhold.certification.invariant.theorems import indicator

POINTS = 400
"""Along each side of a portrait."""
COARSE, STEPS = 121, 10
"""Points where there are more than two variables, and how often a grid over the others shrinks."""
AHEAD = 60.0
"""How long a motion is followed backwards until it is on the border of the true region."""


@dataclass(frozen=True)
class Portrait:
    """The plane of the first two variables with what a claim says there, parameters in the middle of their intervals.

    x, y: (n,); V: (n, n), by y, then x, with more variables the least (unstable: greatest) over them; u, v: the same shape,
    None with more; orbit: (2, points), the border of the true region, with its area; marks: states that refute. One
    variable: no arrays."""

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


def portraits(problem: InvariantProblem, certificate: Certificate) -> list[Portrait]:
    """A portrait of each claim, in floats."""
    pairs = zip(problem.claims, certificate.claims, strict=True)
    return [_portrait(problem, wanted, claim, problem.orbit(k)) for k, (wanted, claim) in enumerate(pairs)]


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
    u, v = (rate.reshape(shape) for rate in _rates(what, values)[:2]) if flat else (None, None)
    # Of what is left, all of which some motions start from.
    sign = -1.0 if wanted.theorem == "unstable" else 1.0
    V = (values.V if flat else sign * _least(what, points, len(problem.system.variables), sign)).reshape(shape)
    marks = [
        o.evidence[key]
        for o in claim.obligations
        if o.outcome == "refuted"
        for key in ("state", "outside")
        if key in o.evidence
    ]
    orbit = None if start is None or len(problem.system.variables) != 2 else _orbit(what, np.array(start))
    marked = tuple((mark[names[0]], mark[names[1]]) for mark in marks)
    equilibrium = None if wanted.equilibrium is None else (float(wanted.equilibrium[0]), float(wanted.equilibrium[1]))
    area = None if orbit is None else _area(orbit)
    return Portrait(claim, names, x, y, V, u, v, orbit, area, marked, equilibrium)


def _least(what: Candidate, points: Any, moving: int, sign: float) -> Any:
    """sign V at points (n, N), the least over the variables from the third on, by grids that shrink around what is best."""
    best, values = points.copy(), np.full(points.shape[1], np.inf)
    width = np.array([0.5 * (high - low) for low, high in what.box[2:moving]])
    for step in range(STEPS):
        centre = best.copy()
        side = np.linspace(-1.0, 1.0, 9 if step == 0 else 3)
        for offset in np.array(np.meshgrid(*[side] * len(width))).reshape(len(width), -1).T:
            tried = centre.copy()
            tried[2:moving] += (offset * width)[:, None]
            found = sign * Values(what, tried).V
            better = found < values
            values[better], best[:, better] = found[better], tried[:, better]
        width = width * (0.25 if step == 0 else 0.6)
    return values


def _rates(what: Candidate, values: Values) -> Any:
    found = np.full((len(what.pieces.names), values.points.shape[1]), np.nan)
    for place, cell in enumerate(what.pieces.cells):
        here = values.cell == place
        for k, rate in enumerate(cell.rates):
            found[k, here] = EnclosedPolynomial(rate).at(values.points[:, here])
    return found


def _orbit(what: Candidate, start: Any) -> Any:
    """One turn of the closed motion that the motion from a state comes to backwards in time; None if it comes to none."""
    from scipy.integrate import solve_ivp

    cells = [(cell.signs, [EnclosedPolynomial(rate) for rate in cell.rates[:2]]) for cell in what.pieces.cells]
    surfaces = [EnclosedPolynomial(s) for s in what.pieces.surfaces]
    others = [0.5 * (low + high) for low, high in what.box[2:]]

    def back(time: float, state: Any) -> Any:
        point = [*state, *others]
        sides = [float(s.at(point)) for s in surfaces]
        rates = next(r for signs, r in cells if all(s * v >= 0.0 for s, v in zip(signs, sides, strict=True)))
        return [-float(rate.at(point)) for rate in rates]

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
