"""The figure of control steps needed to reach each accuracy, drawn without other modules of the body."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from starhold.report.figures import blank, width_of
from starhold.report.plots import colour
from starhold.studies.flight import Flight


def draw_accuracy(
    columns: Mapping[str, Sequence[Sequence[int | None]]], decades: Sequence[int], flights: Sequence[Flight], name: str
) -> Any:
    """Return a figure with, for each heading, the steps of each flight after which an error stays within 10^-k, for every k
    of `decades`."""
    figure, axes = blank(1, 2, 3.9, "control steps needed to stay within 10⁻ᵏ", flights, name, "")
    for axis, (label, counts) in zip(axes, columns.items(), strict=True):
        for number, count in enumerate(counts):
            steps = np.array([np.nan if s is None else s for s in count])
            width = width_of(number, len(flights))
            axis.plot(decades, steps, color=colour(number), linewidth=width, marker="os^Dv<>"[number % 7], markersize=5)
        axis.set_xlim(decades[0] - 0.4, decades[-1] + 0.4)
        axis.set_ylim(0.0, max(axis.get_ylim()[1], 1.0))
        axis.set_xlabel("k")
        axis.set_title(label, fontsize=9)
    axes[0].set_ylabel("control steps")
    return figure
