"""The tables common to the scenarios of all bodies, and those of laws."""

import math
from collections.abc import Iterable, Mapping
from functools import cache, reduce
from types import MappingProxyType
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import Field, create_model, model_validator

from starhold.laws.catalogue import Law
from starhold.laws.interface import Field as Parameter
from starhold.laws.interface import Gain
from starhold.scenario.campaign import CampaignTable
from starhold.scenario.checking import MOST_SUBSTEPS
from starhold.scenario.quantity import any_quantity, quantity
from starhold.scenario.requirement import RequirementTable, check_family
from starhold.scenario.tables import Name, Table, at_key, own_fields

APART = ("law", "part")
"""Arrays of tables that are read one by one, each by its type."""
MOST_STEPS = 1e12
"""The most control steps of a run: beyond, rounding would lose their count and no run would end."""


class ScenarioTable(Table):
    """A scenario file without its laws; a body's subclass adds its tables, including a `simulation`."""

    name: Annotated[Name, Field(description="name of results and folders")]
    description: Annotated[str, Field(description="a sentence for the report")] = ""
    requirement: list[RequirementTable] = Field(default=[], description="what is required, and how it is verified")
    campaign: CampaignTable | None = None
    nominal: dict[str, dict[str, Any] | list[dict[str, Any]]] = Field(
        default={},
        description="tables that laws assume and are designed for, in place of the file's tables of the same names",
    )
    SHARED: ClassVar[Mapping[str, Any]] = MappingProxyType({})
    """The keys that set a number of all parts that declare it as `shared`, with their defaults."""

    @model_validator(mode="after")
    def _requirements_fit(self) -> Self:
        check_family(self.requirement)
        return self

    @property
    def shared(self) -> dict[str, Any]:
        """The values of the shared keys."""
        given = {key: reduce(lambda table, name: getattr(table, name, None), key.split("."), self) for key in self.SHARED}
        return {key: self.SHARED[key] if value is None else value for key, value in given.items()}


class LawTable(Table):
    """The keys of every law table besides the law's own gains; a body's subclass adds its own."""

    type: str
    name: Annotated[Name | None, Field(description="its name in tables and folders; the type if absent")] = None


class Timing(Table):
    """The duration of a run and its time steps; a body's subclass gives the units."""

    unit: ClassVar[str] = ""
    """The unit of times in errors: a space and its name."""
    duration: float
    control_period: float
    substeps: Annotated[
        int, *quantity(Gain("1", at_least=1, at_most=MOST_SUBSTEPS, whole=True, text="integration steps per control period"))
    ] = 1
    record_every: Annotated[int, *quantity(Gain("1", at_least=1, whole=True, text="control steps per recorded sample"))] = 1

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if self.control_period > self.duration:
            raise at_key("control_period", f"at most the duration, {self.duration:g}{self.unit}", self.control_period)
        if not self.duration / self.control_period <= MOST_STEPS:
            raise at_key("duration", f"at most {MOST_STEPS:.0e} control periods", self.duration)
        if self.record_every > self.steps:
            raise at_key("record_every", f"at most the {self.steps} control steps of the run", self.record_every)
        return self

    @property
    def steps(self) -> int:
        """The number of control steps of a run."""
        return round(self.duration / self.control_period)


class SeededTiming(Timing):
    """The duration in whole control periods, the steps, and the seed of the random numbers."""

    seed: Annotated[int, *quantity(Gain("1", at_least=0, at_most=2**53, whole=True, text="seed of all random numbers"))] = 1
    run: Annotated[
        int,
        *quantity(
            Gain(
                "1",
                at_least=0,
                at_most=2**53,
                whole=True,
                text="number of the run in a campaign, which selects its random numbers",
            )
        ),
    ] = 0

    @model_validator(mode="after")
    def _whole_steps(self) -> Self:
        count = self.duration / self.control_period
        if abs(count - round(count)) > 1e-6:
            raise at_key(
                "duration", f"a whole number of control periods of {self.control_period:g}{self.unit}", self.duration
            )
        return self


def columns(declared: Iterable[Parameter]) -> dict[str, Any]:
    """Return the keys, for pydantic's `create_model`, of a table with the declared parameters of a law or another part."""
    keys: dict[str, Any] = {}
    for item in declared:
        written = item.default if item.required else item.written(item.default)
        # A key may be left out whose default is None, infinite or a table without rows.
        written = None if written == () or (isinstance(written, float) and not math.isfinite(written)) else written
        kind = Annotated[Any, *any_quantity(item.gain), Field(validate_default=written is not None)]
        keys[item.name] = (kind, ... if item.required else written)
    return keys


@cache
def law_model(law: Law, form: str | None, base: type[LawTable], shared: tuple[str, ...]) -> Any:
    """Return the model of the table of a law, or of one of its design forms. base: the model of the keys common to such
    laws; shared: scenario keys that set some of the gains instead."""
    entries: dict[str, Any] = {"type": (Literal[law.name], law.name)}
    if form is not None:
        entries["form"] = (Literal[form], form)
    title = law.name.replace("-", " ").title().replace(" ", "") + (form or "").title()
    return create_model(
        title, __base__=base, __doc__=law.card.summary, **entries, **columns(own_fields(law.fields(form), shared))
    )
