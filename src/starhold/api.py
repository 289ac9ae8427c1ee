"""The Python interface; each function mirrors a command."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from starhold.report import compare as comparing
from starhold.scenario import reading
from starhold.scenario.building import build
from starhold.simulation import lane

if TYPE_CHECKING:
    import xarray as xr

    from starhold.report.flight import Flight


def load(source: str | Path) -> reading.Scenario:
    """The scenario in a TOML file, or the built-in one of that name. InputError says what is wrong with it."""
    return reading.load(source)


def simulate(
    scenario: reading.Scenario | str | Path,
    law: str | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> xr.Dataset:
    """Fly one law of a scenario, the first if `law` is None. Returns the Dataset that `starhold run` writes to run.nc;
    `attrs["diverged_at"]` (s) is there only when the motion was lost."""
    opened = scenario if isinstance(scenario, reading.Scenario) else reading.load(scenario)
    entry = opened.laws[0] if law is None else opened.pick(law)
    timing = opened.table.simulation
    return lane.simulate(build(opened, entry), timing.steps, timing.record_every, progress=progress)


def compare(scenario: reading.Scenario | str | Path) -> list[Flight]:
    """Fly every law of a scenario; each Flight has the run (`run`, a Dataset) and its `metrics` (SI)."""
    opened = scenario if isinstance(scenario, reading.Scenario) else reading.load(scenario)
    return comparing.compare(opened)
