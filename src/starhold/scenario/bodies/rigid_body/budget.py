"""The table of a pointing error budget: when errors are taken, over which windows, and what is required of them."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from starhold.laws.interface import Gain
from starhold.scenario.quantity import quantity
from starhold.scenario.tables import Table, at_key

MOST_RUNS = 100_000
ANGLE = "largest of all sources together, about the boresight where there is one"


def _at_most(index: str) -> Any:
    return quantity(Gain("rad", above=0.0, text=f"{index}, {ANGLE}"))


class PointingRequirement(Table):
    """The largest errors that are allowed."""

    ape: Annotated[float | None, *_at_most("absolute performance error")] = None
    mpe: Annotated[float | None, *_at_most("mean performance error")] = None
    rpe: Annotated[float | None, *_at_most("relative performance error")] = None
    pde: Annotated[float | None, *_at_most("performance drift error")] = None


class BudgetTable(Table):
    """How `starhold budget` takes pointing errors."""

    start: Annotated[
        float | None, *quantity(Gain("s", at_least=0.0, text="errors count from here on; half of the run if absent"))
    ] = None
    window: Annotated[
        float | None, *quantity(Gain("s", above=0.0, text="length of windows; a tenth of what counts if absent"))
    ] = None
    separation: Annotated[
        float | None,
        *quantity(Gain("s", above=0.0, text="between the starts of two windows of a drift; half of what counts if absent")),
    ] = None
    confidence: Annotated[
        float, *quantity(Gain("1", above=0.0, at_most=1.0, text="share of the errors that are no larger, such as 95 %"))
    ] = 0.9973
    interpretation: Annotated[
        Literal["mixed", "temporal", "ensemble"],
        Field(description="a share of all instants of all runs, of those of the worst run, or of runs at their worst"),
    ] = "mixed"
    runs: Annotated[
        int, *quantity(Gain("1", at_least=1, at_most=MOST_RUNS, whole=True, text="with random numbers of their own"))
    ] = 32
    boresight: Annotated[
        Any, *quantity(Gain("1", shape=(3,), spread=False, text="line of sight, body axes; all three axes if absent"))
    ] = None
    requirement: PointingRequirement = PointingRequirement()

    @model_validator(mode="after")
    def _has_a_direction(self) -> BudgetTable:
        if self.boresight is not None and not any(self.boresight):
            raise at_key("boresight", "a direction that is not zero", list(self.boresight))
        return self
