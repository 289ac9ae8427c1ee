"""The Python interface; each function mirrors a command."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from starhold.laws.pole_placement import place as place
from starhold.report.kinds import kind_of
from starhold.scenario import designing, opening, reading

if TYPE_CHECKING:
    import xarray as xr

    from starhold.certification.certificate import Certificate
    from starhold.certification.invariant import Problem
    from starhold.report.failures import Failure
    from starhold.report.flight import Flight
    from starhold.report.modal_roots import Study


def load(source: str | Path, allow_unstable: bool = False) -> opening.AnyScenario:
    """The scenario in a TOML file, or the built-in one of that name. InputError says what is wrong with it."""
    return opening.open_scenario(source, allow_unstable)


def simulate(
    scenario: opening.AnyScenario | str | Path,
    law: str | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> xr.Dataset:
    """Fly one law of a scenario, the first if `law` is None. Returns the Dataset that `starhold run` writes to run.nc;
    `attrs["diverged_at"]` (s) is there only when the motion was lost."""
    opened = _opened(scenario)
    kind, entry = kind_of(opened), opened.laws[0] if law is None else opened.pick(law)
    return kind.record(opened, kind.build(opened, entry), progress).dataset()


def design(scenario: opening.AnyScenario | str | Path, law: str | None = None) -> list[designing.Design]:
    """The gains that formulas give, with what they can be judged by: every law of a scenario that has a `form`, or the one
    of this name. InputError where there is none."""
    opened = _opened(scenario)
    return designing.design(opened, law)


def certify(scenario: opening.AnyScenario | str | Path, law: str | None = None) -> list[Certificate]:
    """What is proved of every law of a scenario, or of the one of this name, on its spacecraft. Each certificate has an
    `outcome` and `claims` (numbers in SI, of station keeping scaled), and has been tried by ten thousand flights."""
    opened = _opened(scenario)
    return [tried.certificate for tried in kind_of(opened).certify_scenario(opened, law)]


def compare(scenario: opening.AnyScenario | str | Path) -> list[Flight]:
    """Fly every law of a scenario; each Flight has the run (`run`, a Dataset) and its `metrics` (SI)."""
    opened = _opened(scenario)
    return kind_of(opened).compare(opened)


def failures(scenario: opening.AnyScenario | str | Path, law: str | None = None) -> list[Failure]:
    """What is left of a scenario on wheels after the loss of any one or two of them, under a law, the first if not given."""
    from starhold.report.failures import study

    opened = _turning(scenario)
    return study(opened, opened.laws[0] if law is None else opened.pick(law))


def modal_roots(scenario: opening.AnyScenario | str | Path, law: str | None = None) -> Study:
    """The roots of the modal law that turn fastest within the limits of a scenario's [transient] table, and the fit."""
    from starhold.report.modal_roots import pick_modal, study

    opened = _turning(scenario)
    return study(opened, pick_modal(opened, law))


def _opened(scenario: opening.AnyScenario | str | Path) -> opening.AnyScenario:
    return opening.open_scenario(scenario) if isinstance(scenario, str | Path) else scenario


def _turning(scenario: opening.AnyScenario | str | Path) -> reading.Scenario:
    opened = _opened(scenario)
    if not isinstance(opened, reading.Scenario):
        raise reading.not_turning(opened.where)
    return opened


def invariant(problem: Problem | str | Path) -> Certificate:
    """What is proved of invariant sets: of a problem made in Python (`starhold.certification.invariant`), of a TOML file, or
    of the built-in problem of that name. Each claim has an `outcome`, numbers (`level`, the set's size) and evidence."""
    from starhold.certification import invariant as sets

    return sets.certify(problem if isinstance(problem, sets.Problem) else sets.load(problem))
