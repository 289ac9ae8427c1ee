"""One flown law with all that a report says about it."""

from __future__ import annotations

from colorsys import hls_to_rgb
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from starhold.analysis.ranking import ATTITUDE, MetricSet

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import xarray as xr

    from starhold.analysis.departure import Departure
    from starhold.certification.certificate import Certificate
    from starhold.laws.interface import Field
    from starhold.simulation.lane import Recording

COLOURS = (
    *("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#8A8A8A"),
    *("#7B3FA0", "#A6761D", "#E7298A", "#66A61E", "#4D5BD6", "#B3001B", "#2F8F9D"),
)
"""Okabe and Ito's palette, distinct to colour-blind readers, without what white or black paper swallows; then seven
more that differ from these and from one another."""
GOLDEN = 0.5 * (3.0 - 5.0**0.5)
"""Of a full turn: hues that are such a step apart fill the circle evenly, however many they are."""


ROUNDING = 1e-13
"""Share of a matrix's largest entry below which another is taken for what rounding left."""


@dataclass(frozen=True, repr=False)
class Flight:
    """One law's run of a scenario: the name the scenario gives the law, the law's type, what was recorded,
    its metrics as `measure` gives them, its gains, field name to text with unit, and its certificates."""

    name: str
    law: str
    recording: Recording
    metrics: dict[str, Any]
    gains: dict[str, str]
    certificates: tuple[Certificate, ...] = ()
    """What is proved of the law on this spacecraft: as it starts, and after faults."""
    departures: tuple[Mapping[str, tuple[Departure, ...]], ...] = ()
    """Of each certificate how this flight leaves the proved claims, by their kinds."""
    metric_set: MetricSet = ATTITUDE
    """How the metrics are told and ranked."""

    def __repr__(self) -> str:
        shown = self.metric_set
        told = [
            f"{shown.measures[name].heading} {shown.shown(name, self.metrics.get(name))} {shown.measures[name].unit}"
            for name in shown.order
        ]
        fate = ", ".join(told) if self.lost is None else f"diverged at {self.lost_text()}"
        return f"<Flight {self.name}: {fate}>"

    @cached_property
    def run(self) -> xr.Dataset:
        """The run as an xarray Dataset with units."""
        return self.recording.dataset()

    @property
    def lost(self) -> float | None:
        """When the motion was lost (s), None for a run that did not diverge."""
        return self.metrics.get("diverged_at")

    def lost_text(self, digits: int = 6) -> str:
        """The same for reading."""
        return "" if self.lost is None else self._when(self.lost, digits)

    def left_text(self, certificate: int, kind: str) -> str:
        """How this flight leaves a claim of a certificate, for reading; empty where it does not."""
        left = self._left(certificate, kind)
        groups = {time: listed([one.how for one in left if one.time == time]) for time in (one.time for one in left)}
        return "; ".join(
            f"{'from the start' if time == 0.0 else f'at {self._when(time, 4)}'} {how}" for time, how in groups.items()
        )

    def _when(self, time: float, digits: int) -> str:
        return f"{time / self.metric_set.tick:.{digits}g} {self.metric_set.clock}"

    def _left(self, certificate: int, kind: str) -> tuple[Departure, ...]:
        return self.departures[certificate].get(kind, ()) if self.departures else ()

    def results(self) -> dict[str, Any]:
        """What a summary holds: the metrics and, of a certified law, each claim with its outcome, the time (s) from which on
        this flight is not what it speaks of (None: it is throughout), and what happens then and later."""
        claims: list[dict[str, Any]] = []
        for number, certificate in enumerate(self.certificates):
            for claim in certificate.claims:
                left = [one._asdict() for one in self._left(number, claim.kind)]
                told = {"certificate": certificate.name, "claim": claim.kind, "outcome": claim.outcome}
                claims.append(told | {"left_at": left[0]["time"] if left else None, "left": left})
        return self.metrics | ({"claims": claims} if self.certificates else {})


def colour(number: int) -> str:
    """The colour of the law at this place of a comparison, the same in every picture."""
    if number < len(COLOURS):
        return COLOURS[number]
    extra = number - len(COLOURS)
    red, green, blue = hls_to_rgb(GOLDEN * extra % 1.0, (0.38, 0.58)[extra % 2], 0.62)
    return "#" + "".join(f"{round(255.0 * part):02X}" for part in (red, green, blue))


def listed(parts: Sequence[str]) -> str:
    """Some things in a row, as a sentence has them."""
    return " and ".join(filter(None, (", ".join(parts[:-1]), parts[-1])))


def number_text(value: Any, digits: int = 6) -> str:
    """A number, vector or matrix for reading; of a diagonal matrix the diagonal, of equal numbers one; a name as it is. An
    entry that is nothing beside the largest but the rounding of a computation reads as 0."""
    if isinstance(value, str):
        return value
    array = np.asarray(value, dtype=float)
    if array.ndim:
        array = np.where(np.abs(array) < ROUNDING * np.abs(array).max(initial=0.0), 0.0, array)
    if array.ndim == 0:
        return f"{array:.{digits}g}"
    if array.ndim == 1 and len(array) == 3 and array[0] and (array == array[0]).all():
        return f"{array[0]:.{digits}g} each"
    if array.ndim == 2 and array.shape[0] == array.shape[1]:
        diagonal = np.diagonal(array)
        if np.count_nonzero(array - np.diag(diagonal)) == 0:
            return f"diag({', '.join(f'{v:.{digits}g}' for v in diagonal)})"
    return f"[{', '.join(_row_text(row, digits) for row in array)}]"


def _row_text(row: Any, digits: int) -> str:
    return f"[{', '.join(f'{v:.{digits}g}' for v in row)}]" if np.ndim(row) else f"{row:.{digits}g}"


def gain_text(item: Field, value: Any) -> str:
    """The value of a gain with its unit."""
    if item.gain.choices:
        return item.gain.choices[value]
    unit = "" if item.gain.unit == "1" else f" {item.gain.unit}"
    return f"{number_text(value)}{unit}"
