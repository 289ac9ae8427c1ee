"""The values of a scenario's keys, and conversion of other values to their units. Keys are written as for `Scenario.with_`.
Values are validated numbers, SI or scaled, like plain numbers in the file."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeAlias, cast

import numpy as np
from numpy.typing import NDArray
from pydantic import create_model
from pydantic_core import PydanticCustomError

from starhold.errors import InputError
from starhold.laws.interface import Gain
from starhold.laws.modes import Modes, mode_laws
from starhold.laws.monitors import Monitor
from starhold.parts.part import Fitted
from starhold.scenario.checking import cut, nearest, show
from starhold.scenario.making import names_of, path_of
from starhold.scenario.modes import CONDITIONS, Condition, ModeTable
from starhold.scenario.parts import part_model
from starhold.scenario.quantity import declared, plain, reader
from starhold.scenario.reading import LawEntry, Scenario
from starhold.scenario.schema import columns, law_model
from starhold.scenario.tables import Table, refuse_own

SHARED = ("name", "description", "requirement", "campaign", "simulation", "certify")
"""Tables and keys that all runs of a campaign share."""
STRUCTURE = ("type", "name", "form", "file")
"""Keys that determine which law or part a table describes."""
PAIRS = {"attitude": "angles", "angles": "attitude"}
"""Alternative keys of a table: setting one removes the other."""


@dataclass(frozen=True)
class Place:
    """A key of a scenario in which runs may differ, with its properties; it can be pickled for other processes."""

    where: str
    """The scenario's name in errors."""
    key: str
    path: tuple[str | int, ...]
    gain: Gain | None
    """The declaration of the quantity; None for a word or a boolean."""
    value: Any
    """A number, tuples of numbers, a word or a boolean; None where the file has none."""
    shape: tuple[int, ...]
    """() for a number, (n,) for a vector or a diagonal, (n, n) for a matrix."""
    worth: float
    """The SI value of the unit of a scaled number; 1 for SI."""
    displaced: str | None
    """The key that is removed when this one is set."""
    table: str
    """The name of its dispersion in [campaign.over]: this key, or several keys separated by commas."""

    @property
    def wordy(self) -> bool:
        """Whether it holds a word or a boolean."""
        return self.gain is None or bool(self.gain.choices)

    @property
    def whole(self) -> bool:
        """Whether its value is a whole number."""
        return self.gain is not None and self.gain.whole

    @property
    def bounds(self) -> Gain:
        """The bounds on each of its numbers; none for the entries of a matrix."""
        gain = self.gain
        if gain is None or gain.shape == (3, 3):
            return Gain()
        return Gain(above=gain.above, at_least=gain.at_least, at_most=gain.at_most)

    def change(self, value: Any) -> dict[str, Any]:
        """Return the argument of `Scenario.with_` that sets the key to this plain value."""
        return {self.key: self._written(value)} | ({} if self.displaced is None else {self.displaced: None})

    def _written(self, value: Any) -> Any:
        """Return the value as written in a file: with its unit where a plain number would be refused as implausible."""
        if isinstance(value, list):
            return [self._written(item) for item in cast(list[Any], value)]
        large = self.gain is not None and isinstance(value, float) and abs(value) > plain(self.gain)[0]
        return f"{value!r} {self.gain.unit}" if self.gain is not None and large else value

    def refuse(self, name: str, given: str, allowed: str) -> InputError:
        """Return an error about the dispersion of the key, or about a parameter of it."""
        key_text = f'campaign.over."{self.table}"'
        return InputError(self.where, f"{key_text}.{name}" if name else key_text, given, allowed)


def accepted(scenario: Scenario, place: Place, value: Any, name: str = "") -> Any:
    """Return the validated value for a raw value of the key's shape. InputError where the scenario refuses it."""
    try:
        return locate(scenario.with_(place.change(value)), place.key).value
    except InputError as error:
        if error.key.rpartition(".")[2] == place.key.rpartition(".")[2]:
            raise place.refuse(name, error.given or show(value), error.allowed) from None
        seen = f"found {error.given}; " if error.given else ""
        raise place.refuse(name, show(value), f"what {error.key or 'the scenario'} takes: {seen}{error.allowed}") from None


def width_at(place: Place, raw: Any, name: str = "", unit: str | None = None) -> NDArray[np.float64]:
    """Return the numbers (of the key's shape) of a raw value that may be outside the key's bounds, such as a standard
    deviation, in `unit` or by default in the key's unit. `name`: its name in errors."""
    gain = place.gain or Gain()
    read: Callable[..., Any] = reader(Gain(gain.unit, also=gain.also) if unit is None else Gain(unit))
    worth = place.worth if unit is None else 1.0

    def number(item: Any) -> float:
        try:
            return read(item, worth)
        except PydanticCustomError as error:
            allowed = error.message().removeprefix("must be ")
            shares = isinstance(item, str) and item.rstrip().endswith(("%", "percent", "ppm")) and unit is None
            shares = shares and not place.wordy and place.table == place.key
            hint = "; for shares of the file's value use relative = true" if shares else ""
            raise place.refuse(name, show(item), f"{allowed}{hint}") from None

    return np.array(_each(_filled(place, raw, place.shape, name), number), dtype=float)


def _each(raw: Any, number: Callable[[Any], float]) -> Any:
    return [_each(item, number) for item in cast(list[Any], raw)] if isinstance(raw, list) else number(raw)


def _filled(place: Place, raw: Any, shape: Sequence[int], name: str) -> Any:
    """Return the raw value as nested lists of this shape; a single number applies to all entries."""
    if not isinstance(raw, list | tuple):
        return raw if not shape else [_filled(place, raw, shape[1:], name) for _ in range(shape[0])]
    items = cast(Sequence[Any], raw)
    if not shape or len(items) != shape[0]:
        whole = place.shape
        allowed = "one value" if not whole else f"a number or {' x '.join(map(str, whole))} numbers"
        raise place.refuse(name, show(raw), allowed)
    return [_filled(place, item, shape[1:], name) for item in items]


def locate(scenario: Scenario, key: str) -> Place:
    """Return the place of a key. InputError where there is no such key, or where runs of a campaign may not differ in it."""
    key_text = f'campaign.over."{cut(key, 200)}"'
    try:
        path = path_of(key, names_of(scenario), scenario.where)
        if path[0] in SHARED:
            raise _no("a key that all runs share", "a key of the craft, its surroundings, laws or parts")
        return _locate(scenario, key, tuple(path))
    except InputError as error:
        raise InputError(scenario.where, key_text, error.given, error.allowed) from None


def _no(given: str, allowed: str) -> InputError:
    """Return an error about an invalid key, to which `locate` adds the key's name."""
    return InputError("", "", given, allowed)


def _locate(scenario: Scenario, key: str, path: tuple[str | int, ...]) -> Place:
    model, value_of, (name, *rest) = _table_of(scenario, path)
    known = [item for item in model.model_fields if item not in STRUCTURE]
    if name in STRUCTURE:
        raise _no("a key that determines the kind of a table", "a key of a number or a word")
    if name not in model.model_fields:
        raise _no("an unknown key", nearest(str(name), known))
    gain, value = declared(model.model_fields[str(name)]), value_of(str(name))
    if isinstance(value, Table | dict) or (gain is None and isinstance(value, list)) or _is_table(model, name):
        raise _no("a whole table", f"keys of it, such as {key}.KEY")
    if gain is not None and gain.columns:
        raise _no("rows of a table", "a key of a number, a vector or a word")
    tables = scenario.raw
    value, shape = _formed(gain, _plainly(gain, value), _raw_at(tables, path))
    if rest:
        value, shape = _component(value, shape, rest), ()
    kind = "" if gain is None else gain.dimension
    worth = getattr(scenario.hooks.context(tables, scenario.where), kind) if kind else 1.0
    other = PAIRS.get(str(name), "")
    displaced = other in model.model_fields and _raw_at(tables, (*path[:-1], other)) is not None
    taken = f"{key.rpartition('.')[0]}.{other}" if displaced else None
    return Place(scenario.where, key, path, gain, value, shape, worth, taken, key)


_Held: TypeAlias = tuple[type[Table], Callable[[str], Any], tuple[str | int, ...]]
"""The model of a table, a function that gives the value of a key in it, and the rest of the path."""


def _table_of(scenario: Scenario, path: tuple[str | int, ...]) -> _Held:
    """Return the table to which a path leads. InputError where there is none, or where the path ends with the table."""
    if path[0] in ("law", "part"):
        return _of_array(scenario, path)
    table: Any = scenario.table
    while len(path) > 0 and isinstance(path[0], str):
        model, name, after = type(table), str(path[0]), path[1:]
        if name not in model.model_fields:
            known = [*model.model_fields, *(("law", "part") if table is scenario.table else ())]
            raise _no("an unknown key", nearest(name, known))
        inner = getattr(table, name)
        if not after or not _is_table(model, name):
            return model, partial(getattr, table), path
        if inner is None:
            raise _no(f"no [{name}] table", f"a scenario with [{name}]")
        if isinstance(inner, list):
            inner, after = _numbered(cast(list[Any], inner), name, after), after[1:]
        table, path = inner, after
    raise _no("a whole table", "one of its keys")


def _numbered(there: Sequence[Any], name: str, after: Sequence[str | int]) -> Any:
    if not isinstance(after[0], int):
        raise _no("an array of tables", f"a key of one of them, such as {name}[1].KEY")
    if not 0 <= after[0] < len(there):
        raise _no("no such table", f"1 to {len(there)}" if there else f"a scenario with [[{name}]]")
    return there[after[0]]


def _is_table(model: type[Any], name: str | int) -> bool:
    """Return whether a key of the model is a table or an array of tables, even if the file has none."""
    left: list[Any] = [model.model_fields[str(name)].annotation]
    while left:
        kind = left.pop()
        if isinstance(kind, type) and issubclass(kind, Table):
            return True
        left += getattr(kind, "__args__", ())
    return False


def _of_array(scenario: Scenario, path: tuple[str | int, ...]) -> _Held:
    """Return the table of a law or a part to which a path leads."""
    array, after, shared = str(path[0]), path[1:], tuple(scenario.table.SHARED)
    if len(after) < 2:
        raise _no("a whole table", f"a key of one, such as {array}.NAME.KEY")
    if array == "part":
        fitted: Fitted = _numbered(scenario.parts, array, after)
        refuse_own({str(after[1]): None}, fitted.part.fields(), shared, "", "")
        return part_model(fitted.part, shared), lambda name: getattr(fitted.params, name, None), after[1:]
    entry: LawEntry = _numbered(scenario.laws, array, after)
    names = [item.name for item in entry.law.fields(entry.form)]
    if after[1] == "mode" and mode_laws(entry.law, entry.gains):
        return _of_mode(entry, dict(zip(names, entry.gains, strict=True)), after[2:], shared)
    if after[1] == "monitor" and isinstance(entry.law.module, Modes):
        return _of_monitor(entry.law.module.monitors, dict(zip(names, entry.gains, strict=True)), after[2:])
    numbers = dict(zip(names, entry.gains if entry.form is None else entry.spec, strict=True))
    model = law_model(entry.law, entry.form, scenario.hooks.law_table, shared)
    return model, lambda name: numbers[name] if name in numbers else getattr(entry.options, name, None), after[1:]


def _of_mode(entry: LawEntry, numbers: dict[str, Any], after: tuple[str | int, ...], shared: tuple[str, ...]) -> _Held:
    """Return the table of a mode, or of one of its conditions, to which a path leads."""
    laws = [law for _, law, _ in mode_laws(entry.law, entry.gains)]
    law, way = _numbered(laws, "mode", after or ("",)), after[1:]
    model, begun = law_model(law, None, ModeTable, shared), f"mode[{int(after[0]) + 1}]."
    if way and way[0] in CONDITIONS:
        model, begun, way = Condition, f"{begun}{way[0]}.", way[1:]
    if not way:
        raise _no("a whole table", "one of its keys")
    return model, lambda name: numbers.get(f"{begun}{name}"), way


def _of_monitor(monitors: Sequence[Monitor], numbers: dict[str, Any], after: tuple[str | int, ...]) -> _Held:
    """Return the table of a monitor to which a path leads."""
    monitor: Monitor = _numbered(monitors, "monitor", after or ("",))
    if len(after) < 2:
        raise _no("a whole table", "one of its keys")
    model = create_model("Monitor", __base__=Table, **columns(monitor.fields()))
    return model, lambda name: numbers.get(f"monitor[{int(after[0]) + 1}].{name}"), after[1:]


def _plainly(gain: Gain | None, value: Any) -> Any:
    """Return numbers as nested tuples, and a choice as its word, not its number."""
    if gain is not None and gain.choices and isinstance(value, int):
        return gain.choices[value]
    return _tuples(value.tolist()) if isinstance(value, np.ndarray) else value


def _tuples(value: Any) -> Any:
    return tuple(_tuples(item) for item in cast(list[Any], value)) if isinstance(value, list) else value


def _formed(gain: Gain | None, value: Any, raw: Any) -> tuple[Any, tuple[int, ...]]:
    """Return the value and its shape; of a matrix, the whole or only the diagonal, as the file gives it."""
    if gain is None or len(gain.shape) < 2:
        return value, () if gain is None else gain.shape
    rows = isinstance(raw, list) and any(isinstance(row, list) for row in cast(list[Any], raw))
    if value is None:
        return None, gain.shape if rows else gain.shape[:1]
    array = np.array(value, dtype=float)
    full = np.diag(array) if array.ndim == 1 else array
    if rows or (raw is None and np.count_nonzero(full - np.diag(np.diagonal(full)))):
        return _tuples(full.tolist()), full.shape
    return tuple(np.diagonal(full).tolist()), full.shape[:1]


def _component(value: Any, shape: tuple[int, ...], rest: Sequence[str | int]) -> Any:
    """Return one component of a vector."""
    if len(shape) != 1 or len(rest) != 1 or not isinstance(rest[0], int):
        raise _no("a value that is not a vector" if len(shape) != 1 else "an index outside the vector", "the whole key")
    if not 0 <= rest[0] < shape[0]:
        raise _no("no such component", f"1 to {shape[0]}")
    return None if value is None else value[rest[0]]


def _raw_at(tables: Any, path: Sequence[str | int]) -> Any:
    """Return the value at a path of raw tables, or None."""
    here: Any = tables
    for part in path:
        try:
            here = here[part]
        except (KeyError, IndexError, TypeError):
            return None
    return here
