"""Quantities in scenario files: plain numbers are SI, strings carry units."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any, Literal, TypeAlias, cast

import numpy as np
from pydantic import BeforeValidator, ValidationInfo, WithJsonSchema
from pydantic.fields import FieldInfo

from starhold.laws.interface import Gain
from starhold.scenario.tables import refuse
from starhold.scenario.units import shown, to_either, to_number

LEAST, MOST = 1e-30, 1e30
"""The smallest and the largest magnitude of nonzero quantities in files; of a vector or matrix, of its largest entry."""
PLAIN = {
    "rad": (math.tau, "deg"),
    "rad/s": (math.tau, "deg/s"),
    "T": (1e-3, "nT"),
    "T/sqrt(Hz)": (1e-6, "nT/sqrt(Hz)"),
    "A m^2": (5e3, "mA m^2"),
    "rad/s^2": (1.0, "deg/s^2"),
    "N m/s": (1e3, "mN m/s"),
    "kg": (1e6, "g"),
    "kg m": (1e-2, "g mm"),
    "W": (1e4, "mW"),
}
"""For each unit the largest plain number accepted, and the unit probably meant by a larger number."""
MOST_WHOLE = 2**53
"""Floats represent every whole number up to this size exactly."""


Annotations: TypeAlias = tuple[BeforeValidator, WithJsonSchema, Gain]
"""The validator of a quantity, its JSON schema, and its declaration, which pydantic keeps with the field."""


def quantity(gain: Gain) -> Annotations:
    """Return the annotations by which pydantic reads a quantity: `Annotated[Any, *quantity(Gain("N m", above=0.0))]`."""
    return BeforeValidator(reader(gain)), WithJsonSchema(_schema(gain)), gain


def declared(field: FieldInfo) -> Gain | None:
    """Return the declaration of a table's key that is a quantity; None for other keys."""
    return next((item for item in field.metadata if isinstance(item, Gain)), None)


def meaning(field: FieldInfo) -> str:
    """Return the description of a table's key, with its unit; "" where it has none. It is that of the JSON Schema, which
    takes longer to make."""
    schemas = (item.json_schema or {} for item in field.metadata if isinstance(item, WithJsonSchema))
    return field.description or next((schema.get("description", "") for schema in schemas), "")


def quantity_or(word: str, meaning: float, gain: Gain) -> Annotations:
    """Return the annotations for a quantity, or for a word that stands for a value of it."""
    read, schema = reader(gain), _schema(gain)
    described = {"anyOf": [{"const": word}, *schema["anyOf"]], "description": schema["description"]}
    return BeforeValidator(lambda value: meaning if value == word else read(value)), WithJsonSchema(described), gain


RAW = 'a number, a string with a unit such as "0.1 N m", or a list of them'
_SINGLE = [{"type": "number"}, {"type": "string"}]
_ROW = {"type": "array", "items": {"anyOf": _SINGLE}}


def raw(text: str) -> tuple[BeforeValidator, WithJsonSchema]:
    """Return the annotations for numbers in the unit of another key: `Annotated[Any, *raw("the least value")]`."""
    schema = {"anyOf": [*_SINGLE, _ROW, {"type": "array", "items": _ROW}], "description": text}
    return BeforeValidator(_raw), WithJsonSchema(schema)


def _raw(value: Any) -> Any:
    """Return the value unchanged. An error unless it is a number, a text, or a list of them."""
    if isinstance(value, list | tuple):
        return [_raw(item) for item in cast(list[Any], value)]
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise refuse(RAW)
    if not isinstance(value, str) and not math.isfinite(value):
        raise refuse("finite numbers")
    return value


SCALED = {"length": "m", "velocity": "m/s", "acceleration": "m/s^2", "time": "s", "rate": "rad/s"}
"""Kinds of scaled numbers with their SI units."""


def any_quantity(gain: Gain) -> Annotations:
    """Return the annotations for a quantity, scaled where the declaration has a dimension."""
    return scaled(gain.dimension, replace(gain, unit=SCALED[gain.dimension])) if gain.dimension else quantity(gain)


def scaled(kind: Literal["length", "velocity", "acceleration", "time", "rate"], gain: Gain) -> Annotations:
    """Return the annotations for scaled numbers. Plain numbers are scaled already; strings with a unit are converted by the
    SI value of the scaled unit, which the validation's context holds under its kind. Bounds apply to scaled numbers."""
    read, schema = reader(gain), _schema(gain)
    schema["description"] = f"{gain.text} (scaled, or with a unit such as {gain.unit})"

    def to_scaled(value: Any, info: ValidationInfo) -> Any:
        return read(value, getattr(info.context, kind))

    return BeforeValidator(to_scaled), WithJsonSchema(schema), replace(gain, dimension=kind)


def reader(gain: Gain) -> Callable[..., Any]:
    """Return a function that converts a value in a file to numbers of the declared shape within the declared bounds; its
    second argument is the SI value of the result's unit, 1 for SI."""

    def read(value: Any, worth: float = 1.0) -> Any:
        try:
            if gain.choices:
                return gain.check(value)
            checked = gain.check(_to_numbers(value, gain, worth))
            _check_size(checked)
            return checked
        except (ValueError, OverflowError) as error:
            raise refuse(" ".join(str(error).split())) from None

    return read


def _to_numbers(value: Any, gain: Gain, worth: float) -> Any:
    # Values are tuples where they are defaults.
    if isinstance(value, (list, tuple)):
        items, units = cast(list[Any], value), gain.unit.split(", ")
        if 1 < len(units) == len(gain.columns) and not any(isinstance(item, (list, tuple)) for item in items):
            # A row of a table whose columns have different units.
            if len(items) not in (0, len(units)):
                raise ValueError(gain.describe())
            return [_to_numbers(item, replace(gain, unit=unit), worth) for item, unit in zip(items, units, strict=False)]
        return [_to_numbers(item, gain, worth) for item in items]
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        raise ValueError(f"{gain.describe()} in {shown(gain.unit)}")
    if isinstance(value, str):
        return (to_either(value, gain.unit, gain.also) if gain.also else to_number(value, gain.unit)) / worth
    if gain.whole and abs(value) > MOST_WHOLE:
        raise ValueError("at most 2^53")
    most, unit = plain(gain)
    if most < abs(value) <= MOST:
        within = "2 pi" if most == math.tau else f"{most:g}"
        raise ValueError(ask_for_unit(value, gain.unit, f"within {within}", unit))
    return value


def plain(gain: Gain) -> tuple[float, str]:
    """Return the largest plain number accepted, and the unit probably meant by a larger number."""
    return gain.plain or PLAIN.get(gain.unit, (math.inf, ""))


def ask_for_unit(value: float, unit: str, within: str, other: str) -> str:
    """Return the text of an error that asks for the unit of an implausible plain number; other: the unit probably meant."""
    meant = f'with a unit it is "{value:g} {other}"'
    if unit == "1":
        return f"a plain number is a share, {within}; {meant}"
    return f'a plain number is in {unit}, {within}; {meant} or "{value:g} {unit}"'


def _check_size(value: Any) -> None:
    """Raise ValueError for numbers whose powers would overflow or underflow; no real craft has such."""
    size = float(np.max(np.abs(np.asarray(value, dtype=float))))
    if math.isfinite(size) and size and not LEAST <= size <= MOST:
        raise ValueError(f"0, or between {LEAST:g} and {MOST:g} in size")


def _schema(gain: Gain) -> dict[str, Any]:
    described = {"description": f"{gain.text or 'quantity'} ({shown(gain.units)})"}
    if gain.choices:
        return {"enum": list(gain.choices)} | described
    number: dict[str, Any] = {"type": "integer" if gain.whole else "number"}
    bounds = {"exclusiveMinimum": gain.above, "minimum": gain.at_least, "maximum": gain.at_most}
    number |= {key: bound for key, bound in bounds.items() if bound is not None}
    single: list[dict[str, Any]] = [number, {"type": "string"}]
    if gain.columns:
        width = len(gain.columns)
        row = {"type": "array", "items": {"anyOf": single}, "minItems": width, "maxItems": width}
        return {"anyOf": [{"type": "string"}, {"type": "array", "items": row}]} | described
    if not gain.shape:
        return {"anyOf": single} | described
    row = {"type": "array", "items": {"anyOf": single}, "minItems": gain.shape[-1], "maxItems": gain.shape[-1]}
    forms = [*single, row] if gain.spread else [row]
    if len(gain.shape) == 2:
        forms.append({"type": "array", "items": row, "minItems": gain.shape[0], "maxItems": gain.shape[0]})
    return {"anyOf": forms} | described
