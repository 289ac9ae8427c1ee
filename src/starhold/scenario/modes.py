"""Reads laws that consist of modes: a [[law]] of the type "modes" with [[law.mode]] tables."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple, cast

from pydantic import BeforeValidator, Field, WithJsonSchema, create_model, model_validator

from starhold.errors import InputError
from starhold.laws.catalogue import Law
from starhold.laws.conditions import SETTINGS, TESTED, TESTS, TIMES, level_of, needs_sky, settings_of
from starhold.laws.interface import Gain
from starhold.laws.modes import AFTER, DWELL, NAME, WHEELS_LOST, Mode, Modes, Switch, make_law
from starhold.loop.slews import Slew
from starhold.parts.ephemeris import EPHEMERIS
from starhold.parts.epoch import DAY, Date, date_of, days_of, iso_text
from starhold.parts.part import Fitted
from starhold.scenario.bodies.interface import Body
from starhold.scenario.checking import make_gains, nearest, pick_law, refuse_unstable, refusing, show, validate
from starhold.scenario.monitors import MonitorTable, read_monitor
from starhold.scenario.quantity import Annotations, quantity, reader
from starhold.scenario.schema import LawTable, law_model
from starhold.scenario.slews import SlewTable, slew_of
from starhold.scenario.tables import Name, Table, at_key, refuse_own, values_of
from starhold.scenario.units import shown

if TYPE_CHECKING:
    from starhold.scenario.reading import Scenario


class Read(NamedTuple):
    """The contents of a law's table: the law, the design form and its inputs (None where gains are given), and the gains."""

    law: Law
    form: str | None
    table: Any
    spec: Any
    gains: Any
    targets: tuple[Fitted, ...] = ()
    """The targets of a law's modes where these have their own, one each."""
    slews: tuple[Slew | None, ...] = ()
    """The slew by which each target is reached when its mode begins."""


def read_gains(
    data: Any, scenario: Scenario, context: Any, key: str, base: type[LawTable] | None = None, whole: Any = None
) -> Read:
    """Return the law of a raw table, called `key` in errors, for a scenario without laws as yet. base: the model of the keys
    besides gains, by default the body's; whole: the validated table that holds these keys instead, for a mode's table."""
    body, where, craft = scenario.hooks, scenario.where, scenario.craft
    table, law, form = pick_law(data, body, scenario.folder, where, key)
    declared, shared = law.fields(form), scenario.table.shared
    refuse_own(table, declared, shared, where, key)
    extra = ["file", *(["form"] if law.forms else [])]
    validated = validate(law_model(law, form, base or body.law_table, tuple(shared)), table, where, key, extra, context)
    values = list(values_of(declared, validated, shared).values())
    with refusing(law, where, key):
        spec = None if form is None else body.complete(scenario, law, law.forms[form](*values), whole or validated)
    gains = make_gains(law, values, spec, craft, where, key)
    if not scenario.allow_unstable:
        refuse_unstable(lambda: law.check(gains, craft), where, key)
    return Read(law, form, validated, spec, gains)


class Clock(NamedTuple):
    """The epoch of a flight, if any, and its end (s since the start)."""

    epoch: Date | None
    end: float


def _read_time(gain: Gain) -> Annotations:
    """Return the annotations for a time since the start or a date."""
    read = reader(gain)

    def moment(value: Any) -> Any:
        with suppress(ValueError):
            return date_of(value) if isinstance(value, str) else read(value)
        return read(value)

    return BeforeValidator(moment), quantity(gain)[1], gain


class _Condition(Table):
    """A condition: another mode begins when all its tests have held for a time."""

    to: Annotated[str | None, Field(description="the mode that begins; by default the next, of back the previous one")] = (
        None
    )
    after: Annotated[float, *quantity(AFTER)] = 0.0
    dwell: Annotated[float, *quantity(DWELL)] = 0.0

    @model_validator(mode="after")
    def _asks(self) -> _Condition:
        if self.after == 0.0 and not self.tests:
            raise at_key("", f"after, or one of {', '.join(TESTS)}", "no condition")
        for name in TESTED:
            below, above = getattr(self, f"{name}_below"), getattr(self, f"{name}_above")
            if below is not None and above is not None and above >= below:
                raise at_key(f"{name}_above", f"less than {name}_below, {below:g} {shown(TESTED[name].unit)}", above)
        needed = settings_of(self.tests)
        for key, item in SETTINGS.items():
            value = getattr(self, key)
            if key in needed and value is None and item.required:
                raise at_key(key, f"this key, which {' and '.join(_about(key, self.tests))} needs", None)
            if key not in needed and value is not None:
                raise at_key(key, f"this key only with {' or '.join(_about(key, TESTS))}", value)
        axis: Any = getattr(self, "axis", None)
        if axis is not None and not any(axis):
            raise at_key("axis", "a vector that is not zero", list(axis))
        return self

    @property
    def tests(self) -> tuple[str, ...]:
        """The names of the condition's tests."""
        return tuple(test for test in TESTS if getattr(self, test) is not None)

    def levels(self, clock: Clock, where: str, key: str) -> list[Any]:
        """Return the levels of the tests and their other parameters. InputError for a date where the flight has no epoch,
        for times outside the flight, and for not_after before not_before."""
        times = {test: _since(getattr(self, test), clock, where, f"{key}.{test}") for test in TIMES if test in self.tests}
        if len(times) == len(TIMES) and times["not_before"] > times["not_after"]:
            given = f"a time {times['not_before'] - times['not_after']:g} s before not_before"
            raise InputError(where, f"{key}.not_after", given, "a later one, because no time meets both")
        settings = {name: getattr(self, name) for name in settings_of(self.tests)}
        filled = {name: SETTINGS[name].default if value is None else value for name, value in settings.items()}
        return [*(times.get(test, getattr(self, test)) for test in self.tests), *filled.values()]


def _about(key: str, tests: Iterable[str]) -> list[str]:
    """Return those of the tests that need the parameter `key`."""
    return [test for test in tests if key in settings_of([test])]


def _since(given: Any, clock: Clock, where: str, key: str) -> float:
    """Return a time or a date in seconds since the start. InputError where it is outside the flight."""
    time, named = given, f"{given:g} s" if isinstance(given, float) else iso_text(given)
    if not isinstance(given, float):
        if clock.epoch is None:
            raise InputError(where, key, named, "a time since the start; or a date, with epoch in [orbit]")
        time = round((days_of(given) - days_of(clock.epoch)) * DAY, 6)
        if time < 0.0:
            allowed = f"a date from the epoch on, {iso_text(clock.epoch)}"
            raise InputError(where, key, f"{named}, {-time:g} s before the flight begins", allowed)
        named = f"{named}, {time:g} s after the flight begins"
    if time > clock.end and key.endswith("not_before"):
        raise InputError(where, key, named, f"a time within the flight, which ends at {clock.end:g} s")
    return time


_LEVELS: dict[str, Any] = {
    test: (Annotated[Any, *(_read_time if test in TIMES else quantity)(level_of(test))], None) for test in TESTS
}
_LEVELS |= {key: (Annotated[Any, *quantity(item.gain)], None) for key, item in SETTINGS.items()}
if TYPE_CHECKING:
    Condition = _Condition
else:
    Condition = create_model("Condition", __base__=_Condition, __doc__=_Condition.__doc__, **_LEVELS)


CONDITIONS = ("until", "back")
"""The keys of a mode's conditions."""


class ModeTable(LawTable):
    """The keys of every mode's table besides its law's own gains."""

    name: Annotated[Name, Field(description="its name in switches, recordings and certificates")]  # pyright: ignore
    target: Annotated[
        Any,
        WithJsonSchema({"type": "object"}),
        Field(description="table as of [target] or of a target's [[part]]; [target] if absent"),
    ] = None
    slew: Annotated[SlewTable | None, Field(description="slew to the target when the mode begins; none if absent")] = None
    effectors: Annotated[
        tuple[str, ...] | None,
        Field(description="effectors active in this mode, of those with commands or external torques; all if absent"),
    ] = None
    until: Annotated[Condition | None, Field(description="when the next mode begins")] = None
    back: Annotated[Condition | None, Field(description="when the previous mode begins again")] = None


@cache
def modes_model(base: type[LawTable]) -> type[LawTable]:
    """Return the model of the table of a law of modes, without its modes; base: the model of the body's law tables."""
    entries: dict[str, Any] = {
        "type": (Literal[NAME], NAME),
        "on_loss": (Annotated[str | None, Field(description="the mode that begins when a loss is detected")], None),
        "wheels_lost": (Annotated[float | None, *quantity(replace(WHEELS_LOST, whole=True))], None),
        "monitor": (Annotated[list[MonitorTable], Field(description="monitors whose trip also counts as a loss")], []),
    }
    return create_model("Modes", __base__=base, __doc__="A law for each mode.", **entries)


def has_modes(data: Any, body: Body) -> bool:
    """Return whether a raw table is that of a law of modes."""
    return isinstance(data, dict) and cast(Any, data).get("type") == NAME and body.modes


def read_modes(data: Any, scenario: Scenario, context: Any, key: str) -> Read:
    """Return the law of a raw table with [[law.mode]] tables, called `key` in errors. InputError for the first mode that is
    wrong or cannot be reached."""
    where = scenario.where
    rest = {name: value for name, value in data.items() if name != "mode"}
    table: Any = validate(modes_model(scenario.hooks.law_table), rest, where, key, ["mode"], context)
    given = data.get("mode")
    if not isinstance(given, list) or len(cast(list[Any], given)) < 2:
        described = "nothing" if given is None else "one mode" if isinstance(given, list) and given else show(given)
        raise InputError(where, f"{key}.mode", described, "at least two [[law.mode]] tables")
    reads: list[Read] = []
    for number, one in enumerate(cast(list[Any], given), 1):
        place = f"{key}.mode[{number}]"
        if not isinstance(one, dict):
            raise InputError(where, place, show(one), "a [[law.mode]] table")
        reads.append(read_gains(one, scenario, context, place, ModeTable, whole=table))
    tables = [read.table for read in reads]
    on_loss = _mode_on_loss(table, [one.name for one in tables], where, key)
    epoch = scenario.orbit and scenario.orbit.epoch
    clock = Clock(epoch, scenario.table.simulation.duration)
    modes, gains = _joined(tables, reads, on_loss, clock, where, key)
    monitors = tuple(
        read_monitor(one, [each.name for each in tables], scenario, where, f"{key}.monitor[{place}]")
        for place, one in enumerate(table.monitor, 1)
    )
    watching = tuple(monitor for monitor, _ in monitors)
    law = make_law(Modes(tuple(modes), on_loss, watching, scenario.table.shared.get(EPHEMERIS.shared, 0)))
    if needs_sky(law.module.tests):
        if epoch is None:
            raise InputError(where, "orbit.epoch", "nothing", f"a date, which conditions of {key} need")
        gains.append(epoch)
    gains += [] if on_loss is None else [float(table.wheels_lost or 1.0)]
    gains += [number for _, numbers in monitors for number in numbers]
    slews = tuple(slew_of(one.slew, scenario, f"{key}.mode[{place}].slew") for place, one in enumerate(tables, 1))
    return Read(law, None, table, None, law.gains(*gains), _targets(reads, slews, scenario, context, key), slews)


def _mode_on_loss(table: Any, names: list[str], where: str, key: str) -> int | None:
    """Return the index of the mode that begins on a loss; None if there is none."""
    if table.on_loss is None:
        unused = next((name for name in ("wheels_lost", "monitor") if getattr(table, name)), None)
        if unused is not None:
            raise InputError(where, f"{key}.on_loss", "nothing", f"the name of the mode that {unused} leads to")
        return None
    if table.on_loss not in names:
        raise InputError(where, f"{key}.on_loss", show(table.on_loss), nearest(table.on_loss, names))
    return names.index(table.on_loss)


def _targets(
    reads: Sequence[Read], slews: Sequence[Slew | None], scenario: Scenario, context: Any, key: str
) -> tuple[Fitted, ...]:
    """Return the target of each mode; an empty tuple where no mode has a target or a slew."""
    given: list[Any] = [read.table.target for read in reads]
    if all(one is None for one in (*given, *slews)):
        return ()
    keys = [f"{key}.mode[{place}].target" for place in range(1, len(given) + 1)]
    return tuple(scenario.hooks.target(scenario, one, context, at) for one, at in zip(given, keys, strict=True))


def _joined(
    tables: Sequence[Any], reads: Sequence[Read], on_loss: int | None, clock: Clock, where: str, key: str
) -> tuple[list[Mode], list[Any]]:
    """Return the modes with their switches, and the numbers of all of them."""
    names: list[str] = [table.name for table in tables]
    modes, gains = list[Mode](), list[Any]()
    last = max(place for place in range(len(names)) if place != on_loss)
    for place, (table, read) in enumerate(zip(tables, reads, strict=True)):
        here = f"{key}.mode[{place + 1}]"
        if names.index(table.name) < place:
            raise InputError(where, f"{here}.name", show(table.name), "a name that no other mode of the law has")
        if table.until is None and place not in (last, on_loss):
            raise InputError(where, f"{here}.until", "nothing", "a condition, because only the last mode may fly to the end")
        gains += read.gains
        switches: list[Switch] = []
        for way, beside in zip(CONDITIONS, (place + 1, place - 1), strict=True):
            condition = getattr(table, way)
            if condition is None:
                continue
            to = _to(condition.to, names, place, beside, where, f"{here}.{way}")
            switches.append(Switch(way, to, condition.tests))
            gains += [condition.after, condition.dwell, *condition.levels(clock, where, f"{here}.{way}")]
        modes.append(Mode(table.name, read.law, tuple(switches), table.effectors))
    reached, ahead = {0}, {0} if on_loss is None else {0, on_loss}
    while ahead:
        reached |= ahead
        ahead = {switch.to for place in reached for switch in modes[place].switches} - reached
    unreached = next((place for place in range(len(names)) if place not in reached), None)
    if unreached is not None:
        allowed = "a mode that a condition of another one leads to"
        raise InputError(where, f"{key}.mode[{unreached + 1}]", show(names[unreached]), allowed)
    return modes, gains


def _to(given: str | None, names: list[str], place: int, beside: int, where: str, key: str) -> int:
    """Return the index of the mode that begins on a condition."""
    if given is None:
        if not 0 <= beside < len(names):
            raise InputError(
                where, f"{key}.to", "nothing", f"the name of a mode, because none is {'after' if beside else 'before'} it"
            )
        return beside
    others = [name for name in names if name != names[place]]
    if given not in others:
        raise InputError(where, f"{key}.to", show(given), nearest(given, others))
    return names.index(given)
