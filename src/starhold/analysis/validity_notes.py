"""Notes on the validity of an estimate: the share of a flight without it, and the longest such interval."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

from starhold.algebra.scalar import less, maximum, where
from starhold.analysis.meter import Metric
from starhold.parts.contract import IS_VALID


class Validity(NamedTuple):
    """Notes on instants without a valid estimate: their number, the length of the present run, and the longest run."""

    invalid: float
    row: float
    longest: float


def column_of(names: Iterable[str], attrs: Mapping[str, Any] = MappingProxyType({})) -> str | None:
    """Return the name of the recorded quantity that states whether the law's estimate is valid, None without one; attrs:
    those of the recording, which name the estimators that only watch."""
    watching = {f"{name.replace('-', '_')}_{IS_VALID}" for name in attrs.get("watchers", "").split(", ")}
    saying = [name for name in names if (name == IS_VALID or name.endswith(f"_{IS_VALID}")) and name not in watching]
    return saying[-1] if saying else None


def begun(wanted: bool) -> Any:
    """Return the notes before a flight; none without such an estimate."""
    return Validity(0.0, 0.0, 0.0) if wanted else ()


def noted(seen: Any, quantities: Mapping[str, Any], now: Any, last: Any) -> Any:
    """Return the notes after an instant; last: the last instant of the flight."""
    if not seen:
        return seen
    invalid = less(quantities[str(column_of(quantities))], 0.5)
    row = where(invalid, seen.row + where(less(now, last), 1.0, 0.0), 0.0)
    return Validity(seen.invalid + where(invalid, 1.0, 0.0), row, maximum(seen.longest, row))


def table(rows: Any, period: float) -> dict[str, Metric]:
    """Return the metrics of notes at these rows."""
    share = Metric("1", "number", (rows.invalid,), over=("samples", 1.0)) if rows else None
    return {"invalid_share": share, "longest_invalid": Metric("s", "number", (rows.longest,), (period,))} if share else {}
