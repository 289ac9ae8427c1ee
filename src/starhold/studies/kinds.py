"""What flies, draws and writes each kind of scenario: modules with `build`, `record`, `name_samples`, `metrics_of`,
`fly_law`, `timed`, `prove`, `compare`, `certify_scenario`, `sketch` and `write`."""

from __future__ import annotations

from types import ModuleType

from starhold.scenario.reading import Scenario


def kind_of(scenario: Scenario) -> ModuleType:
    """The module for scenarios of this kind."""
    return kind_module(scenario.body == "rigid-body")


def kind_module(turning: bool) -> ModuleType:
    """The module for scenarios of bodies that turn, or of station keeping."""
    if turning:
        from starhold.studies import compare

        return compare
    from starhold.studies import station as compare

    return compare
