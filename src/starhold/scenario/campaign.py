"""The [campaign] table of a scenario: distributions of keys, and the number of runs. Parameters in the unit of another key,
such as the bounds of a distribution, stay as in the file; the package `campaign` converts them."""

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from starhold.laws.interface import Gain
from starhold.scenario.distributions import Dispersed
from starhold.scenario.quantity import quantity
from starhold.scenario.requirement import without_requirements
from starhold.scenario.tables import Table

MOST_RUNS = 10**9


class CampaignTable(Table):
    """Many runs with numbers drawn from distributions, judged by the requirements with method = "campaign"."""

    runs: Annotated[int, *quantity(Gain("1", at_least=1, at_most=MOST_RUNS, whole=True, text="runs of each law"))] = 10_000
    seed: Annotated[int, *quantity(Gain("1", at_least=0, at_most=2**53, whole=True, text="seed of the draws"))] = 1
    sampling: Annotated[
        Literal["random", "sobol", "latin-hypercube", "morris", "saltelli"],
        Field(description="sampling method; the last two give sensitivity indices of the inputs"),
    ] = "random"
    metrics: list[str] = Field(default=[], description="further metrics to measure: overshoot, iterations")
    over: dict[str, Dispersed] = Field(default={}, description="distributions by key")

    @model_validator(mode="before")
    @classmethod
    def _without_requirements(cls, given: Any) -> Any:
        return without_requirements(given, "campaign")
