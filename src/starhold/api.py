"""The Python interface; each function mirrors a command."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from starhold.laws.pole_placement import place as place
from starhold.report import certificates
from starhold.report import compare as comparing
from starhold.scenario import designing, reading
from starhold.scenario.building import build
from starhold.simulation import lane

if TYPE_CHECKING:
    import xarray as xr

    from starhold.certification.certificate import Certificate
    from starhold.report.flight import Flight


def load(source: str | Path, allow_unstable: bool = False) -> reading.Scenario:
    """The scenario in a TOML file, or the built-in one of that name. InputError says what is wrong with it."""
    return reading.load(source, allow_unstable)


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


def design(scenario: reading.Scenario | str | Path, law: str | None = None) -> list[designing.Design]:
    """The gains that formulas give, with what they can be judged by: every law of a scenario that has a `form`, or the one
    of this name. InputError where there is none."""
    opened = scenario if isinstance(scenario, reading.Scenario) else reading.load(scenario)
    return designing.design(opened, law)


def certify(scenario: reading.Scenario | str | Path, law: str | None = None) -> list[Certificate]:
    """What is proved of every law of a scenario, or of the one of this name, on its spacecraft. Each certificate has an
    `outcome` and `claims` (numbers in SI), and has been tried by ten thousand flights."""
    opened = scenario if isinstance(scenario, reading.Scenario) else reading.load(scenario)
    return [tried.certificate for tried in certificates.certify_scenario(opened, law)]


def compare(scenario: reading.Scenario | str | Path) -> list[Flight]:
    """Fly every law of a scenario; each Flight has the run (`run`, a Dataset) and its `metrics` (SI)."""
    opened = scenario if isinstance(scenario, reading.Scenario) else reading.load(scenario)
    return comparing.compare(opened)
