"""Quantities in scenario files: plain numbers are SI, strings carry units."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import cache
from typing import Any, Literal, cast

from pydantic import BeforeValidator, ValidationInfo, WithJsonSchema
from pydantic_core import PydanticCustomError

from starhold.laws.interface import Gain


def quantity(gain: Gain) -> tuple[BeforeValidator, WithJsonSchema]:
    """What pydantic needs to read a quantity: `Annotated[Any, *quantity(Gain("N m", above=0.0))]`."""
    return BeforeValidator(reader(gain)), WithJsonSchema(_schema(gain))


def quantity_or(word: str, meaning: float, gain: Gain) -> tuple[BeforeValidator, WithJsonSchema]:
    """The same for a quantity in whose place a word may stand."""
    read, schema = reader(gain), _schema(gain)
    described = {"anyOf": [{"const": word}, *schema["anyOf"]], "description": schema["description"]}
    return BeforeValidator(lambda value: meaning if value == word else read(value)), WithJsonSchema(described)


def scaled(
    kind: Literal["length", "velocity", "acceleration", "time"], gain: Gain
) -> tuple[BeforeValidator, WithJsonSchema]:
    """The same for scaled numbers: plain ones are, strings with the gain's unit become so. What one is worth in SI is told
    by the validation's context, under the name of its kind; the bounds are of scaled numbers."""
    read, schema = reader(gain), _schema(gain)
    schema["description"] = f"{gain.text} (scaled, or with a unit such as {gain.unit})"

    def to_scaled(value: Any, info: ValidationInfo) -> Any:
        return read(value, getattr(info.context, kind))

    return BeforeValidator(to_scaled), WithJsonSchema(schema)


def reader(gain: Gain) -> Callable[..., Any]:
    """A function from what the file holds, and what a unit is worth in SI if it is not one, to numbers of the declared shape
    and bounds."""

    def read(value: Any, worth: float = 1.0) -> Any:
        try:
            return gain.check(value if gain.choices else _to_numbers(value, gain, worth))
        except (ValueError, TypeError) as error:
            raise PydanticCustomError("quantity", "{reason}", {"reason": _plain(error)}) from None

    return read


def _plain(error: Exception) -> str:
    return " ".join(str(error).split())


def _to_numbers(value: Any, gain: Gain, worth: float) -> Any:
    # Tuples are defaults.
    if isinstance(value, (list, tuple)):
        return [_to_numbers(item, gain, worth) for item in cast(list[Any], value)]
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        raise ValueError(f"{gain.describe()} in {_shown(gain.unit)}")
    return _parse(value, gain.unit) / worth if isinstance(value, str) else value


def _parse(text: str, unit: str) -> float:
    number, _, rest = text.strip().partition(" ")
    if rest.split() == unit.split() and unit != "1":
        # The common case, spared the start-up of the units library.
        with suppress(ValueError):
            return float(number)
    import pint

    registry = _registry()
    try:
        return float(registry.Quantity(text).to(_for_pint(unit)).magnitude)
    except pint.DimensionalityError:
        raise ValueError(f"a quantity in {_shown(unit)}") from None
    except Exception:
        # pint raises errors of many kinds, tokeniser errors included, on text that is no quantity.
        raise ValueError(f"a number, or a string with a number and a unit such as '1 {_shown(unit)}'") from None


@cache
def _registry() -> Any:
    import pint

    return pint.UnitRegistry(cache_folder=":auto:")


def _for_pint(unit: str) -> str:
    return "dimensionless" if unit == "1" else unit


def _shown(unit: str) -> str:
    return "no unit" if unit == "1" else unit


def _schema(gain: Gain) -> dict[str, Any]:
    described = {"description": f"{gain.text or 'quantity'} ({_shown(gain.unit)})"}
    if gain.choices:
        return {"enum": list(gain.choices)} | described
    number: dict[str, Any] = {"type": "integer" if gain.whole else "number"}
    bounds = {"exclusiveMinimum": gain.above, "minimum": gain.at_least, "maximum": gain.at_most}
    number |= {key: bound for key, bound in bounds.items() if bound is not None}
    single: list[dict[str, Any]] = [number, {"type": "string"}]
    if not gain.shape:
        return {"anyOf": single} | described
    row = {"type": "array", "items": {"anyOf": single}, "minItems": gain.shape[-1], "maxItems": gain.shape[-1]}
    forms = [*single, row] if gain.spread else [row]
    if len(gain.shape) == 2:
        forms.append({"type": "array", "items": row, "minItems": gain.shape[0], "maxItems": gain.shape[0]})
    return {"anyOf": forms} | described
