"""What flies, draws and writes each kind of scenario: modules with `build`, `record`, `fly_law`,
`timed`, `prove`, `compare`, `certify_scenario`, `sketch` and `write`."""

from __future__ import annotations

from types import ModuleType

from starhold.scenario.opening import AnyScenario
from starhold.scenario.reading import Scenario


def kind_of(scenario: AnyScenario) -> ModuleType:
    """The module for scenarios of this kind."""
    if isinstance(scenario, Scenario):
        from starhold.report import compare

        return compare
    from starhold.report.station import compare

    return compare
