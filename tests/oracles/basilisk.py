"""Basilisk's simulations, for tests: loaded where they run, for not every machine has it."""

from typing import Any

import pytest


def simulation(step: float, *models: Any) -> Any:
    """A simulation of these models with an integration step (s), ready to run, and what runs it up to a time (s)."""
    from Basilisk.utilities import SimulationBaseClass, macros

    made = SimulationBaseClass.SimBaseClass()
    made.CreateNewProcess("p").addTask(made.CreateNewTask("t", macros.sec2nano(step)))
    for model in models:
        made.AddModelToTask("t", model)
    made.InitializeSimulation()

    def run(until: float) -> None:
        made.ConfigureStopTime(macros.sec2nano(until))
        made.ExecuteSimulation()

    return made, run


def need() -> None:
    """Skip the test where Basilisk is not."""
    pytest.importorskip("Basilisk", reason="Basilisk comes with the test extra where it has a wheel")
