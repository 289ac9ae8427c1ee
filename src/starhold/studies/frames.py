"""Results as tidy pandas tables, with one row per subject and one column per measured number."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from starhold.analysis.margins import Margins
from starhold.certification.certificate import Certificate
from starhold.scenario.designing import Design
from starhold.studies.flight import Flight

if TYPE_CHECKING:
    import xarray as xr
    from pandas import DataFrame


def frame_of(rows: Sequence[dict[str, Any]]) -> DataFrame:
    """Return a table of rows; None counts as missing."""
    # Loaded here, because no command needs it.
    import pandas as pd

    columns = {name: None for row in rows for name in row}
    return pd.DataFrame({name: [np.nan if row.get(name) is None else row[name] for row in rows] for name in columns})


def to_pandas(results: Any) -> DataFrame:
    """Return a run, or a list of flights, certificates, designs or margins, as a table, with units in its `attrs`; see
    `starhold.to_pandas`."""
    if hasattr(results, "data_vars"):
        return run_frame(results)
    items = [results] if isinstance(results, Flight | Certificate | Design | Margins) else list(results)
    rows: list[dict[str, Any]] = []
    units: dict[str, str] = {}
    for item in items:
        if isinstance(item, Flight):
            rows.append({"name": item.name, "law": item.law, **item.metrics})
            units |= item.metric_set.measured(item.metrics).units
        elif isinstance(item, Certificate):
            rows += [
                {"name": item.name, "claim": claim.kind, "outcome": claim.outcome, **claim.numbers} for claim in item.claims
            ]
        elif isinstance(item, Margins):
            rows.append(item._asdict())
            units |= item.units
        elif isinstance(item, Design):
            rows.append({"name": item.name, "law": item.law, "form": item.form, **item.inputs, **item.gains})
        else:
            raise TypeError(
                f"cannot make a table of {type(item).__name__}; give a run, flights, certificates, designs or margins"
            )
    table = frame_of(rows)
    table.attrs["units"] = units
    return table


def run_frame(run: xr.Dataset) -> DataFrame:
    """Return a run as a table with a row per sample and a column for time and for each number or component, such as
    rate_x."""
    import pandas as pd

    columns: dict[str, Any] = {"time": run["time"].to_numpy()}
    for name, values in run.data_vars.items():
        data = cast(Any, values.to_numpy())
        if data.ndim == 1:
            columns[str(name)] = data
            continue
        dimension = str(values.dims[1])
        known = dimension in run.coords
        labels = run[dimension].to_numpy() if known else np.arange(1, values.shape[1] + 1)
        columns |= {f"{name}_{label}": data[:, place] for place, label in enumerate(labels)}
    return pd.DataFrame(columns)
