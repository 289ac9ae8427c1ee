"""The gains of a scenario's laws from design formulas, with figures of merit."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from starhold.errors import InputError
from starhold.laws.interface import Field
from starhold.laws.modes import Modes
from starhold.scenario.reading import LawEntry, Scenario


@dataclass(frozen=True, repr=False)
class Design:
    """One designed law: its name in the scenario, its type, its form, the form's inputs and the resulting gains (SI, by
    their names in files and in `starhold laws`; a diagonal matrix as the three numbers on its diagonal), and figures by
    their names in `starhold design`: numbers, or arrays such as P (6, 6), rate first."""

    name: str
    law: str
    form: str
    inputs: dict[str, Any]
    gains: dict[str, Any]
    figures: dict[str, Any]

    def __repr__(self) -> str:
        gains = ", ".join(
            f"{name} = {value:.6g}" if isinstance(value, float) else f"{name} = {value}"
            for name, value in self.gains.items()
        )
        return f"<Design {self.name}: {self.law} {self.form}; {gains}>"


def design(scenario: Scenario, law: str | None = None) -> list[Design]:
    """Return every designed law of a scenario, or the one of this name. InputError where there is none, or where its figures
    cannot be computed."""
    entries = scenario.laws if law is None else (scenario.pick(law),)
    designed = [_design(scenario, entry, entry.form) for entry in entries if entry.form is not None]
    if not designed:
        allowed = 'at least one [[law]] with a form, such as type = "lqr", form = "II"'
        modes = any(isinstance(entry.law.module, Modes) for entry in entries)
        given = "only modes, whose designs are not shown" if modes else "no form"
        raise InputError(scenario.where, "law" if law is None else f"law {law}", given, allowed)
    return designed


def _design(scenario: Scenario, entry: LawEntry, form: str) -> Design:
    try:
        with np.errstate(all="ignore"):
            figures = dict(entry.law.explain(scenario.known.craft, entry.spec))
    except ValueError as error:
        raise InputError(scenario.where, f"law {entry.name}", "", f"figures cannot be computed: {error}") from None
    inputs, gains = written(entry.law.fields(form), entry.spec), written(entry.law.fields(), entry.gains)
    return Design(entry.name, entry.law.name, form, inputs, gains, figures)


def written(items: Iterable[Field], values: Iterable[Any]) -> dict[str, Any]:
    """Return values by name, as in a file."""
    return {item.name: item.written(value) for item, value in zip(items, values, strict=True)}


def map_inputs(scenario: Scenario, law: str | None = None) -> tuple[Any, float, float, float]:
    """Return the numbers for a map of the decay rate: inertia ratios, scaled angle and rate, budget; of the first law
    designed for it. InputError where there is none."""
    entries = scenario.laws if law is None else (scenario.pick(law),)
    for entry in entries:
        teller = getattr(entry.law.module, "map_inputs", None)
        if teller is not None and entry.form is not None:
            return teller(scenario.known.craft, entry.spec)
    raise InputError(scenario.where, "law", "no degree of stability", 'type = "wheel", form = "degree-of-stability"')
