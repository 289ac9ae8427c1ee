"""Scenarios of a body without tables of its own, recognized by their [body] table. The body is an installed part or one in
a file; its parameters are the keys of [body], and the fields of its state are the keys of [initial]."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple, cast

from pydantic import BeforeValidator, ConfigDict, Field, ValidationInfo, create_model

from starhold.algebra.quantity import quantities
from starhold.algebra.vector import ZERO
from starhold.errors import InputError, input_at, is_interrupt
from starhold.laws.catalogue import Law
from starhold.laws.interface import Gain
from starhold.loop.closed_loop import ClosedLoop
from starhold.loop.kernels import make_step
from starhold.parts import contract
from starhold.parts.catalogue import body_from_file, error_line, parts
from starhold.parts.part import Fitted, Part
from starhold.scenario import bodies
from starhold.scenario.bodies.interface import Body
from starhold.scenario.checking import in_file, nearest, show
from starhold.scenario.parts import params_of, with_rows
from starhold.scenario.quantity import quantity
from starhold.scenario.schema import LawTable, ScenarioTable, SeededTiming, columns
from starhold.scenario.tables import Table

if TYPE_CHECKING:
    from starhold.scenario.reading import LawEntry, Scenario

MARKER = "body"


class AnyTiming(SeededTiming):
    """The duration of a run, its control period and its integration steps."""

    lost_beyond: Annotated[
        float | None, *quantity(Gain(above=0.0, text="divergence bound on the distance; none if absent"))
    ] = None


class BodyFromFile(Table):
    """A body defined in a Python file."""

    model_config = ConfigDict(extra="allow")
    file: Annotated[str, Field(description="a Python file that holds a body, relative to this one; it is run")]


class AnyCommand(Table):
    """The limit of every law's command."""

    limit: Annotated[float | None, *quantity(Gain(above=0.0, text="largest command; none if absent"))] = None
    limit_kind: Annotated[
        Literal["axis", "norm"], Field(description="whether the limit holds for each axis or for the norm")
    ] = "axis"


class BodyFromFileTables(ScenarioTable):
    """A scenario of a body in a file, without the law tables and the keys that the body declares."""

    body: BodyFromFile
    control: AnyCommand = AnyCommand()
    initial: dict[str, Any] = Field(default={}, description="the fields of the body's state")
    simulation: AnyTiming


class Context(NamedTuple):
    """The scenario's name in errors, and the folder to which its file names are relative. Numbers are in the body's units,
    none scaled."""

    where: str
    folder: Path
    length: float = 1.0
    velocity: float = 1.0
    acceleration: float = 1.0
    time: float = 1.0
    rate: float = 1.0


class Made(NamedTuple):
    """The parameters of a body, and the numbers for laws and equations of motion."""

    params: Any
    craft: Any


class AnyBody(Body):
    """A body whose tables and units follow from what its part declares."""

    marker = MARKER
    modelled = (MARKER,)
    law_table = LawTable

    def __init__(self, part: Part, folder: Path = Path()) -> None:
        self.part, self.folder = part, folder
        self.name, self.tables, self.example = part.name, tables_of(part), _example(part)

    def context(self, tables: Mapping[str, Any], where: str) -> Context:
        return Context(where, self.folder)

    def make(self, table: Any, where: str) -> Made:
        params = params_of(self.part, table.body, {}) if _params(self.part) else contract.NoParams()
        make = self.part.hook("make")
        try:
            return Made(params, params if make is None else make(params))
        except BaseException as error:
            if is_interrupt(error):
                raise
            why = str(error) if type(error) is ValueError else error_line(error, self.part.file)
            raise InputError(where, MARKER, "", why) from None

    def given(self, scenario: Scenario, entry: LawEntry) -> dict[str, Any]:
        table, module, limit = scenario.table, self.part.module, scenario.table.control.limit
        values = {item.name: getattr(table.initial, item.name) for item in _state(self.part)}
        return {
            "start": module.State(**values, **{module.COMMAND: ZERO}),
            "parts": (Fitted(self.part, cast(Made, scenario.made).params), *scenario.parts),
            "limit": "none" if limit is None else table.control.limit_kind,
            "command_limit": limit or math.inf,
            "divergence_bound": table.simulation.lost_beyond or math.inf,
        }

    def examine(self, scenario: Scenario, entry: LawEntry, loop: ClosedLoop) -> None:
        lost = make_step(loop.composition()).check(loop.carry(), 0, loop.setup()).lost_at
        if lost >= 0.0:
            raise InputError(scenario.where, "initial", "a start that the body counts as diverged", "a sound one")


class NamedByTable:
    """A placeholder for all these bodies until a file's [body] table names one."""

    name = ""
    marker = MARKER
    tables = BodyFromFileTables
    law_table = LawTable
    example = ""
    modes = False

    def laws(self) -> Mapping[str, Law]:
        return {}

    def law(self, name: str) -> Law | None:
        return None

    def chosen(self, tables: Mapping[str, Any], where: str, folder: Path) -> AnyBody:
        table = tables[MARKER]
        if not isinstance(table, dict):
            raise InputError(where, MARKER, show(table), "a table")
        given = cast(dict[str, Any], table)
        if "file" in given:
            return in_file(given, lambda path: _read(path, folder), "body", folder, where, MARKER)
        name, tabled = given.get("type"), bodies.bodies()
        if isinstance(name, str) and name in tabled:
            raise InputError(where, f"{MARKER}.type", show(name), f"the [{tabled[name].marker}] table, which gives it")
        known = {part.name: part for part in parts("body").values() if part.name not in tabled}
        if not isinstance(name, str) or name not in known:
            given_name = "nothing" if name is None else show(name)
            allowed = (
                f"{nearest(str(name), list(known))}; or a file" if known else "a file, because no other body is installed"
            )
            raise InputError(where, f"{MARKER}.type", given_name, allowed)
        with input_at(where, f"{MARKER}.type"):
            return AnyBody(known[name], folder)


NAMED_BY_TABLE = NamedByTable()


def _read(path: Path, folder: Path) -> AnyBody:
    part, known = body_from_file(path), bodies.bodies()
    if part.file is None and part.name in known:
        raise ValueError(f"the body {part.name}, which the [{known[part.name].marker}] table gives")
    return AnyBody(part, folder)


@cache
def tables_of(part: Part) -> type[ScenarioTable]:
    """Return the model of a body's scenario file without its law tables. ValueError, in one line, where the part declares
    a field that a file cannot give."""
    try:
        state, params = _state(part), _params(part)
        recorded = quantities(part.module.Sample)
    except (AttributeError, NameError, TypeError) as error:
        raise ValueError(f"{part.module.__file__}: {error}") from None
    if part.module.COMMAND not in part.module.State._fields:
        raise ValueError(f"{part.module.__file__}: State has no field {part.module.COMMAND}, the COMMAND")
    for item in state:
        if len(item.gain.shape) > 1 or item.gain.whole or item.gain.choices or item.gain.columns:
            raise ValueError(f"{part.module.__file__}: State.{item.name} must be a number or a vector")
    if taken := {"type", "file"} & {item.name for item in params}:
        raise ValueError(f"{part.module.__file__}: Params has a field {taken.pop()}, a key that names the body")
    title = part.name.replace("-", " ").title().replace(" ", "")
    named: Any = {"type": (Literal[part.name], ...)} if part.file is None else {"file": (str, ...)}
    body: Any = create_model(f"{title}Body", __base__=Table, __doc__=part.card.summary, **named, **columns(params))
    initial: Any = create_model(f"{title}Initial", __base__=Table, __doc__="The initial state.", **columns(state))
    unit = getattr(part.module, "TIME_UNIT", "s")
    command = recorded["command"].unit if "command" in recorded else "1"
    limit = quantity(Gain(command, above=0.0, text="largest command; none if absent"))
    control: Any = create_model(
        f"{title}Control", __base__=AnyCommand, __doc__=AnyCommand.__doc__, limit=(Annotated[float | None, *limit], None)
    )
    time, said = ("s", "") if unit == "s" else ("1", f", in {unit}")
    duration = quantity(Gain(time, above=0.0, text=f"length of the run, in whole control periods{said}"))
    hold = quantity(Gain(time, above=0.0, text=f"time for which a command is held{said}"))
    timing: Any = create_model(
        f"{title}Timing",
        __base__=AnyTiming,
        __doc__=AnyTiming.__doc__,
        duration=(Annotated[float, *duration], ...),
        control_period=(Annotated[float, *hold], ...),
    )

    def rows(table: Any, info: ValidationInfo) -> Any:
        context = cast(Context, info.context)
        return with_rows(part, table, context.folder, context.where, MARKER) if isinstance(table, dict) and params else table

    whole: Any = {
        "body": (Annotated[body, BeforeValidator(rows)], ...),
        "control": (control, control()),
        "initial": (initial, ...) if any(item.required for item in state) else (initial, initial()),
        "simulation": (timing, ...),
    }
    return create_model(
        f"{title}Tables",
        __base__=ScenarioTable,
        __doc__=f"A scenario of the body {part.name}, without its law tables.",
        **whole,
    )


def _example(part: Part) -> str:
    """Return a small scenario in TOML with the example parameters of the part, if any; state components default to 0.1."""
    which = f'type = "{part.name}"' if part.file is None else f"file = {json.dumps(str(part.file))}"
    lines = ['name = "written"', f"[{MARKER}]", which]
    examples = part.examples() if part.hook("examples") else []
    for item, value in zip(_params(part), examples[0] if examples else (), strict=False):
        if not (isinstance(value, float) and math.isinf(value)):
            lines.append(f"{item.name} = {json.dumps(item.written(value))}")
    lines.append("[initial]")
    lines += [f"{item.name} = {json.dumps(_within(item.gain))}" for item in _state(part) if item.required]
    return "\n".join([*lines, "[simulation]", "duration = 1.0", "control_period = 0.01\n"])


def _params(part: Part) -> list[contract.Field]:
    return part.fields() if part.hook("Params") else []


def _state(part: Part) -> list[contract.Field]:
    """Return the state's fields that a file gives: all except the command, which is zero at the start."""
    return contract.fields(part.module.State, part.module.COMMAND)


def _within(gain: contract.Parameter) -> Any:
    """Return an allowed value of a parameter: 0.1 for each number, or the nearest value within the bounds."""
    least = [0.1, *(x for x in (gain.at_least, None if gain.above is None else gain.above + 0.1) if x is not None)]
    value = min(max(least), math.inf if gain.at_most is None else gain.at_most)
    return [value] * gain.shape[0] if gain.shape else value
