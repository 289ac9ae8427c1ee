"""Reads the [[part]] tables of a scenario, for parts of any role, installed or from a file."""

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal, cast

from pydantic import Field, create_model

from starhold.algebra.quantity import quantities
from starhold.algebra.structured import Buffer
from starhold.algebra.vector import ZERO
from starhold.errors import InputError, input_at, is_interrupt
from starhold.laws.catalogue import Law
from starhold.laws.modes import Modes
from starhold.loop.closed_loop import ClosedLoop, before_first, can_be_inactive, is_recorded
from starhold.loop.step import make_equations
from starhold.parts.catalogue import PACKAGES, as_part, error_line, from_file, parts, read_module, role_of
from starhold.parts.contract import FIX, GIVEN, IS_VALID
from starhold.parts.orbit import body_of
from starhold.parts.part import Fitted, Part
from starhold.parts.roles import Goal
from starhold.scenario.assumed import with_assumed
from starhold.scenario.checking import free_name, in_file, nearest, show, try_law, validate
from starhold.scenario.csv_files import csv_lines, number_in
from starhold.scenario.schema import columns
from starhold.scenario.sensing import check_sensors
from starhold.scenario.starting import check_starts
from starhold.scenario.tables import Name, Table, own_fields, refuse_own, values_of

ROLES = tuple(role for role in PACKAGES if role != "body")
"""The roles of parts in [[part]] tables; laws and bodies have their own tables."""
SINGLE = {"estimator": "one estimator for the law; others with watches = true", "target": "one target"}
"""The roles that only one part of a loop may have, with the text of the error."""


class PartTable(Table):
    """The keys of a part's table besides the part's own parameters."""

    type: str
    name: Annotated[Name | None, Field(description="its name in recordings and errors; the type if absent")] = None


class EstimatorTable(PartTable):
    """The keys of an estimator's table besides its own parameters."""

    watches: Annotated[bool, Field(description="whether it is only recorded and compared, while the law uses another")] = (
        False
    )
    started_by: Annotated[
        Name | None, Field(description="estimator whose first valid attitude initializes it; none if absent")
    ] = None


def installed() -> dict[str, Part]:
    """Return the parts that [[part]] tables may name, by name."""
    return {name: part for role in ROLES for name, part in parts(role).items() if not part.table}


@cache
def part_model(part: Part, shared: tuple[str, ...]) -> type[Any]:
    """Return the model of a part's table; shared: scenario keys that set some of its parameters instead."""
    entries: dict[str, Any] = {"type": (Literal[part.name], part.name), **columns(own_fields(part.fields(), shared))}
    title = part.name.replace("-", " ").title().replace(" ", "")
    base = EstimatorTable if part.role == "estimator" else PartTable
    return create_model(title, __base__=base, __doc__=part.card.summary, **entries)


def read_parts(
    tables: Any, body: str, folder: Path, where: str, shared: Mapping[str, Any], units: Any = None
) -> tuple[Fitted, ...]:
    """Return the parts of a file's [[part]] tables for a body. folder: base of relative file names; shared: values that
    apply to all parts; units: those of a body with scaled numbers. InputError for the first invalid table. `check_fit`
    later checks all parts together."""
    if tables is None:
        return ()
    if not isinstance(tables, list):
        raise InputError(where, "part", show(tables), "[[part]] tables, with double brackets")
    collected: list[Fitted] = []
    for number, data in enumerate(cast(list[Any], tables), 1):
        key = f"part[{number}]"
        if not isinstance(data, dict):
            raise InputError(where, key, show(data), "a [[part]] table")
        read = read_part(cast(dict[str, Any], data), body, folder, where, key, shared, units)
        taken = {fitted.name for fitted in collected}
        collected.append(replace(read, name=free_name(read.name or None, read.part.name, taken, where, key)))
    return with_assumed(collected, tables)


def read_part(
    table: dict[str, Any], body: str, folder: Path, where: str, key: str, shared: Mapping[str, Any], units: Any = None
) -> Fitted:
    """Return the part that a raw table, named `key` in errors, describes."""
    part = in_file(table, _read, "part", folder, where, key) if "file" in table else _of_type(table, where, key)
    if part.body not in ("", body):
        raise InputError(where, key, f"{part.name}, for the body {part.body}", f"a part for {body}")
    table = {name: value for name, value in table.items() if name != "file"} | {"type": part.name}
    table = with_rows(part, table, folder, where, key)
    refuse_own(table, part.fields(), shared, where, key)
    read = validate(part_model(part, tuple(shared)), table, where, key, ["file"], units)
    fitted = Fitted(part, params_of(part, read, shared), read.name or "")
    return replace(fitted, watches=read.watches, started_by=read.started_by or "") if part.role == "estimator" else fitted


def params_of(part: Part, read: Any, shared: Mapping[str, Any]) -> Any:
    """Return the parameters of a part from its validated table and from the values shared by all parts."""
    values = values_of(part.fields(), read, shared)
    return part.params(**{name: value for name, value in values.items() if value is not None})


def _of_type(table: dict[str, Any], where: str, key: str) -> Part:
    known, name = installed(), table.get("type")
    if isinstance(name, str) and name in known:
        return known[name]
    given = next((part for role in PACKAGES for part in parts(role).values() if part.name == name and part.table), None)
    if given is not None:
        raise InputError(where, f"{key}.type", show(name), f"the [{given.table}] table, which gives it")
    described = "nothing" if name is None else show(name)
    raise InputError(where, f"{key}.type", described, f"{nearest(str(name), list(known))}; or a file")


def _read(path: Path) -> Part:
    role = role_of(read_module(path))
    if role not in ROLES:
        raise ValueError(f"its role must be one of {', '.join(ROLES)}, not {role}" if role else "it declares no ROLE")
    return from_file(path, parts(role), as_part)


def with_rows(part: Part, table: dict[str, Any], folder: Path, where: str, key: str) -> dict[str, Any]:
    """Return the table with the names of CSV files replaced by the rows in them."""
    filled = dict(table)
    for item in part.fields():
        given = table.get(item.name)
        if item.gain.columns and isinstance(given, str):
            allowed = f"a CSV file of {', '.join(item.gain.columns)}, a line of names first or none"
            try:
                lines = [cells for _, cells in csv_lines(folder / given)]
                if lines and number_in(lines[0][0]) is None:
                    lines = lines[1:]
                if any(len(line) != len(item.gain.columns) for line in lines):
                    raise ValueError(f"a line without {len(item.gain.columns)} columns")
                filled[item.name] = [[float(cell) for cell in line] for line in lines]
            except OSError as error:
                raise InputError(where, f"{key}.{item.name}", f"{given}: {error.strerror}", allowed) from None
            except ValueError as error:
                raise InputError(where, f"{key}.{item.name}", f"{given}: {error}", allowed) from None
    return filled


def check_fit(loop: ClosedLoop, where: str) -> None:
    """Raise InputError where the parts of a loop are incompatible."""
    loop = _with_watched(loop, where)
    fitted = loop.parts
    for role, most in SINGLE.items():
        used = loop.used(role)
        if len(used) > 1:
            raise InputError(where, _key(used[1]), f"a second {role}, beside {used[0].called}", most)
    check_starts(loop, where)
    _check_effectors(loop, where)
    readings = check_sensors(loop, where)
    there = {f.part.name for f in fitted}
    for one in fitted:
        estimates = one.part.role == "estimator"
        present = readings | ({FIX} if one.started_by else set()) if estimates else there
        for need in one.needs:
            if need not in present:
                allowed = _measuring(need) if estimates else f"the part {need}"
                raise InputError(where, _key(one), f"no {need}, which {one.called} needs", allowed)
        about = one.about
        if about and body_of(loop.craft.gravity) != about:
            given = f"an orbit about {body_of(loop.craft.gravity) or 'an unknown body'}"
            raise InputError(where, _key(one), given, f"an orbit about {about}, the body of its model")
    for one, key in (*((f.part, _key(f)) for f in fitted), (loop.law, f"law {loop.law.name}")):
        for need in one.reads:
            if need not in {*readings, *GIVEN}:
                raise InputError(where, key, f"no {need}, which {one.name} needs", _measuring(need))
    _check_estimates(loop, where)
    late = next((f for f in loop.used("actuator") if f.part.hook("rates") is not None), None)
    switched = next((f for f in _acting(loop) if f.part.hook("switch") is not None), None)
    if late is not None and switched is not None:
        allowed = f"none before {switched.called}, which reads the command only at control instants"
        raise InputError(where, _key(late), "an actuator whose output moves between control instants", allowed)
    acting = loop.used("effector")
    if acting and "rate" not in loop.body.module.State._fields:
        raise InputError(where, _key(acting[0]), f"an effector on the body {loop.body.name}", "a body that turns")


def _check_estimates(loop: ClosedLoop, where: str) -> None:
    """Raise InputError where a law needs a quantity that no estimator gives, or an orbit about another body."""
    there = [name for fitted in loop.used("estimator") for name in fitted.part.module.Estimate._fields]
    says = [IS_VALID] if loop.used("estimator") and IS_VALID in loop.law.reads else []
    for name in (*getattr(loop.law.module, "ESTIMATES", ()), *says):
        if name not in there:
            giving = [one for one, part in parts("estimator").items() if name in part.module.Estimate._fields]
            allowed = f"an estimator that gives {name}, such as {' or '.join(giving)}"
            raise InputError(where, f"law {loop.law.name}", f"no {name}, which it needs", allowed)
    about = loop.law.about
    if about and (not loop.has("two-body") or body_of(loop.craft.gravity) != about):
        given = f"no orbit about {about}, which conditions on the Sun or a station need"
        raise InputError(where, f"law {loop.law.name}", given, f"an [orbit] about {about}")


def _measuring(reading: str) -> str:
    """Return the text for a sensor that gives a reading, with installed examples."""
    if reading == FIX:
        return "started_by, the estimator whose first valid attitude it begins with"
    known = [name for name, part in parts("sensor").items() if reading in part.module.Reading._fields and not part.table]
    return f"a sensor that measures {reading}{', such as ' * bool(known)}{' or '.join(known)}"


def _acting(loop: ClosedLoop) -> list[Fitted]:
    """Return the effectors that take the command in any mode."""
    return [f for f in loop.used("effector") if f.part.flag("ACTS")]


def _check_effectors(loop: ClosedLoop, where: str) -> None:
    """Raise InputError where two effectors would take the command at once, or a mode has none for it."""
    acting, known = _acting(loop), [f.part.name for f in loop.used("effector") if can_be_inactive(f.part)]
    module: Any = loop.law.module
    if not isinstance(module, Modes):
        if len(acting) > 1:
            given = f"a second effector for the command, beside {acting[0].called}"
            raise InputError(where, _key(acting[1]), given, 'one, or a law of type "modes" whose modes name theirs')
        _check_outside(loop.law, acting, where, f"law {loop.law.name}")
        return
    for mode in module.modes:
        key = f"law {loop.law.name}, mode {mode.name}: effectors"
        for name in mode.effectors or ():
            if name not in known:
                raise InputError(where, key, show(name), nearest(name, known) if known else "no effector can be named")
        working = [f.called for f in acting if mode.has(f.part.name)]
        if len(working) > 1:
            raise InputError(where, key, f"{' and '.join(working)}, which both take the command", "one of them")
        if acting and not working:
            raise InputError(where, key, "none that takes the command", f"one of {', '.join(f.part.name for f in acting)}")
        _check_outside(
            mode.law, [f for f in acting if mode.has(f.part.name)], where, f"law {loop.law.name}, mode {mode.name}"
        )


def _check_outside(law: Law, acting: list[Fitted], where: str, key: str) -> None:
    """Raise InputError where a law needs an external torque but the effectors can only exchange momentum."""
    if law.flag("FROM_OUTSIDE") and acting and not acting[0].part.flag("OUTSIDE"):
        given = f"{law.name} with {acting[0].called}, which store the momentum that it should remove"
        raise InputError(where, key, given, "magnetorquers, another effector with an external torque, or none")


def _key(fitted: Fitted) -> str:
    return f"part {fitted.called}"


def try_parts(loop: ClosedLoop, where: str, key: str) -> None:
    """Fly a control step in plain Python, which runs every line. InputError where a part cannot work with its parameters or
    the file of a part fails; `key`: the law's name in errors."""
    crafts = (loop.craft, *(event.craft for event in loop.events))
    for fitted in loop.parts:
        own_file = fitted.part.file is not None
        one = _watched(fitted, loop, where) if own_file else fitted
        with input_at(where, _key(fitted)):
            if own_file and (fitted.part.role == "estimator" or (fitted.part.role == "sensor" and is_recorded(fitted.part))):
                before_first(fitted.part, loop.start)
            params, check = one.prepared(loop.period), one.part.hook("check")
            if check is not None:
                for craft in crafts:
                    check(params, craft)
            begin = one.part.hook("check_start")
            if begin is not None:
                begin(params, loop.start, loop.craft)
    if all(fitted.part.file is None for fitted in loop.parts):
        return
    tried = _with_watched(loop, where)
    try:
        # The step is not cached, because it is flown once.
        step, carry, setup = make_equations(tried.composition()), tried.carry(), tried.setup()
        for number in range(2):
            carry = step.update(carry, number, (loop.seed, 0), loop.gains, loop.known, setup)
            carry = step.propagate(carry, loop.craft, setup)
            step.sample(carry, number + 1, setup)
    except InputError:
        raise
    except BaseException as error:
        if is_interrupt(error):
            raise
        # Either the law's own file is at fault, or a part's result does not fit where it is used.
        try_law(loop, where, key)
        guilty = next(f for f in loop.parts if f.part.file is not None)
        allowed = "its equations must return states of the form of their arguments"
        raise InputError(where, _key(guilty), "", allowed) from None


def _with_watched(loop: ClosedLoop, where: str) -> ClosedLoop:
    return replace(loop, parts=tuple(f if f.part.file is None else _watched(f, loop, where) for f in loop.parts))


def _watched(fitted: Fitted, loop: ClosedLoop, where: str) -> Fitted:
    """Return a part from a file, with its equations wrapped so that their results are checked at every call."""
    module: Any = _Watched(fitted, loop.start, where)
    return replace(fitted, part=replace(fitted.part, module=module))


class _Watched:
    """The module of a part from a file; its equations raise InputError where they fail or violate their role's contract."""

    def __init__(self, fitted: Fitted, state: Any, where: str) -> None:
        self._fitted, self._state, self._where = fitted, state, where

    def __getattr__(self, name: str) -> Any:
        attribute = getattr(self._fitted.part.module, name)
        return attribute if isinstance(attribute, type) or not callable(attribute) else self._called(name, attribute)

    def _called(self, name: str, equation: Any) -> Any:
        def called(*given: Any) -> Any:
            part = self._fitted.part
            try:
                result = equation(*given)
            except BaseException as error:
                if is_interrupt(error):
                    raise
                raise InputError(self._where, _key(self._fitted), "", error_line(error, part.file)) from None
            what = self._wrong(part, name, result, given)
            if what:
                raise InputError(self._where, _key(self._fitted), f"{name} returns {show(result)}", what)
            return result

        return called

    def _wrong(self, part: Part, name: str, result: Any, given: Any) -> str:
        """Return a description of the result that an equation should have returned; "" where the result is right."""
        if name in VECTORS.get(part.role, ()):
            return "" if _alike(result, ZERO) or (result is None and name in MOVING) else "three numbers"
        if (part.role, name) == ("effector", "inertia"):
            return "" if _alike(result, (ZERO, ZERO, ZERO)) else "three rows of three numbers"
        if (part.role, name) == ("target", "goal"):
            like = Goal((1.0, 0.0, 0.0, 0.0), ZERO, ZERO)
            return "" if isinstance(result, Goal) and _alike(result, like) else "a Goal of four, three and three numbers"
        if (part.role, name) in (("effector", "rates"), ("effector", "switch"), ("environment", "update")):
            return "" if _alike(result, given[0], name == "rates") else "numbers in the form of the first argument"
        if name == "record":
            return _undeclared(type(result))
        if name not in ("measure", "estimate"):
            return ""
        kind = part.module.Reading if name == "measure" else part.module.Estimate
        if not (isinstance(result, tuple) and len(cast(Any, result)) == 2 and isinstance(result[0], kind)):
            return f"a pair of a {kind.__name__} and the memory"
        if not _alike(result[1], given[1]):
            return "a memory in the form of the one passed in"
        for item, value in cast(Any, result[0])._asdict().items():
            if item in self._state._fields and not _alike(value, getattr(self._state, item)):
                return f"{item} in the form of the body's state"
        return _undeclared(kind) if name == "estimate" or is_recorded(part) else ""


VECTORS = {
    "environment": ("torque", "acceleration"),
    "effector": ("reaction", "push", "momentum", "applied"),
    "actuator": ("command", "rates"),
}
"""The equations of each role that return three numbers."""
MOVING = ("acceleration", "push")
"""Those of them that may return None, where the part exerts no force."""


def _undeclared(kind: Any) -> str:
    """Return what a type must have to be recorded; "" where it does."""
    try:
        quantities(kind)
    except Exception:
        return "a NamedTuple whose fields are annotated with a Quantity"
    return ""


def _alike(one: Any, other: Any, still: bool = False) -> bool:
    """Return whether two values have the same structure; still: whether None in the first one is allowed too."""
    if still and one is None:
        return True
    if isinstance(one, tuple):
        same = isinstance(other, tuple) and len(cast(Any, one)) == len(cast(Any, other))
        return same and all(_alike(a, b, still) for a, b in zip(cast(Any, one), cast(Any, other), strict=True))
    return not isinstance(other, tuple) and isinstance(one, (int, float, Buffer)) and not isinstance(one, bool)
