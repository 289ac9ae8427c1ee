"""The [[requirement]] tables of a scenario: requirements on a flight and their methods of verification. Limits are in the
unit of their metric, so they stay as in the file; `studies.requirements` converts them."""

import re
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Annotated, Any, Literal, Self, TypeAlias, cast

from pydantic import AfterValidator, Field, model_validator

from starhold.laws.interface import Gain
from starhold.scenario.quantity import quantity, raw
from starhold.scenario.tables import LONGEST_NAME, Table, at_key, refuse, told_at

CONE = "exclusion-cone"
BEGINS = "mode_begins"
"""The metric "time at which a mode first begins"."""
Method: TypeAlias = Literal["proof", "flight", "campaign", "budget", "margin", "inspection"]
METHODS_OF: Mapping[str, tuple[Method, ...]] = MappingProxyType(
    {
        "after": ("flight", "proof", "campaign"),
        "in_mode": ("flight", "proof", "campaign"),
        "window": ("flight", "campaign"),
        "axis": ("flight", "campaign"),
        "direction": ("flight", "campaign"),
        "share": ("campaign",),
        "confidence": ("campaign",),
        "record": ("inspection",),
    }
)
"""The methods to which a key applies; keys not listed apply to all methods."""
_IN_IDS = "-_. /:#()+{}"


def _check_id(given: str) -> str:
    sound = bool(given) and all(c.isalnum() or c in _IN_IDS for c in given) and given == given.strip()
    if not sound or len(given) > LONGEST_NAME:
        raise refuse(f"at most {LONGEST_NAME} letters, digits and, between them, spaces or any of {_IN_IDS.strip()}")
    return given


Id: TypeAlias = Annotated[str, AfterValidator(_check_id)]


class RequirementTable(Table):
    """A requirement and the method that verifies it; without a method, the requirements derived from it decide."""

    id: Annotated[Id | None, Field(description="identifier in tables, columns and other tools; the metric if absent")] = None
    text: Annotated[str, Field(description="the requirement in words")] = ""
    method: Annotated[Method | None, Field(description="method of verification")] = None
    metric: Annotated[
        str | None, Field(description="the bounded quantity: a metric of summaries, lost, or exclusion-cone")
    ] = None
    at_most: Annotated[Any, *raw("the greatest value allowed, in the metric's unit")] = None
    at_least: Annotated[Any, *raw("the least value allowed, in the metric's unit")] = None
    after: Annotated[Any, *raw("the time from which it is required, since the start or since the mode began")] = None
    in_mode: Annotated[str | None, Field(description="the mode of the law in which it is required")] = None
    window: Annotated[Any, *raw("the two times between which it is required")] = None
    axis: Annotated[Any, *quantity(Gain("1", shape=(3,), spread=False, text="body axis that must stay out of a cone"))] = (
        None
    )
    direction: Annotated[Any, *quantity(Gain("1", shape=(3,), spread=False, text="inertial axis of that cone"))] = None
    share: Annotated[
        float, *quantity(Gain("1", above=0.0, at_most=1.0, text="share of runs that must meet it, such as 99.73 %"))
    ] = 0.9973
    confidence: Annotated[
        float, *quantity(Gain("1", above=0.0, at_most=1.0, text="confidence of the verdict: 1 minus the consumer's risk"))
    ] = 0.9
    record: Annotated[str | None, Field(description="the record of its inspection, a file name relative to this file")] = (
        None
    )
    parent: Annotated[Id | None, Field(description="the id of the requirement that it is derived from")] = None
    rationale: Annotated[str, Field(description="why it is required")] = ""
    file: Annotated[str | None, Field(description="a CSV or ReqIF file of requirements, relative to this one")] = None
    attributes: dict[str, str] = Field(default={}, description="attributes of another tool, kept unchanged")

    @model_validator(mode="after")
    def _has_a_metric(self) -> Self:
        if self.metric is None and self.method not in (None, "inspection"):
            raise at_key("metric", f'this key, required with method = "{self.method}"', None)
        if self.metric is None and self.id is None:
            raise at_key("id", "an id, where there is no metric", None)
        return self

    @model_validator(mode="after")
    def _has_a_cone(self) -> Self:
        for key in ("axis", "direction"):
            value = getattr(self, key)
            if (self.metric == CONE) != (value is not None):
                allowed = "a vector, for the exclusion-cone" if value is None else 'only with metric = "exclusion-cone"'
                raise at_key(key, allowed, value)
            if value is not None and not any(value):
                raise at_key(key, "a vector that is not zero", list(value))
        return self

    @model_validator(mode="after")
    def _can_be_decided(self) -> Self:
        if self.at_most is not None and self.at_least is not None:
            raise at_key("at_least", "either at_most or at_least; a range is two requirements", self.at_least)
        for key in ("share", "confidence"):
            if getattr(self, key) == 1.0:
                raise at_key(key, "below 1, because no number of runs can exclude every exception", 1.0)
        if self.metric == BEGINS:
            unfit = next((key for key in ("after", "window") if getattr(self, key) is not None), None)
            if unfit is not None or self.in_mode is None:
                allowed = "no such key" if unfit else "the name of the mode"
                raise at_key(unfit or "in_mode", f'{allowed}, with metric = "{BEGINS}"', getattr(self, unfit or "in_mode"))
        for key, methods in METHODS_OF.items():
            if key in self.model_fields_set and self.method is not None and self.method not in methods:
                named = " or ".join(f'"{method}"' for method in methods)
                raise at_key(key, f"only with method = {named}", getattr(self, key))
        if self.after is not None and self.window is not None:
            raise at_key("window", "either after or window", self.window)
        return self

    @property
    def called(self) -> str:
        """The requirement's id, by default the metric's name."""
        return self.id or str(self.metric)


KEYS = tuple(name for name in RequirementTable.model_fields if name not in ("attributes", "file"))
"""The keys of requirements, which name columns in files; any other column is an attribute."""
ALIASES = {
    "identifier": "id",
    "object_identifier": "id",
    "reqif.foreignid": "id",
    "object_text": "text",
    "reqif.text": "text",
}
"""Names of some keys in other tools, in lower case with underscores."""


def key_of(column: str) -> str | None:
    """Return the key of a requirement for a column of this name, or None."""
    name = re.sub(r"[\s-]+", "_", column.strip().casefold())
    name = ALIASES.get(name, name)
    return name if name in KEYS else None


def column_of(table: RequirementTable) -> str:
    """Return the name, among the measured metrics, of the one that a requirement bounds."""
    if table.metric == CONE:
        return f"angle of {table.called}" if table.id else "cone_angle"
    if table.metric == BEGINS:
        return f"begin of {table.in_mode}"
    return f"{table.metric} of {table.called}" if is_of_a_part(table) else str(table.metric)


def is_of_a_part(table: RequirementTable) -> bool:
    """Return whether a requirement applies to a part of each run only: a mode or a time window."""
    parted = any(given is not None for given in (table.after, table.in_mode, table.window))
    return parted and table.method == "campaign" and table.metric != BEGINS


def without_requirements(given: Any, method: Method) -> Any:
    """Return a raw table unchanged; refuse requirements in it, which now belong in [[requirement]] tables."""
    if isinstance(given, dict) and "requirement" in given:
        raise told_at("requirement", "an old key", f'[[requirement]] tables with id, metric and method = "{method}"')
    return cast(Any, given)


def check_family(requirements: Sequence[RequirementTable]) -> None:
    """Refuse requirements whose ids differ at most in case (ids name columns, and SQL ignores case), unknown parents, and
    requirements with neither a method nor any derived from them."""
    ids = [requirement.called.casefold() for requirement in requirements]
    parents = {one.called: one.parent for one in requirements}
    for number, one in enumerate(requirements, 1):
        key = f"requirement[{number}]"
        if ids[number - 1] in ids[: number - 1]:
            raise at_key(f"{key}.id", "an id that no other requirement has, in any case", one.called)
        line, above = {one.called}, one.parent
        while above is not None:
            if above not in parents or above in line:
                raise at_key(f"{key}.parent", "the id of another requirement, which is not derived from it", one.parent)
            line, above = line | {above}, parents[above]
    for number, one in enumerate(requirements, 1):
        if one.method is None and one.called not in parents.values():
            raise at_key(f"requirement[{number}].method", "proof, flight, campaign, budget, margin or inspection", None)
