"""The [campaign] table of a scenario: which keys are drawn from which distributions, how many runs, and the requirements.

Numbers that carry the unit of another key, such as the bounds of a distribution, stay here as the file has them; the
package `campaign` reads them with those keys' units.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal, TypeAlias, cast

from pydantic import BeforeValidator, Field, WithJsonSchema, model_validator

from starhold.errors import InputError
from starhold.laws.interface import Gain
from starhold.scenario.checking import cut, nearest, show, validate
from starhold.scenario.quantity import quantity
from starhold.scenario.tables import Flag, Name, Table, at_key, refuse, told_at

MOST_RUNS = 10**9
RAW = 'a number, a string with a unit such as "0.1 N m", or a list of them'


def _raw(value: Any) -> Any:
    """The value, if it may stand for a number or numbers of another key."""
    if isinstance(value, list | tuple):
        return [_raw(item) for item in cast(list[Any], value)]
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise refuse(RAW)
    if not isinstance(value, str) and not math.isfinite(value):
        raise refuse("finite numbers")
    return value


_SINGLE = [{"type": "number"}, {"type": "string"}]
_ROW = {"type": "array", "items": {"anyOf": _SINGLE}}


def raw(text: str) -> tuple[BeforeValidator, WithJsonSchema]:
    """The annotations for numbers with the unit of another key: `Annotated[Any, *raw("the least value")]`."""
    schema = {"anyOf": [*_SINGLE, _ROW, {"type": "array", "items": _ROW}], "description": text}
    return BeforeValidator(_raw), WithJsonSchema(schema)


class DispersionTable(Table):
    """One key, or several that are drawn together; each table adds its `distribution`."""

    judged_apart: Annotated[
        Flag, Field(description="known before flight, as the day of launch: runs of equal values are judged by themselves")
    ] = False
    known_to_law: Annotated[
        Flag, Field(description="laws know each drawn value and are designed for it; else for the file's value")
    ] = False


class RelativeTable(DispersionTable):
    """A dispersion whose numbers may be shares."""

    relative: Annotated[Flag, Field(description="the numbers are shares of the file's value")] = False


class SpreadTable(RelativeTable):
    """A dispersion that is drawn for each component on its own, or once for all."""

    together: Annotated[Flag, Field(description="all components move together, by one draw")] = False


class UniformTable(SpreadTable):
    """Every value between two bounds is equally likely."""

    distribution: Literal["uniform"]
    low: Annotated[Any, *raw("the least value")]
    high: Annotated[Any, *raw("the greatest value")]


class NormalTable(SpreadTable):
    """Gauss's distribution."""

    distribution: Literal["normal"]
    mean: Annotated[Any, *raw("by default the file's value")] = None
    sigma: Annotated[Any, *raw("standard deviation")]


class TruncatedNormalTable(SpreadTable):
    """Gauss's distribution between two bounds."""

    distribution: Literal["truncated-normal"]
    mean: Annotated[Any, *raw("of the distribution before it is cut; by default the file's value")] = None
    sigma: Annotated[Any, *raw("standard deviation before it is cut")]
    low: Annotated[Any, *raw("the least value, if there is one")] = None
    high: Annotated[Any, *raw("the greatest value, if there is one")] = None

    @model_validator(mode="after")
    def _is_cut(self) -> TruncatedNormalTable:
        if self.low is None and self.high is None:
            raise at_key("low", "low, high or both; without them it is normal", None)
        return self


class LogNormalTable(SpreadTable):
    """The logarithm has Gauss's distribution."""

    distribution: Literal["log-normal"]
    median: Annotated[Any, *raw("by default the file's value")] = None
    sigma: Annotated[Any, *raw("standard deviation of the natural logarithm, no unit")]


class ChoiceTable(RelativeTable):
    """One of several values."""

    distribution: Literal["choice"]
    values: Annotated[list[Any], Field(description="words, truths or numbers")]
    weights: Annotated[list[Any] | None, Field(description="how likely they are to one another; equally if absent")] = None


class CorrelatedNormalTable(RelativeTable):
    """Gauss's distribution of several numbers together: of the keys that commas divide, or of one vector."""

    distribution: Literal["correlated-normal"]
    mean: Annotated[Any, *raw("by default the file's value")] = None
    sigma: Annotated[Any, *raw("standard deviations")] = None
    correlation: Annotated[Any, *raw("correlations, a row for each number")] = None
    covariance: Annotated[Any, *raw("covariances (SI), a row for each number, in place of sigma and correlation")] = None

    @model_validator(mode="after")
    def _one_matrix(self) -> CorrelatedNormalTable:
        if (self.covariance is None) == (self.correlation is None):
            raise at_key("correlation", "either correlation with sigma, or covariance", self.correlation)
        if (self.covariance is None) == (self.sigma is None):
            allowed = "the standard deviations" if self.sigma is None else "no sigma beside a covariance"
            raise at_key("sigma", allowed, self.sigma)
        return self


class RotationsTable(DispersionTable):
    """An attitude, uniform on the rotation group."""

    distribution: Literal["rotations"]


class ShellTable(RelativeTable):
    """A vector in any direction, uniform in the volume between two norms."""

    distribution: Literal["shell"]
    low: Annotated[Any, *raw("the least norm")] = 0.0
    high: Annotated[Any, *raw("the greatest norm")]


DISTRIBUTIONS: dict[str, type[DispersionTable]] = {
    "uniform": UniformTable,
    "normal": NormalTable,
    "truncated-normal": TruncatedNormalTable,
    "log-normal": LogNormalTable,
    "choice": ChoiceTable,
    "correlated-normal": CorrelatedNormalTable,
    "rotations": RotationsTable,
    "shell": ShellTable,
}
"""The tables of dispersions, by the names of distributions."""


def _read_dispersion(given: Any) -> DispersionTable:
    if isinstance(given, DispersionTable):
        return given
    if not isinstance(given, Mapping):
        raise told_at("", show(given), 'a table such as { distribution = "normal", sigma = 0.1 }')
    table = cast(Mapping[str, Any], given)
    name = table.get("distribution")
    if not isinstance(name, str) or name not in DISTRIBUTIONS:
        described = "nothing" if name is None else show(name)
        raise told_at("distribution", described, nearest(str(name), list(DISTRIBUTIONS)))
    try:
        return validate(DISTRIBUTIONS[name], dict(table), "", "")
    except InputError as error:
        # Raised again by the table around, which knows the rest of the key.
        raise told_at(error.key, error.given, error.allowed) from None


Dispersed: TypeAlias = Annotated[
    Any,
    BeforeValidator(_read_dispersion),
    WithJsonSchema({"anyOf": [table.model_json_schema() for table in DISTRIBUTIONS.values()]}),
]
"""The table of one dispersion, by its distribution."""


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


def read_over(over: Mapping[str, Any], where: str) -> dict[str, Any]:
    """The validated tables of dispersions, by key, from raw ones or from such tables. InputError for the first fault."""
    for key in over:
        if not isinstance(key, str):
            raise InputError(where, "campaign.over", cut(str(key)), 'keys such as "spacecraft.inertia"')
    return validate(CampaignTable, {"over": dict(over)}, where, "campaign").over
