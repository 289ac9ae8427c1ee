"""The phase portrait of a system with the sets that were certified, one panel a claim."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from starhold.certification.certificate import Certificate, Claim
from starhold.certification.invariant import InvariantProblem, WantedSet
from starhold.certification.invariant.descent import Candidate
from starhold.certification.invariant.enclosure import EnclosedPolynomial
from starhold.certification.invariant.search import Values
from starhold.certification.invariant.theorems import indicator
from starhold.certification.invariant.wording import down
from starhold.files import atomic_write
from starhold.studies.flight import COLOURS

PICTURE = "invariant.png"
DPI = 110
POINTS = 400
"""Along each side of a panel."""
COARSE, STEPS = 121, 10
"""The same where there are more than two variables, and how often a grid over the others shrinks."""
INSIDE, SET, AGAINST, TRUE = COLOURS[5], COLOURS[0], COLOURS[1], COLOURS[2]
AHEAD = 60.0
"""How long a motion is followed backwards until it is on the border of the true region."""


@dataclass(frozen=True)
class Sketch:
    """What one panel shows, over the first two variables, parameters in the middle of their intervals.

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


def sketch(problem: InvariantProblem, certificate: Certificate) -> list[Sketch]:
    """All that is drawn, and what orbits say, in floats."""
    pairs = zip(problem.claims, certificate.claims, strict=True)
    return [_sketch(problem, wanted, claim, problem.orbit(k)) for k, (wanted, claim) in enumerate(pairs)]


def _sketch(problem: InvariantProblem, wanted: WantedSet, claim: Claim, start: tuple[float, ...] | None) -> Sketch:
    names = problem.system.names
    if len(problem.system.variables) < 2:
        return Sketch(claim, names)
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
    return Sketch(claim, names, x, y, V, u, v, orbit, area, marked, equilibrium)


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


def draw(sketches: Sequence[Sketch], path: Path, title: str) -> Path | None:
    """Write the picture to `path`, in a folder that exists, and return the path; None where there is nothing to draw."""
    drawn = [item for item in sketches if item.V is not None]
    if not drawn:
        return None
    from matplotlib.figure import Figure

    across = min(len(drawn), 2)
    down = -(-len(drawn) // across)
    # Panels as wide as they are drawn where both axes have one scale.
    shares = [max(_share(item) for item in drawn[k::across]) for k in range(across)]
    wide, height = 4.1 * sum(shares) + 0.75 * (across - 1), 4.1 * down + 0.75 * (down - 1) + 1.45
    width = max(wide + 0.85, 5.2)
    figure = Figure(figsize=(width, height), dpi=DPI)
    figure.set_layout_engine("none")
    axes: Any = figure.subplots(down, across, squeeze=False, gridspec_kw={"width_ratios": shares})
    figure.subplots_adjust(
        left=0.62 / width,
        right=(0.62 + wide) / width,
        bottom=0.5 / height,
        top=1.0 - 0.95 / height,
        wspace=0.75 * across / (wide - 0.75 * (across - 1)),
        hspace=0.75 / 4.1,
    )
    figure.text(0.62 / width, 1.0 - 0.27 / height, title, fontsize=11, fontweight="bold", parse_math=False)
    for axis, item in zip(axes.ravel(), drawn, strict=False):
        _panel(axis, item)
    for axis in axes.ravel()[len(drawn) :]:
        axis.set_visible(False)
    figure.legend(
        handles=_handles(drawn),
        loc="upper left",
        bbox_to_anchor=(0.5 / width, 1.0 - 0.3 / height),
        ncols=3 if across == 1 else 6,
        fontsize=8.5,
        frameon=False,
        borderpad=0.0,
        columnspacing=1.4,
    )
    with atomic_write(path) as hidden:
        figure.savefig(hidden, metadata={"Software": None}, pil_kwargs={"compress_level": 3})
    return path


def _share(item: Sketch) -> float:
    """Width over height of a panel."""
    share = float((item.x[-1] - item.x[0]) / (item.y[-1] - item.y[0]))
    return share if 0.5 < share < 2.0 else 1.3


def _panel(axis: Any, item: Sketch) -> None:
    level = item.claim.numbers.get("level")
    proved = item.claim.outcome == "proved"
    top = float(np.nanmax(item.V))
    unstable = item.claim.numbers["theorem"] == "unstable"
    if unstable and top > 0.0:
        axis.contourf(item.x, item.y, item.V, levels=[0.0, top], colors=[AGAINST], alpha=0.13)
    # Where V jumps, contours would be drawn along the jump: it is left as it is computed.
    if level is not None and level < top:
        axis.contourf(item.x, item.y, item.V, levels=[-np.inf, level], colors=[INSIDE], alpha=0.45, extend="neither")
        axis.contour(
            item.x, item.y, item.V, levels=[level], colors=[SET], linewidths=1.6, linestyles="-" if proved else "--"
        )
    if item.equilibrium is None and not unstable:
        # A little more than M, which may have no width.
        floor = (1e-4 if item.u is not None else 2e-3) * (level or top)
        axis.contourf(item.x, item.y, item.V, levels=[-np.inf, floor], colors=[SET], alpha=0.5)
        axis.contour(item.x, item.y, item.V, levels=[floor], colors=[SET], linewidths=0.9)
    if item.u is not None:
        axis.streamplot(item.x, item.y, item.u, item.v, density=1.25, color="0.45", linewidth=0.6, arrowsize=0.7)
    if item.equilibrium is not None:
        axis.plot(*item.equilibrium, marker="o", markersize=6, color=SET, markeredgecolor="white")
    if item.orbit is not None:
        axis.plot(*np.append(item.orbit, item.orbit[:, :1], axis=1), color=TRUE, linewidth=1.4, linestyle=(0, (5, 2)))
    for mark in item.marks:
        axis.plot(*mark, marker="X", markersize=8, color=AGAINST, markeredgecolor="white", clip_on=False, zorder=5)
    axis.set_xlim(item.x[0], item.x[-1])
    axis.set_ylim(item.y[0], item.y[-1])
    if 0.5 < (item.x[-1] - item.x[0]) / (item.y[-1] - item.y[0]) < 2.0:
        axis.set_aspect("equal", adjustable="box", anchor="W")
    axis.set_xlabel(item.names[0], fontsize=9)
    axis.set_ylabel(item.names[1], fontsize=9, labelpad=1)
    axis.tick_params(labelsize=8.5)
    name = item.claim.witness["name"] or item.claim.numbers["theorem"]
    shown = "" if level is None else f", V ≤ {down(level)}"
    shown += "" if item.u is not None else f", projected on {item.names[0]}, {item.names[1]}"
    axis.set_title(f"{name}: {item.claim.outcome}{shown}", fontsize=9.5, loc="left", parse_math=False)
    for side in ("top", "right"):
        axis.spines[side].set_visible(False)


def _handles(drawn: Sequence[Sketch]) -> list[Any]:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    theorems = {item.claim.numbers["theorem"] for item in drawn}
    found: list[Any] = []
    if any(item.claim.numbers.get("level") for item in drawn):
        found.append(Patch(facecolor=INSIDE, alpha=0.6, edgecolor=SET, label="{V ≤ level}"))
    if any(item.equilibrium is None and item.claim.numbers["theorem"] != "unstable" for item in drawn):
        found.append(Patch(facecolor=SET, alpha=0.6, label="M"))
    if any(item.equilibrium is not None for item in drawn):
        found.append(Line2D([], [], color=SET, marker="o", linestyle="", label="M, an equilibrium"))
    if "unstable" in theorems:
        found.append(Patch(facecolor=AGAINST, alpha=0.2, label="V > 0: left by every motion"))
    if any(item.orbit is not None for item in drawn):
        found.append(Line2D([], [], color=TRUE, linestyle=(0, (5, 2)), label="border of the true region"))
    if any(item.marks for item in drawn):
        found.append(Line2D([], [], color=AGAINST, marker="X", linestyle="", label="refutes"))
    return found
