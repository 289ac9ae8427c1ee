"""The phase portrait of a system with its certified sets, one panel per claim."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from starhold.certification.invariant.wording import down
from starhold.report.figures import framed
from starhold.report.plots import COLOURS
from starhold.studies.phase_portraits import Portrait

INSIDE, SET, AGAINST, TRUE = COLOURS[5], COLOURS[0], COLOURS[1], COLOURS[2]


def draw(drawn: Sequence[Portrait], title: str) -> Any:
    """Return a figure of portraits, each of which has a V."""
    across = min(len(drawn), 2)
    down = -(-len(drawn) // across)
    # The width of a panel allows for an equal scale of both axes.
    shares = [max(_share(item) for item in drawn[k::across]) for k in range(across)]
    wide, height = 4.1 * sum(shares) + 0.75 * (across - 1), 4.1 * down + 0.75 * (down - 1) + 1.45
    width = max(wide + 0.85, 5.2)
    sides, gap = (0.62, width - 0.62 - wide, 0.5, 0.95), 0.75 * across / (wide - 0.75 * (across - 1))
    figure, axes = framed((width, height), title, down, across, sides, width_ratios=shares, wspace=gap, hspace=0.75 / 4.1)
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
    return figure


def _share(item: Portrait) -> float:
    """Return the ratio of width to height of a panel."""
    share = float((item.x[-1] - item.x[0]) / (item.y[-1] - item.y[0]))
    return share if 0.5 < share < 2.0 else 1.3


def _panel(axis: Any, item: Portrait) -> None:
    level = item.claim.numbers.get("level")
    proved = item.claim.outcome == "proved"
    top = float(np.nanmax(item.V))
    unstable = item.claim.numbers["theorem"] == "unstable"
    if unstable and top > 0.0:
        axis.contourf(item.x, item.y, item.V, levels=[0.0, top], colors=[AGAINST], alpha=0.13)
    # Where V jumps, contours would follow the jump, so V is drawn as computed.
    if level is not None and level < top:
        axis.contourf(item.x, item.y, item.V, levels=[-np.inf, level], colors=[INSIDE], alpha=0.45, extend="neither")
        axis.contour(
            item.x, item.y, item.V, levels=[level], colors=[SET], linewidths=1.6, linestyles="-" if proved else "--"
        )
    if item.equilibrium is None and not unstable:
        # Slightly more than M, which may have zero width.
        floor = (1e-4 if item.u is not None else 2e-3) * (level or top)
        axis.contourf(item.x, item.y, item.V, levels=[-np.inf, floor], colors=[SET], alpha=0.5)
        axis.contour(item.x, item.y, item.V, levels=[floor], colors=[SET], linewidths=0.9)
    for values, colour in zip(item.sets, (TRUE, AGAINST), strict=False):
        axis.contourf(item.x, item.y, values, levels=[0.0, np.inf], colors=[colour], alpha=0.6)
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
    # On a line of its own it fits into every panel.
    shown += "" if item.u is not None else f"\nprojected on {item.names[0]}, {item.names[1]}"
    axis.set_title(f"{name}: {item.claim.outcome}{shown}", fontsize=9.5, loc="left", parse_math=False)
    for side in ("top", "right"):
        axis.spines[side].set_visible(False)


def _handles(drawn: Sequence[Portrait]) -> list[Any]:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    theorems = {item.claim.numbers["theorem"] for item in drawn}
    handles: list[Any] = []
    if any(item.claim.numbers.get("level") for item in drawn):
        handles.append(Patch(facecolor=INSIDE, alpha=0.6, edgecolor=SET, label="{V ≤ level}"))
    if "avoids" in theorems:
        parts = (SET, "V ≤ 0"), (TRUE, "start"), (AGAINST, "unsafe")
        handles += [Patch(facecolor=colour, alpha=0.6, label=label) for colour, label in parts]
    if any(item.equilibrium is None and item.claim.numbers["theorem"] not in ("unstable", "avoids") for item in drawn):
        handles.append(Patch(facecolor=SET, alpha=0.6, label="M"))
    if any(item.equilibrium is not None for item in drawn):
        handles.append(Line2D([], [], color=SET, marker="o", linestyle="", label="M, an equilibrium"))
    if "unstable" in theorems:
        handles.append(Patch(facecolor=AGAINST, alpha=0.2, label="V > 0: left by every motion"))
    if any(item.orbit is not None for item in drawn):
        handles.append(Line2D([], [], color=TRUE, linestyle=(0, (5, 2)), label="border of the true region"))
    if any(item.marks for item in drawn):
        handles.append(Line2D([], [], color=AGAINST, marker="X", linestyle="", label="refutes"))
    return handles
