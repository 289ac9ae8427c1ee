"""The [campaign] table of a scenario: which keys are drawn from which distributions, how many runs, and the requirements.

Numbers that carry the unit of another key, such as the bounds of a distribution, stay here as the file has them; the
package `campaign` reads them with those keys' units.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from starhold.laws.interface import Gain
from starhold.scenario.distributions import Dispersed
from starhold.scenario.quantity import quantity, raw
from starhold.scenario.tables import Name, Table, at_key

MOST_RUNS = 10**9


class RequirementTable(Table):
    """A bound of a metric, and the share of the runs that must keep it."""

    name: Annotated[Name | None, Field(description="how tables and columns call it; the metric if absent")] = None
    metric: Annotated[str, Field(description="what is required: a metric as summaries name them, lost, or exclusion-cone")]
    at_most: Annotated[Any, *raw("the greatest value allowed, in the metric's unit")] = None
    at_least: Annotated[Any, *raw("the least value allowed, in the metric's unit")] = None
    axis: Annotated[Any, *quantity(Gain("1", shape=(3,), spread=False, text="body axis that keeps out of a cone"))] = None
    direction: Annotated[Any, *quantity(Gain("1", shape=(3,), spread=False, text="inertial axis of that cone"))] = None
    share: Annotated[
        float, *quantity(Gain("1", above=0.0, at_most=1.0, text="of the runs that must keep it, such as 99.73 %"))
    ] = 0.9973
    confidence: Annotated[
        float, *quantity(Gain("1", above=0.0, at_most=1.0, text="of the verdict: one less the consumer's risk"))
    ] = 0.9

    @model_validator(mode="after")
    def _has_a_cone(self) -> RequirementTable:
        for key in ("axis", "direction"):
            value = getattr(self, key)
            if (self.metric == "exclusion-cone") != (value is not None):
                allowed = "a vector, for the exclusion-cone" if value is None else 'only with metric = "exclusion-cone"'
                raise at_key(key, allowed, value)
            if value is not None and not any(value):
                raise at_key(key, "a vector that is not zero", list(value))
        return self

    @model_validator(mode="after")
    def _can_be_decided(self) -> RequirementTable:
        if self.at_most is not None and self.at_least is not None:
            raise at_key("at_least", "either at_most or at_least; a range is two requirements", self.at_least)
        for key in ("share", "confidence"):
            if getattr(self, key) == 1.0:
                raise at_key(key, "below 1, for no number of runs shows that there is no exception", 1.0)
        return self

    @property
    def called(self) -> str:
        """Its name, by default the metric's."""
        return self.name or self.metric


class CampaignTable(Table):
    """Many runs with numbers drawn from distributions, and the requirements on them."""

    runs: Annotated[int, *quantity(Gain("1", at_least=1, at_most=MOST_RUNS, whole=True, text="of each law"))] = 10_000
    seed: Annotated[int, *quantity(Gain("1", at_least=0, at_most=2**53, whole=True, text="of the draws"))] = 1
    sampling: Annotated[
        Literal["random", "sobol", "latin-hypercube", "morris", "saltelli"],
        Field(description="how the draws are placed; the last two for the shares that inputs have in the result"),
    ] = "random"
    metrics: list[str] = Field(default=[], description="to be measured beside the usual ones: overshoot, iterations")
    over: dict[str, Dispersed] = Field(default={}, description="distributions by the keys that they are of")
    requirement: list[RequirementTable] = Field(default=[], description="what runs must keep")

    @model_validator(mode="after")
    def _names_differ(self) -> CampaignTable:
        # Without regard to case, for columns have these names, and SQL ignores it.
        names = [requirement.called.casefold() for requirement in self.requirement]
        for number, name in enumerate(names, 1):
            if name in names[: number - 1]:
                called = self.requirement[number - 1].called
                raise at_key(f"requirement[{number}].name", "a name that no other requirement has, in any case", called)
        return self
