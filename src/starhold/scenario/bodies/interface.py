"""The interface between bodies and scenarios: a module of this package holds a `BODY` with these members."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from importlib import resources
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

from starhold.errors import InputError
from starhold.laws.catalogue import Law, catalogue
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.part import Fitted

if TYPE_CHECKING:
    from starhold.scenario.reading import LawEntry, Scenario
    from starhold.scenario.schema import LawTable, ScenarioTable


class Made(Protocol):
    """The numbers that a body's tables define; a body may add others."""

    @property
    def craft(self) -> Any:
        """The body's numbers for laws and equations of motion."""
        ...


class Moved(NamedTuple):
    """The numbers of a loop from values of a file's keys: the body's initial state as its motion begins and as the loop is
    made, the craft that flies, the law's nominal model, the saturation limit of the command, and the loop's parts.
    """

    start: Any
    made_with: Any
    craft: Any
    nominal: Any
    limit: Any
    parts: tuple[Fitted, ...]


class Body(Protocol):
    """One body: its tables, its laws, and how they become loops. Its `tables` have a `simulation` that is a `Timing`; a
    table of a part's parameters comes from `schema.columns`."""

    name: str
    """The body's name, that of its module with hyphens."""
    marker: str
    """The top-level table that marks a file as being about this body."""
    tables: type[ScenarioTable]
    """All tables of a file except those of its laws."""
    law_table: type[LawTable]
    """The keys of tables of laws besides their gains."""
    example: str
    """A small scenario in TOML, to which a law's table can be appended."""
    modes: bool = False
    """Whether a law may be made of modes: the body's `Measurement` has what their conditions test."""
    linked: Mapping[str, str] = MappingProxyType({})
    """Keys of `dials` whose value follows another key until they are moved themselves."""
    orbit: str = ""
    """The additional table where a part needs an orbit."""
    modelled: tuple[str, ...] = ()
    """The tables whose numbers define the craft for laws."""
    designed: tuple[str, ...] = ()
    """Further tables whose numbers give gains to laws with a design form."""

    @property
    def template(self) -> str:
        """A commented scenario in TOML that runs as it is and names every key."""
        return (resources.files(type(self).__module__) / "template.toml").read_text(encoding="utf-8")

    def chosen(self, tables: Mapping[str, Any], where: str, folder: Path) -> Body:
        """Return the body of these raw tables, which have the marker: this one, unless the marker's table names another by a
        type or a file. InputError where there is no such body."""
        return self

    def laws(self) -> Mapping[str, Law]:
        """The installed laws by name."""
        return catalogue(self.name)

    def context(self, tables: Mapping[str, Any], where: str) -> Any:
        """Return the context for validators of these raw tables and of laws' gains, such as the units of scaled numbers.
        InputError where the tables do not give it."""
        return None

    def make(self, table: Any, where: str) -> Made:
        """Return the numbers that validated tables define. InputError for numbers that no body has."""
        ...

    def complete(self, scenario: Scenario, law: Law, spec: Any, law_table: Any) -> Any:
        """Return the inputs of a law's design form, completed from the scenario; `law_table` is the law's validated table.
        ValueError where the scenario cannot give them."""
        return spec

    def target(self, scenario: Scenario, given: Any, context: Any, key: str) -> Fitted:
        """Return the target of a mode's raw table, named `key` in errors; for None that of the scenario. InputError where it
        gives none."""
        raise InputError(scenario.where, key, "a target", "none, because this body has no attitude")

    def options(self, scenario: Scenario, law_table: Any, gains: Any, key: str) -> Any:
        """Return the options of a law besides its gains, from its validated table (named `key` in errors) or else from the
        scenario. InputError if they do not fit the gains."""
        return None

    def given(self, scenario: Scenario, entry: LawEntry) -> dict[str, Any]:
        """Return the arguments of `ClosedLoop` from the body's tables for one law: the start, all parts, and those specific
        to the body."""
        ...

    def build(self, scenario: Scenario, entry: LawEntry) -> ClosedLoop:
        """The closed loop of one law."""
        timing = scenario.table.simulation
        shared = {
            "craft": scenario.craft,
            "nominal": scenario.nominal_craft,
            "law": entry.law,
            "gains": entry.gains,
            "period": timing.control_period,
            "substeps": timing.substeps,
            "seed": getattr(timing, "seed", 0),
            "run": getattr(timing, "run", 0),
        }
        return ClosedLoop(**(shared | self.given(scenario, entry)))

    def examine(self, scenario: Scenario, entry: LawEntry, loop: Any) -> None:
        """Raise InputError where the law of a loop, which has been called once, cannot work there."""
        return

    def drawn(self, scenario: Scenario, columns: Mapping[str, Any]) -> dict[str, Any]:
        """Return the arguments of `moved` for many runs that differ in the values of some keys or their components,
        (components..., lanes) by key: an array (lanes,) in place of each number, without arguments that only `build`
        determines."""
        return {}

    def dials(self, scenario: Scenario) -> dict[str, Any]:
        """Return the keys that `moved` accepts, with their numbers in the scenario."""
        return {}

    def moved(self, scenario: Scenario, loop: Any, values: Mapping[str, Any]) -> Moved:
        """Return the numbers of a law's loop under other values of the keys of `dials`: an equation with the same bits as
        `build` of the scenario with these `changes`."""
        return Moved(loop.start, loop.start, loop.craft, loop.craft, loop.saturation_limit(), loop.parts)

    def flown(self, scenario: Scenario, loop: Any, values: Mapping[str, Any], known: Mapping[str, Any]) -> Moved:
        """Return the numbers of a loop that flies with values unknown to laws, or only partly known: an equation."""
        true = self.moved(scenario, loop, values)
        supposed = self.moved(scenario.known, replace(loop, craft=loop.known), known)

        def shared(one: Fitted, other: Fitted, like: Fitted) -> Fitted:
            share = one.part.hook("shared_as")
            return one if share is None else replace(one, params=share(one.params, other.params, like.params))

        parts = (shared(*three) for three in zip(true.parts, supposed.parts, loop.parts, strict=True))
        return true._replace(nominal=supposed.craft, parts=tuple(parts))

    def admitted(self, scenario: Scenario, values: Mapping[str, Any]) -> Any:
        """Return the body's numbers as laws know them under these values of the keys of `dials`, which may be recorded
        numbers; InputError, as for a file, for values that no file may have."""
        return scenario.craft

    def changes(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Return the changes, for a scenario's `with_`, that give keys of `dials` these values."""
        return dict(values)

    def refused(self, scenario: Scenario, columns: Mapping[str, Any]) -> Any:
        """Return which lanes have values, (components..., lanes) by key, that are within the bounds of each number but
        impossible for a body: (lanes,), or None where no such check exists."""
        return None
