"""Checks the contents of a scenario file and reports every error in one line."""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Callable, Generator, Iterable, Mapping
from contextlib import contextmanager
from datetime import date, time
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numpy as np
from pydantic import BaseModel, ValidationError
from pydantic_core import PydanticCustomError

from starhold.algebra.quaternion import normalise
from starhold.algebra.vector import scale
from starhold.errors import InputError, closest, is_interrupt
from starhold.laws.catalogue import Law, error_line, from_file
from starhold.loop.kernels import form, make_step
from starhold.scenario.tables import check_name

if TYPE_CHECKING:
    from starhold.parts.part import Part
    from starhold.scenario.bodies.interface import Body

_Model = TypeVar("_Model", bound=BaseModel)
_Part = TypeVar("_Part", bound="Part | Body")
TRIED = 8
"""At how many attitudes a law is tried that is said to treat both quaternions alike."""
RENAMED = {
    "double_cover": "quaternion_sign",
    "slope": "surface_gain",
    "reach": "switching_gain",
    "layer": "boundary_layer",
    "turn": "slew_angle",
    "stored": "wheel_momentum",
    "known": "judged_apart",
    "l2-rest": "l2-equilibrium",
}
"""New names of renamed keys, laws and built-in scenarios; the error for an old name states the new one where it applies."""
MOST_SUBSTEPS = 10**6
"""The most substeps in a control period; an interrupt takes effect only between control periods."""


LONGEST_TEXT, DEEPEST, MOST_DIGITS = 2**22, 16, 60
"""The most characters of a file, nested tables and lists, and digits of a whole number."""
_PART = r"""(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')"""
_LONG_KEY = re.compile(rf"(?<![\w-]){_PART}(?:[ \t]*+\.[ \t]*+{_PART}){{50}}")
"""Matches a dotted key of more than 50 parts: the time to read it grows as the square of its length."""


def read_toml(text: str, where: str) -> dict[str, Any]:
    """Return the tables of a TOML text; `where` names it in errors."""
    if len(text) > LONGEST_TEXT:
        raise InputError(where, "", f"more than {LONGEST_TEXT} characters", "a shorter file")
    if _LONG_KEY.search(text):
        raise InputError(where, "", "a dotted key of more than 50 parts", f"at most {DEEPEST} tables within one another")
    try:
        tables = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(where, "", "", f"not TOML: {cut(str(error), 200)}") from None
    except RecursionError:
        raise InputError(where, "", "tables or lists too deep", f"at most {DEEPEST} within one another") from None
    except ValueError:
        # Python raises this for integers that are too long to convert.
        raise InputError(where, "", "a number of thousands of digits", f"at most {MOST_DIGITS} digits") from None
    _check_sizes(tables, where)
    return _in_words(tables)


def _in_words(value: Any) -> Any:
    """Return the value with TOML dates and times as strings, which only the keys of epochs accept."""
    if isinstance(value, dict):
        return {name: _in_words(item) for name, item in cast(dict[str, Any], value).items()}
    if isinstance(value, list):
        return [_in_words(item) for item in cast(list[Any], value)]
    return value.isoformat() if isinstance(value, date | time) else value


def _check_sizes(tables: dict[str, Any], where: str) -> None:
    """Raise InputError where tables or lists are nested too deeply, or a whole number has too many digits."""
    left: list[tuple[int, str, Any]] = [(0, "", tables)]
    while left:
        depth, key, value = left.pop()
        if depth > DEEPEST:
            raise InputError(where, cut(key), "tables or lists too deep", f"at most {DEEPEST} within one another")
        if isinstance(value, dict):
            named = cast(dict[str, Any], value)
            left += [(depth + 1, f"{key}.{name}" if key else name, item) for name, item in named.items()]
        elif isinstance(value, list):
            left += [(depth + 1, key, item) for item in cast(list[Any], value)]
        elif isinstance(value, int) and abs(value) >= 10**MOST_DIGITS:
            raise InputError(where, key, f"more than {MOST_DIGITS} digits", "a shorter number, such as 1e20")


def numbered(laws: Any, where: str) -> list[tuple[str, Any]]:
    """Return the law tables of a file, each with its key in errors. InputError where there is none."""
    if not isinstance(laws, list) or not laws:
        given = "no law" if laws is None else show(laws)
        raise InputError(where, "law", given, "at least one [[law]] table")
    return [(f"law[{number}]", item) for number, item in enumerate(cast(list[Any], laws), 1)]


def pick_law(data: Any, body: Body, folder: Path, where: str, key: str) -> tuple[dict[str, Any], Law, str | None]:
    """Return the raw table of a law for a body with its type filled in, the law of that type or from the table's `file`
    (relative to `folder`), and the design form or None."""
    if not isinstance(data, dict):
        raise InputError(where, key, show(data), "a [[law]] table")
    table = cast(dict[str, Any], data)
    law = _law_in(table, body, folder, where, key) if "file" in table else _law_of(table, body, where, key)
    table = {name: value for name, value in table.items() if name != "file"} | {"type": law.name}
    form = table.get("form")
    if form is not None and (not isinstance(form, str) or form not in law.forms):
        allowed = nearest(str(form), list(law.forms)) if law.forms else f"no form; {law.name} needs its gains"
        raise InputError(where, f"{key}.form", show(form), allowed)
    for name in table:
        _refuse_other_way(law, form, name, where, f"{key}.{name}")
    return table, law, form


def _refuse_other_way(law: Law, form: str | None, name: str, where: str, key: str) -> None:
    """Raise InputError for a gain given together with a form, and for an input without its form."""
    inputs = {way: {item.name: None for item in law.fields(way)} for way in (None, *law.forms)}
    if name in inputs[form]:
        return
    if form is not None and name in inputs[None]:
        allowed = f"the inputs of the form, {', '.join(inputs[form])}, or the gains without the form"
        raise InputError(where, key, f'a gain beside form = "{form}", which computes the gains', allowed)
    others = [f'"{way}"' for way in law.forms if name in inputs[way]]
    if others:
        given = "an input of a form, and no form" if form is None else f'an input of another form than "{form}"'
        raise InputError(where, key, given, f"form = {' or '.join(others)} in the same table")


def _law_of(table: dict[str, Any], body: Body, where: str, key: str) -> Law:
    name = table.get("type")
    law = body.law(name) if isinstance(name, str) else None
    if law is None:
        known = list(body.laws())
        allowed = nearest(name, known) if isinstance(name, str) else f"{nearest('', known)}; or a file"
        allowed = allowed if known else "a file, because no law for this body is installed"
        raise InputError(where, f"{key}.type", show(name) if name is not None else "nothing", allowed)
    return law


def _law_in(table: dict[str, Any], body: Body, folder: Path, where: str, key: str) -> Law:
    def read(path: Path) -> Law:
        law = from_file(path, body.laws())
        if law.body != body.name:
            raise ValueError(f"a law for the body {law.body}, not for {body.name}")
        return law

    return in_file(table, read, "law", folder, where, key)


def in_file(table: Mapping[str, Any], read: Callable[[Path], _Part], what: str, folder: Path, where: str, key: str) -> _Part:
    """Return the law, body or other part (`what` in errors) that `read` reads from the `file` of a raw table, named `key` in
    errors. InputError where it cannot be read, or its name is taken."""
    given, key = table["file"], f"{key}.file"
    if not isinstance(given, str):
        raise InputError(where, key, show(given), 'the name of a Python file, such as "mine.py"')
    if "type" in table:
        raise InputError(where, key, show(given), "either a type or a file, not both")
    try:
        part = read(folder / given)
        check_name(part.name)
        return part
    except OSError as error:
        raise InputError(where, key, f"{show(given)}: {error.strerror}", f"a Python file that holds a {what}") from None
    except PydanticCustomError as error:
        raise InputError(where, key, show(given), f"a file named with {error.message()}") from None
    except ValueError as error:
        raise InputError(where, key, "", f"{show(given)}: {error}") from None


def make_gains(law: Law, values: list[Any], spec: Any, craft: Any, where: str, key: str) -> Any:
    """Return the gains: the values given, or those that the design form computes from its inputs `spec`."""
    with refusing(law, where, key):
        return law.gains(*values) if spec is None else law.design(craft, spec)


@contextmanager
def refusing(law: Law, where: str, key: str) -> Generator[None]:
    """Turn a law's ValueError into an InputError; for a law from a file, any exception."""
    try:
        yield
    except InputError:
        raise
    except BaseException as error:
        if is_interrupt(error):
            raise
        if law.file is not None and type(error) is not ValueError:
            raise InputError(where, key, "", error_line(error, law.file)) from None
        if not isinstance(error, ValueError):
            raise
        raise InputError(where, key, "", str(error)) from None


def try_law(loop: Any, where: str, key: str) -> None:
    """Call the loop's law once in plain Python, which runs every line. InputError, with the line of its file, where it fails
    or returns values of the wrong form."""
    law = loop.law
    with refusing(law, where, key):
        carry, setup = loop.carry(), loop.setup()
        if law.file is None:
            return
        measurement = make_step(loop.composition()).measure(carry, 0, (0, 0), loop.known, setup)
        given = law.command(measurement, loop.gains, loop.known, carry.memory)
        pair = given if isinstance(given, tuple) and len(cast(Any, given)) == 2 else (None, None)
        if not isinstance(pair[0], tuple) or len(cast(Any, pair[0])) != 3:
            raise ValueError(f"{law.file.name}: {law.equation} must return three numbers and the memory, not {show(given)}")
        if form(pair[1]) != form(carry.memory):
            raise ValueError(f"{law.file.name}: the memory that {law.equation} returns must have the form of its argument")
        if hasattr(measurement, "attitude") and law.card.quaternion_sign == "even":
            _try_signs(loop, measurement, carry.memory)


def _try_signs(loop: Any, measurement: Any, memory: Any) -> None:
    """Raise ValueError where a law gives other torques at q than at -q, though its card says that it treats both alike: what
    is claimed of its flights would be claimed at the other quaternion too."""
    spread = np.random.default_rng(1).normal(size=(TRIED, 7))
    for number, (*turned, x, y, z) in enumerate(spread.tolist()):
        q: Any = normalise(tuple(turned))
        # Rates of all sizes, for a law may clip.
        shown = measurement._replace(rate=scale(10.0 ** -(number % 4), (x, y, z)))
        one, other = (
            np.array(loop.law.command(shown._replace(attitude=p), loop.gains, loop.known, memory)[0])
            for p in (q, tuple(-part for part in q))
        )
        if not np.allclose(one, other, rtol=1e-9, atol=1e-9 * float(np.abs(one).max())):
            raise ValueError(f"{loop.law.file.name}: its torque at q differs from that at -q, but its card says: even")


def refuse_unstable(check: Callable[[], None], where: str, key: str) -> None:
    """Raise InputError if a law's own check finds its gains unstable."""
    try:
        check()
    except ValueError as error:
        raise InputError(where, key, "", f"{error}; --allow-unstable accepts it all the same") from None


def free_name(given: str | None, kind: str, taken: set[str], where: str, key: str) -> str:
    """Return the name of a law, by default its type. InputError where another law of the file has this name."""
    if given is None:
        counted = (kind if n == 1 else f"{kind}-{n}" for n in range(1, len(taken) + 2))
        return next(name for name in counted if name not in taken)
    if given in taken:
        raise InputError(where, f"{key}.name", show(given), "a name that no other law of the file has")
    return given


RESOLVED = 0.5
"""The largest substep as a share of the shortest time constant: above it the classical fourth-order method loses accuracy,
and from 2.8 on it is unstable."""


def check_substeps(loop: Any, where: str) -> None:
    """Raise InputError where the substeps are too long for the fastest part."""
    fastest = loop.fastest
    if fastest is None:
        return
    least = loop.period * fastest.fastest / RESOLVED * (1.0 - 1e-12)
    if loop.substeps < least:
        unit = getattr(loop.body.module, "TIME_UNIT", "s")
        why = f"a time constant of {1.0 / fastest.fastest:.3g} {unit}".rstrip()
        if not least <= MOST_SUBSTEPS:
            allowed = f"a slower one: {least:.3g} substeps a control period are too many"
            raise InputError(where, f"part {fastest.called}", why, allowed)
        allowed = f"at least {math.ceil(least)} substeps, for {fastest.called} has {why}"
        raise InputError(where, "simulation.substeps", str(loop.substeps), allowed)


def validate(
    model: type[_Model], data: Any, where: str, prefix: str, extra: Iterable[str] = (), context: Any = None
) -> _Model:
    """Return a table validated by the model; `extra`: further allowed keys, `context`: the validators' context. InputError
    for the first error."""
    try:
        return model.model_validate(data, context=context)
    except ValidationError as error:
        raise _translate(error, model, data, where, prefix, list(extra)) from None


def _translate(
    error: ValidationError, model: type[BaseModel], data: Any, where: str, prefix: str, extra: list[str]
) -> InputError:
    """Return the first error that pydantic reports as an InputError."""
    # Unknown keys first: a misspelt key is often the reason why a required one is missing.
    fault = min(error.errors(include_url=False), key=lambda e: e["type"] != "extra_forbidden")
    place = [f"[{part + 1}]" if isinstance(part, int) else part for part in fault["loc"]]
    context: dict[str, Any] = fault.get("ctx", {})
    if fault["type"] in ("quantity_at", "told_at"):
        place.append(context["key"])
    key = cut(".".join(part for part in [prefix, *map(_quoted, place[:-1]), *place[-1:]] if part).replace(".[", "["), 200)
    if fault["type"] == "told_at":
        return InputError(where, key, context["found"], context["reason"])
    given = "nothing" if context.get("found", "") is None else show(context.get("found", fault.get("input")))
    if fault["type"] == "extra_forbidden":
        known: list[str] = [*{*_model_at(model, place[:-1]).model_fields, *(extra if len(place) == 1 else [])}]
        given = "an old name" if RENAMED.get(place[-1]) in known else "an unknown key"
        return InputError(where, key, given, nearest(place[-1], known))
    if fault["type"] == "missing":
        return InputError(where, key, "nothing", "this key is required")
    if fault["type"] in ("quantity", "quantity_at"):
        return InputError(where, key, given, str(context["reason"]).removeprefix("must be "))
    return InputError(where, key, given, _plain(fault["msg"]))


def _quoted(part: str) -> str:
    """Return a key, quoted as in TOML where it contains dots or a comma, as keys of [campaign.over] do."""
    return f'"{part}"' if {".", ","} & set(part) else part


def _model_at(model: Any, place: list[str]) -> Any:
    for part in place:
        if part.startswith("["):
            continue
        annotation = model.model_fields[part].annotation
        options = [annotation, *getattr(annotation, "__args__", ())]
        model = next(o for o in options if isinstance(o, type) and issubclass(o, BaseModel))
    return model


def _plain(message: str) -> str:
    text = message.removeprefix("Input should be ").removeprefix("a valid ")
    if text == "dictionary" or text.startswith("dictionary or instance of"):
        return "a table"
    return text.replace("boolean", "true or false")


def show(value: Any) -> str:
    """Return a value as text, short enough for one line."""
    return cut(f'"{value}"' if isinstance(value, str) else str(value))


def cut(text: str, most: int = 60) -> str:
    """Return a text, shortened to `most` characters."""
    return text if len(text) <= most else text[: most - 3] + "..."


def nearest(word: str, known: list[str]) -> str:
    """Return a hint for an unknown word: the new name of a renamed one, else the nearest known word, else all of them."""
    if (new := RENAMED.get(word)) in known:
        return f"{new}, its new name"
    return closest(word, sorted(known))
