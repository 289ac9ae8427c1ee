"""Numbers, times and gains as text for readers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from starhold.analysis.ranking import Measure

if TYPE_CHECKING:
    from starhold.certification.certificate import Certificate
    from starhold.studies.flight import Flight

ROUNDING = 1e-13
"""Entries below this share of a matrix's largest entry count as rounding errors."""


def number_text(value: Any, digits: int = 6) -> str:
    """Return a number, vector or matrix as text: a diagonal matrix by its diagonal, equal numbers as one, a name unchanged.
    Entries that are only rounding errors compared with the largest are shown as 0."""
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


def value_text(value: Any, unit: str) -> str:
    """Return a value with its unit."""
    return number_text(value) if unit == "1" else f"{number_text(value)} {unit}"


def left_text(flight: Flight, certificate: int, kind: str) -> str:
    """Return a text on when and how a flight leaves a claim of one of its certificates; "" if it does not."""
    left, moment = flight.left(certificate, kind), flight.metric_set.moment
    groups = {time: _how([one.how for one in left if one.time == time]) for time in (one.time for one in left)}
    return "; ".join(f"{'from the start' if time == 0.0 else f'at {moment(time, 4)}'} {how}" for time, how in groups.items())


def covered_text(flight: Flight, certificate: int) -> str:
    """Return a text on the times between which a certificate's claim about the loop as it flies covers a flight; "" where it
    covers it from the start, or not at all."""
    from starhold.certification.wording import listed

    times, moment = flight.covered[certificate] if flight.covered else (), flight.metric_set.moment
    last = float(flight.recording["time"][-1])
    if not times or (len(times) == 1 and not times[0][0]):
        return ""
    shown = [f"from {moment(begin, 4)} {'on' if end >= last else f'to {moment(end, 4)}'}" for begin, end in times]
    return f"it covers this flight {listed(shown)}"


def unflown_text(certificate: Certificate) -> tuple[str, str]:
    """Return, in a word and in a sentence, why a certificate has no claim about the loop as it flies; both "" where it has
    one."""
    from starhold.certification.certificate import NOT_SOUGHT

    why = certificate.unflown
    if why == NOT_SOUGHT:
        return why, "pointing as it flies: --proof, or starhold certify, looks for it"
    return ("not proved", f"pointing as it flies: {why}") if why else ("", "")


def _how(departures: Sequence[str]) -> str:
    """Return a list of departures in order of time, with the parts of the loop named together."""
    # Imported here, because modules that draw need no certificates.
    from starhold.certification.assumptions import HAS
    from starhold.certification.wording import enumerated, listed

    parts = [text.removeprefix(HAS) for text in departures if text.startswith(HAS)]
    others = [text for text in departures if not text.startswith(HAS)]
    return listed([*([HAS.removesuffix("the ") + enumerated(parts)] if parts else []), *others])


def unknown_text(flight: Flight) -> str:
    """Return a text on recorded quantities of a flight that cease to be finite before its end; "" if there are none."""
    spans = [f"{name} from {flight.metric_set.moment(time)} on" for name, time in flight.unknown.items()]
    return f"{flight.name}: not finite up to the end: {', '.join(spans)}" if spans else ""


def lost_text(flight: Flight, digits: int = 6) -> str:
    """Return the time at which a flight diverged as text; "" if it did not."""
    return "" if flight.lost is None else flight.metric_set.moment(flight.lost, digits)


def plain_measure(name: str, unit: str, meaning: str = "") -> Measure:
    """Return the measure that shows a quantity of which only the SI unit is known; angles are shown in degrees."""
    heading = name.replace("_", " ")
    if unit == "rad" or unit.startswith("rad/"):
        return Measure(heading, f"deg{pretty_unit(unit[3:])}", meaning, 180.0 / math.pi)
    return Measure(heading, "" if unit == "1" else pretty_unit(unit), meaning)


def pretty_unit(unit: str) -> str:
    """Return a unit, or a text with units, with superscript exponents."""
    return unit.replace("^2", "²").replace("^3", "³")
