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
    from starhold.report.failures import Failure
    from starhold.report.flight import Flight
    from starhold.report.modal_roots import Study


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
    opened = _opened(scenario)
    entry = opened.laws[0] if law is None else opened.pick(law)
    timing = opened.table.simulation
    return lane.simulate(build(opened, entry), timing.steps, timing.record_every, progress=progress)


def design(scenario: reading.Scenario | str | Path, law: str | None = None) -> list[designing.Design]:
    """The gains that formulas give, with what they can be judged by: every law of a scenario that has a `form`, or the one
    of this name. InputError where there is none."""
    opened = _opened(scenario)
    return designing.design(opened, law)


def certify(scenario: reading.Scenario | str | Path, law: str | None = None) -> list[Certificate]:
    """What is proved of every law of a scenario, or of the one of this name, on its spacecraft. Each certificate has an
    `outcome` and `claims` (numbers in SI), and has been tried by ten thousand flights."""
    opened = _opened(scenario)
    return [tried.certificate for tried in certificates.certify_scenario(opened, law)]


def compare(scenario: reading.Scenario | str | Path) -> list[Flight]:
    """Fly every law of a scenario; each Flight has the run (`run`, a Dataset) and its `metrics` (SI)."""
    opened = _opened(scenario)
    return comparing.compare(opened)


def failures(scenario: reading.Scenario | str | Path, law: str | None = None) -> list[Failure]:
    """What is left of a scenario on wheels after the loss of any one or two of them, under a law, the first if not given."""
    from starhold.report.failures import study

    opened = _opened(scenario)
    return study(opened, opened.laws[0] if law is None else opened.pick(law))


def modal_roots(scenario: reading.Scenario | str | Path, law: str | None = None) -> Study:
    """The roots of the modal law that turn fastest within the limits of a scenario's [transient] table, and the fit."""
    from starhold.report.modal_roots import pick_modal, study

    opened = _opened(scenario)
    return study(opened, pick_modal(opened, law))


def _opened(scenario: reading.Scenario | str | Path) -> reading.Scenario:
    return scenario if isinstance(scenario, reading.Scenario) else reading.load(scenario)
