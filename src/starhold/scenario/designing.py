"""The gains that design forms give to a scenario's laws, with figures of merit."""

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
    """One designed law: its name in the scenario, its type and form, the form's inputs and the resulting gains (SI, by
    their keys in files; a diagonal matrix as its three diagonal entries), and figures of merit by their names in `starhold
    design`: numbers, or arrays such as P (6, 6) with the rate first."""

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
    """Return the designs of all laws of a scenario that have a form, or of the law of this name. InputError where there is
    none, or where its figures of merit cannot be computed."""
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
    """Return values by the names of their fields, as in a file."""
    return {item.name: item.written(value) for item, value in zip(items, values, strict=True)}


def map_inputs(scenario: Scenario, law: str | None = None) -> tuple[Any, float, float, float]:
    """Return the inputs for a map of the decay rate: inertia ratios, scaled angle, scaled rate and torque budget of the
    first law designed for a degree of stability. InputError where there is none."""
    entries = scenario.laws if law is None else (scenario.pick(law),)
    for entry in entries:
        teller = getattr(entry.law.module, "map_inputs", None)
        if teller is not None and entry.form is not None:
            return teller(scenario.known.craft, entry.spec)
    raise InputError(scenario.where, "law", "no degree of stability", 'type = "wheel", form = "degree-of-stability"')
