"""The interface between bodies and scenarios: a module of this package holds a `BODY` with these members."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from importlib import resources
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

from starhold.errors import InputError
from starhold.laws.catalogue import Law, catalogue, find
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.part import Fitted

if TYPE_CHECKING:
    from starhold.scenario.reading import LawEntry, Scenario
    from starhold.scenario.schema import LawTable, ScenarioTable


class Made(Protocol):
    """The numbers that a body's tables define; a body may add others."""

    @property
    def craft(self) -> Any:
        """The body's numbers (its craft), as used by laws and equations of motion."""
        ...


class Moved(NamedTuple):
    """The numbers of a loop for given values of a file's keys: the body's state when its motion begins and when the loop is
    made, the craft that flies, the law's nominal model, the saturation limit of the command, and the loop's parts."""

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
    """Whether a law may consist of modes: the body's `Measurement` contains the quantities that their conditions test."""
    linked: Mapping[str, str] = MappingProxyType({})
    """Keys of `dials` that have the value of another key until they are changed themselves."""
    orbit: str = ""
    """The TOML text to append to `example` for a part that needs an orbit."""
    modelled: tuple[str, ...] = ()
    """The tables whose numbers define the craft that laws know."""
    designed: tuple[str, ...] = ()
    """Further tables from which design forms compute gains."""

    @property
    def template(self) -> str:
        """A commented scenario in TOML that runs as it is and names every key."""
        return (resources.files(type(self).__module__) / "template.toml").read_text(encoding="utf-8")

    def chosen(self, tables: Mapping[str, Any], where: str, folder: Path) -> Body:
        """Return the body of raw tables with this marker: this body, unless the marker's table names another by its type or
        file. InputError where that body does not exist."""
        return self

    def laws(self) -> Mapping[str, Law]:
        """The installed laws by name."""
        return catalogue(self.name)

    def law(self, name: str) -> Law | None:
        """Return the installed law of this name; None if there is none."""
        return find(self.name, name)

    def context(self, tables: Mapping[str, Any], where: str) -> Any:
        """Return the context in which raw tables and gains are validated, such as the units of scaled numbers. InputError
        where the tables do not determine it."""
        return None

    def make(self, table: Any, where: str) -> Made:
        """Return the numbers that validated tables define. InputError for a body that is physically impossible."""
        ...

    def complete(self, scenario: Scenario, law: Law, spec: Any, law_table: Any) -> Any:
        """Return the inputs of a law's design form, completed from the scenario; `law_table` is the law's validated table.
        ValueError where the scenario cannot give them."""
        return spec

    def target(self, scenario: Scenario, given: Any, context: Any, key: str) -> Fitted:
        """Return the target that a mode's raw table defines, or the scenario's where the table is None; `key`: its name in
        errors. InputError where it defines no target."""
        raise InputError(scenario.where, key, "a target", "none, because this body has no attitude")

    def options(self, scenario: Scenario, law_table: Any, gains: Any, key: str) -> Any:
        """Return a law's options, which are not gains, from its validated table (`key` in errors), by default from the
        scenario. InputError if they do not fit the gains."""
        return None

    def given(self, scenario: Scenario, entry: LawEntry) -> dict[str, Any]:
        """Return the arguments of `ClosedLoop` that the body's tables determine for one law: the initial state, the parts,
        and arguments specific to the body."""
        ...

    def build(self, scenario: Scenario, entry: LawEntry) -> ClosedLoop:
        """Return the closed loop of one law."""
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
        """Raise InputError where a law, already called once without error, cannot work in its loop."""
        return

    def drawn(self, scenario: Scenario, columns: Mapping[str, Any]) -> dict[str, Any]:
        """Return the arguments of `moved` for a batch of runs, with an array (lanes,) in place of each number; columns: the
        values of the keys (or single components) in which runs differ, (components..., lanes) by key. Arguments that only
        `build` determines are left out."""
        return {}

    def dials(self, scenario: Scenario) -> dict[str, Any]:
        """Return the keys that `moved` accepts, each with its value in the scenario."""
        return {}

    def moved(self, scenario: Scenario, loop: Any, values: Mapping[str, Any]) -> Moved:
        """Return the numbers of a law's loop for other values of the keys of `dials`. This is an equation whose result
        equals bit for bit what `build` gives for the scenario with these `changes`."""
        return Moved(loop.start, loop.start, loop.craft, loop.craft, loop.saturation_limit(), loop.parts)

    def flown(self, scenario: Scenario, loop: Any, values: Mapping[str, Any], known: Mapping[str, Any]) -> Moved:
        """Return, by an equation, the numbers of a loop that flies with `values`, of which its law knows only `known`."""
        true = self.moved(scenario, loop, values)
        supposed = self.moved(scenario.known, replace(loop, craft=loop.known), known)

        def shared(one: Fitted, other: Fitted, like: Fitted) -> Fitted:
            share = one.part.hook("shared_as")
            return one if share is None else replace(one, params=share(one.params, other.params, like.params))

        parts = (shared(*three) for three in zip(true.parts, supposed.parts, loop.parts, strict=True))
        return true._replace(nominal=supposed.craft, parts=tuple(parts))

    def admitted(self, scenario: Scenario, values: Mapping[str, Any]) -> Any:
        """Return the craft that laws know for these values of the keys of `dials`, which may be recorded numbers. InputError
        for values that would be refused in a file."""
        return scenario.craft

    def changes(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Return the argument of `Scenario.with_` that sets keys of `dials` to these values."""
        return dict(values)

    def refused(self, scenario: Scenario, columns: Mapping[str, Any]) -> Any:
        """Return a mask (lanes,) of the runs whose values, (components..., lanes) by key, are each within bounds but
        together impossible for the body; None where nothing needs to be checked."""
        return None
