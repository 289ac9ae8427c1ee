"""The map of the decay rate (degree of stability) over the gains, with the dominant mode, the torque budget and the
optimum."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from starhold.report.figures import DPI
from starhold.synthesis.stability_degree import Optimum, boundary, degree, optimum

POINTS = 400
"""The number of gains along each side of the map, one for about two pixels."""
DASHES = ((1, 1.2), (5, 2), (7, 2, 1, 2))
"""The dash pattern of each axis."""
LINE = "#D55E00"
"""The budget's colour, distinct from the map's blues and yellows also for colour-blind readers."""
SAME = 1e-9
"""Moments that differ by less than this share count as equal."""


class StabilityMap(NamedTuple):
    """The contents of the map.

    K_a: (POINTS,); K_w: (POINTS,); eta: (POINTS, POINTS), indexed by K_w, then K_a; ask: commanded torque over the budget,
    of the same shape; best: the optimum; ratios: (3,); alpha (rad), omega (1/t0) and budget: the arguments."""

    K_a: Any
    K_w: Any
    eta: Any
    ask: Any
    best: Optimum
    ratios: tuple[float, ...]
    alpha: float
    omega: float
    budget: float


def stability_map(ratios: ArrayLike, alpha: float, omega: float, budget: float) -> StabilityMap:
    """Return the map around the optimum. Arguments and errors as in `draw_map`."""
    best = optimum(ratios, alpha, omega, budget)
    # The optimum is at fixed shares of both sides, so that the labels stay on their sides of the boundary.
    K_a = np.linspace(0.0, 2.0 * best.K_a, POINTS)
    K_w = np.linspace(0.0, 1.6 * best.K_w, POINTS)
    eta = degree(K_a, K_w[:, None], ratios)
    ask = (2.0 * K_a * alpha + K_w[:, None] * omega) / budget
    three = tuple(np.asarray(ratios, dtype=float).tolist())
    return StabilityMap(K_a, K_w, eta, ask, best, three, float(alpha), float(omega), float(budget))


def draw_map(ratios: ArrayLike, alpha: float, omega: float, budget: float) -> Any:
    """Return a figure of the map eta(K_a, K_w). Equal arguments give equal files.

    ratios: (3,), J_axis / J_x in any order; alpha: largest initial error (rad); omega: largest initial rate (1/t0); budget:
    L. ValueError as from `optimum`."""
    from matplotlib.figure import Figure

    what = stability_map(ratios, alpha, omega, budget)
    figure = Figure(figsize=(8.0, 6.2), dpi=DPI)
    figure.set_layout_engine("none")
    axis: Any = figure.add_axes((0.085, 0.17, 0.745, 0.70))
    scale: Any = figure.add_axes((0.855, 0.17, 0.022, 0.70))
    drawn = axis.contourf(what.K_a, what.K_w, what.eta, levels=16, cmap="cividis")
    axis.contour(what.K_a, what.K_w, what.eta, levels=drawn.levels, colors="white", linewidths=0.35, alpha=0.6)
    bar = figure.colorbar(drawn, cax=scale)
    bar.set_label("decay rate (degree of stability) η, 1/t₀", fontsize=9)
    bar.ax.tick_params(labelsize=8.5)
    _budget(axis, what)
    handles = _curves(axis, what)
    _words(axis, what)
    axis.set_xlim(0.0, what.K_a[-1])
    axis.set_ylim(0.0, what.K_w[-1])
    axis.set_xlabel("stiffness K_a = t₀² k_attitude / Jx", fontsize=9.5)
    axis.set_ylabel("damping K_w = t₀ k_rate / Jx", fontsize=9.5)
    axis.tick_params(labelsize=8.5)
    x, y, z = (f"{ratio:.4g}" for ratio in what.ratios)
    figure.text(0.085, 0.96, "decay rate (degree of stability) over the gains", fontsize=11, fontweight="bold")
    given = f"moments {x} : {y} : {z},  α = {what.alpha:.4g} rad,  ω = {what.omega:.4g} / t₀,  L = {what.budget:.4g}"
    best = f"optimum: K_a = {what.best.K_a:.4g},  K_w = {what.best.K_w:.4g},  η = {what.best.eta:.4g}"
    for height, words in ((0.932, given), (0.905, best)):
        figure.text(0.085, height, words, fontsize=8.5, color="0.3")
    figure.legend(
        handles=handles,
        loc="lower left",
        bbox_to_anchor=(0.075, 0.005),
        ncols=3,
        fontsize=8.5,
        frameon=False,
        handlelength=2.6,
        columnspacing=1.6,
    )
    return figure


def _budget(axis: Any, what: StabilityMap) -> None:
    """Draw the budget line, with the side beyond it faded and hatched."""
    beyond = [1.0, max(float(what.ask.max()), 1.0) * 2.0]
    axis.contourf(what.K_a, what.K_w, what.ask, levels=beyond, colors=["white"], alpha=0.42)
    hatched = axis.contourf(what.K_a, what.K_w, what.ask, levels=beyond, colors="none", hatches=["//"])
    hatched.set_edgecolor("0.25")
    hatched.set_linewidth(0.0)
    axis.contour(what.K_a, what.K_w, what.ask, levels=[1.0], colors=LINE, linewidths=2.4)


def _curves(axis: Any, what: StabilityMap) -> list[Any]:
    """Draw the boundary between the two dominant modes and each axis' critical damping; return the legend of these lines."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch
    from matplotlib.patheffects import withStroke

    cased = [withStroke(linewidth=3.8, foreground="0.2")]
    edge: dict[str, Any] = {"color": "white", "linewidth": 2.2, "path_effects": cased}
    axis.plot(boundary(what.ratios) * what.K_w**2, what.K_w, **edge)
    handles = [
        Line2D([], [], color=LINE, linewidth=2.4, label="torque budget, 2 K_a α + K_w ω = L"),
        Patch(facecolor="white", edgecolor="0.25", hatch="////", linewidth=0.0, label="more torque than available"),
        Line2D([], [], label="border of the two regions", **edge),
    ]
    for number, (name, ratio) in enumerate(_axes(what.ratios)):
        style: dict[str, Any] = {"color": "black", "linewidth": 1.2, "dashes": DASHES[number]}
        axis.plot(what.K_w**2 / (8.0 * ratio), what.K_w, **style)
        handles.append(Line2D([], [], label=f"{name} critically damped", **style))
    return handles


def _words(axis: Any, what: StabilityMap) -> None:
    """Label the dominant mode on each side of the boundary, which runs through the middle of the map, and mark the
    optimum."""
    named, best = sorted(_axes(what.ratios), key=lambda pair: pair[1]), what.best
    box = {"boxstyle": "round,pad=0.3", "facecolor": "white", "edgecolor": "none", "alpha": 0.9}
    above, below = f"slow aperiodic root\nof {named[0][0]} decides", f"oscillation\nof {named[-1][0]} decides"
    for x, y, text in ((0.17, 0.88, above), (0.83, 0.12, below)):
        axis.text(x, y, text, transform=axis.transAxes, ha="center", va="center", fontsize=9, bbox=box, zorder=6)
    axis.plot([best.K_a], [best.K_w], "*", markersize=18, color=LINE, markeredgecolor="white", markeredgewidth=1.2, zorder=7)


def _axes(ratios: tuple[float, ...]) -> list[tuple[str, float]]:
    """Return the names of the axes with their ratios; axes of equal moments share one name."""
    groups: list[tuple[str, float]] = []
    for name, ratio in zip("xyz", ratios, strict=True):
        for number, (names, other) in enumerate(groups):
            if abs(ratio - other) <= SAME * max(ratio, other):
                groups[number] = (f"{names}, {name}", other)
                break
        else:
            groups.append((name, ratio))
    return [(f"{'axes' if ',' in names else 'axis'} {names}", ratio) for names, ratio in groups]
