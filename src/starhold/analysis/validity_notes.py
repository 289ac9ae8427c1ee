"""Notes on whether an estimate is valid: for how much of a flight it is not, and for how long at most at a time."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

from starhold.algebra.scalar import less, maximum, where
from starhold.analysis.meter import Metric
from starhold.parts.contract import IS_VALID


class Validity(NamedTuple):
    """Notes on instants without a valid estimate: their number, and of those in a row that begin a period, last and most."""

    invalid: float
    row: float
    longest: float


def column_of(names: Iterable[str], attrs: Mapping[str, Any] = MappingProxyType({})) -> str | None:
    """The recorded quantity that says whether the law's estimate is valid, None without any; attrs: those of the recording,
    which name the estimators that only watch."""
    watching = {f"{name.replace('-', '_')}_{IS_VALID}" for name in attrs.get("watchers", "").split(", ")}
    saying = [name for name in names if (name == IS_VALID or name.endswith(f"_{IS_VALID}")) and name not in watching]
    return saying[-1] if saying else None


def begun(wanted: bool) -> Any:
    """The notes before a flight; none where there is no such estimate."""
    return Validity(0.0, 0.0, 0.0) if wanted else ()


def noted(seen: Any, quantities: Mapping[str, Any], now: Any, last: Any) -> Any:
    """The notes of an instant; last: the last instant of the flight."""
    if not seen:
        return seen
    invalid = less(quantities[str(column_of(quantities))], 0.5)
    row = where(invalid, seen.row + where(less(now, last), 1.0, 0.0), 0.0)
    return Validity(seen.invalid + where(invalid, 1.0, 0.0), row, maximum(seen.longest, row))


def table(rows: Any, period: float) -> dict[str, Metric]:
    """The metrics of notes that lie at these rows."""
    share = Metric("1", "number", (rows.invalid,), over=("samples", 1.0)) if rows else None
    return {"invalid_share": share, "longest_invalid": Metric("s", "number", (rows.longest,), (period,))} if share else {}
