"""One flown law with all that reports need."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping

    import xarray as xr

    from starhold.analysis.departure import Departure
    from starhold.analysis.ranking import MetricSet
    from starhold.certification.certificate import Certificate
    from starhold.simulation.lane import Recording
    from starhold.studies.body import Values


class Begun(NamedTuple):
    """A mode of this name begins at a time (s), on a date (UTC) where the law's conditions know of dates, because of the
    monitor that is tripped then, if one is."""

    mode: str
    time: float
    utc: str = ""
    monitor: str = ""

    @property
    def results(self) -> dict[str, Any]:
        """The content of a summary."""
        return {name: value for name, value in self._asdict().items() if value != ""}


@dataclass(frozen=True, repr=False)
class Flight:
    """One law's run of a scenario: the name the scenario gives the law, the law's type, the recording, its metrics, its
    gains with their units, how metrics are shown and ranked, and its certificates."""

    name: str
    law: str
    recording: Recording
    metrics: dict[str, Any]
    gains: Values
    metric_set: MetricSet
    certificates: tuple[Certificate, ...] = ()
    """All that is proved of the law on this spacecraft, initially and after faults."""
    departures: tuple[Mapping[str, tuple[Departure, ...]], ...] = ()
    """The departures of this flight from the proved claims of each certificate, by their kinds."""
    covered: tuple[tuple[tuple[float, float], ...], ...] = ()
    """The times (s) between which the claim of each certificate about the loop as it flies covers this flight."""

    modes: tuple[Begun, ...] = ()
    """The modes that flew, in order, for a law with modes."""
    never: tuple[str, ...] = ()
    """Sentences about modes that could have begun, and did not."""

    def __repr__(self) -> str:
        shown = self.metric_set
        results = [
            f"{shown.measures[name].heading} {shown.shown(name, self.metrics.get(name))} {shown.measures[name].unit}"
            for name in shown.order
        ]
        fate = ", ".join(results) if self.lost is None else f"diverged at {shown.moment(self.lost)}"
        return f"<Flight {self.name}: {fate}>"

    @cached_property
    def run(self) -> xr.Dataset:
        """The run as an xarray Dataset with units."""
        return self.recording.dataset()

    @property
    def lost(self) -> float | None:
        """When the motion diverged (s), None for a run that did not."""
        return self.metrics.get("diverged_at")

    @cached_property
    def unknown(self) -> dict[str, float]:
        """Recorded quantities that are NaN from some time (s) to the end of a motion that does not diverge."""
        run, times = self.recording, dict[str, float]()
        for name in run.columns if self.lost is None else ():
            values = np.asarray(run.arrays.get(name, 0.0))
            if values.dtype.kind == "f" and values.ndim and np.isnan(values[-1]).any():
                sound = np.flatnonzero(~np.isnan(values.reshape(len(values), -1)).any(1))
                times[name] = float(run["time"][sound[-1] + 1 if len(sound) else 0])
        return times

    def left(self, certificate: int, kind: str) -> tuple[Departure, ...]:
        """Return the departures of this flight from a claim of one of its certificates; empty where it keeps to it."""
        return self.departures[certificate].get(kind, ()) if self.departures else ()

    def results(self) -> dict[str, Any]:
        """Return the content of a summary: the metrics, when modes begin and, for a certified law, each claim with its
        outcome, the time (s) from which it does not cover this flight (None: it covers all of it), and the reasons then and
        later."""
        claims: list[dict[str, Any]] = []
        for number, certificate in enumerate(self.certificates):
            for claim in certificate.claims:
                left = [one._asdict() for one in self.left(number, claim.kind)]
                stated = {"certificate": certificate.name, "claim": claim.kind, "outcome": claim.outcome}
                claims.append(stated | {"left_at": left[0]["time"] if left else None, "left": left})
        modes = {"modes": [one.results for one in self.modes]} if self.modes else {}
        return self.metrics | modes | ({"claims": claims} if self.certificates else {})
