"""Tick labels as plain text, because matplotlib's math parser takes longer than the rest of a figure."""

import re
from typing import Any

from matplotlib.ticker import LogFormatterSciNotation, ScalarFormatter

RAISED = str.maketrans("0123456789-−", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻⁻")
POWERS = (-2, 4)
"""The powers of ten beyond which labels show their common power above the axis."""


def as_text(formula: str) -> str:
    """Return a tick's formula as plain text: 10⁻³ for $\\mathdefault{10^{-3}}$."""
    raised = re.sub(r"\^\{([-−0-9]+)\}", lambda power: power[1].translate(RAISED), formula)
    return re.sub(r"\$|\\mathdefault|[{}]", "", raised).replace(r"\times", "×")


class Even(ScalarFormatter):
    """Labels of a linear axis."""

    def __init__(self) -> None:
        super().__init__(useMathText=False)
        self.set_powerlimits(POWERS)

    def get_offset(self) -> str:
        """Return the power of ten shown above the axis."""
        self.set_useMathText(True)
        try:
            return as_text(super().get_offset())
        finally:
            self.set_useMathText(False)


class Decades(LogFormatterSciNotation):
    """Labels of a logarithmic axis."""

    def __call__(self, x: float, pos: int | None = None) -> str:
        """Return the label of a tick."""
        return as_text(super().__call__(x, pos))


def label_ticks(axis: Any, log: bool = False) -> None:
    """Label the ticks of an axis of a plot (its `xaxis` or `yaxis`) as plain text."""
    axis.set_major_formatter(Decades() if log else Even())
    if log:
        axis.set_minor_formatter(Decades())
