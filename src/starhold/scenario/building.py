"""Builds closed loops from a scenario."""

from starhold.laws.modes import mode_laws
from starhold.loop.closed_loop import ClosedLoop
from starhold.loop.modes import loop_of_mode
from starhold.scenario.checking import check_substeps, try_law
from starhold.scenario.parts import check_fit, try_parts
from starhold.scenario.possible import check_possible
from starhold.scenario.reading import LawEntry, Scenario


def build(scenario: Scenario, entry: LawEntry, drawn: bool = False) -> ClosedLoop:
    """Return the closed loop of one law of a scenario. InputError where the law cannot work with its gains, the integration
    cannot resolve the loop, or, unless its numbers are drawn, a condition of a mode can never hold."""
    loop = scenario.hooks.build(scenario, entry)
    check_fit(loop, scenario.where)
    if not drawn:
        check_possible(loop, scenario.where, f"law {entry.name}")
    try_parts(loop, scenario.where, f"law {entry.name}")
    check_substeps(loop, scenario.where)
    try_law(loop, scenario.where, f"law {entry.name}")
    for place, (mode, _, _) in enumerate(mode_laws(entry.law, entry.gains)):
        try_law(loop_of_mode(loop, place), scenario.where, f"law {entry.name}, mode {mode}")
    scenario.hooks.examine(scenario, entry, loop)
    return loop
