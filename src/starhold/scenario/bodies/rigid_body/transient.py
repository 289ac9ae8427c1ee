"""The [transient] table: the limits of a slew, and the search for the closed-loop root that slews fastest within them."""

import math
from collections.abc import Callable
from itertools import pairwise
from typing import Annotated, Any, Self, cast

from pydantic import BeforeValidator, WithJsonSchema, model_validator

from starhold.laws.interface import Gain
from starhold.scenario.quantity import quantity, reader
from starhold.scenario.tables import Table, at_key, refuse

MOST = 100_000
"""The largest number of values in a list."""
ANGLE = Gain("rad", above=0.0, at_most=math.pi, text="initial angles of the search")
ROOT = Gain("1/s", text="closed-loop roots to try")
RATE = Gain("rad/s", text="relative to the target at the start of the search: along the axis, or a vector in body axes")


def _spread(first: float, last: float, step: float) -> list[float]:
    """Return first, first + step, ... up to last."""
    count = int((last - first) / step * (1.0 + 1e-12) + 1e-9) + 1
    # Rounded, so that decimal steps give the intended decimals.
    return [min(float(f"{first + step * k:.13g}"), last) for k in range(count)]


def _values(gain: Gain) -> tuple[BeforeValidator, WithJsonSchema]:
    """Return the annotations for increasing quantities, given as a list or as { from, to, step }."""
    allowed = "a list of values that increase, or { from = .., to = .., step = .. }"
    read, size = reader(gain), reader(Gain(gain.unit, above=0.0))

    def values(given: Any) -> tuple[float, ...]:
        if isinstance(given, dict):
            table = cast(dict[str, Any], given)
            if set(table) != {"from", "to", "step"}:
                raise refuse(allowed)
            first, last, step = read(table["from"]), read(table["to"]), size(table["step"])
            if first > last:
                raise refuse("from at most to")
            if not (last - first) / step < MOST:
                raise refuse(f"at most {MOST} values")
            return tuple(_spread(first, last, step))
        if not isinstance(given, (list, tuple)) or not given:
            raise refuse(allowed)
        numbers = tuple(read(value) for value in cast(list[Any], given))
        if len(numbers) > MOST or any(a >= b for a, b in pairwise(numbers)):
            raise refuse(f"at most {MOST} values" if len(numbers) > MOST else allowed)
        return numbers

    single = {"anyOf": [{"type": "number"}, {"type": "string"}]}
    keys = {"from": single, "to": single, "step": single}
    spread = {"type": "object", "properties": keys, "required": list(keys), "additionalProperties": False}
    forms: list[dict[str, Any]] = [{"type": "array", "items": single, "minItems": 1}, spread]
    return BeforeValidator(values), WithJsonSchema({"anyOf": forms, "description": f"{gain.text} ({gain.unit})"})


def _number_or_vector(gain: Gain) -> tuple[BeforeValidator, WithJsonSchema]:
    number = reader(gain)
    vector = reader(Gain(gain.unit, shape=(3,), spread=False))
    read: Callable[[Any], Any] = lambda given: (vector if isinstance(given, list) else number)(given)  # noqa: E731
    single = [{"type": "number"}, {"type": "string"}]
    row = {"type": "array", "items": {"anyOf": single}, "minItems": 3, "maxItems": 3}
    return BeforeValidator(read), WithJsonSchema({"anyOf": [*single, row], "description": f"{gain.text} ({gain.unit})"})


class TransientTable(Table):
    """Limits of a slew, its end conditions, and the range in which `starhold modal-roots` searches for the fastest."""

    rate_limit: Annotated[float, *quantity(Gain("rad/s", above=0.0, text="limit on the norm of the body's rate"))] = math.inf
    acceleration_limit: Annotated[
        float, *quantity(Gain("rad/s^2", above=0.0, text="limit on each component of the rate's derivative"))
    ] = math.inf
    rate_tolerance: Annotated[
        float, *quantity(Gain("rad/s", at_least=0.0, text="by which the search also tries to exceed the limit"))
    ] = 0.0
    acceleration_tolerance: Annotated[
        float, *quantity(Gain("rad/s^2", at_least=0.0, text="by which the search also tries to exceed the limit"))
    ] = 0.0
    angle_end: Annotated[
        float, *quantity(Gain("rad", above=0.0, at_most=math.pi, text="the transient ends once the angle stays below"))
    ] = math.radians(0.1)
    rate_end: Annotated[
        float, *quantity(Gain("rad/s", above=0.0, text="and the rate relative to the target stays below"))
    ] = math.radians(0.1)
    axis: Annotated[Any, *quantity(Gain("1", shape=(3,), spread=False, text="axis of the slews, body axes"))] = (
        1.0,
        1.0,
        1.0,
    )
    rate: Annotated[Any, *_number_or_vector(RATE)] = 0.0
    angles: Annotated[Any, *_values(ANGLE)] = tuple(math.radians(5.0 * k) for k in range(2, 37))
    roots: Annotated[Any, *_values(ROOT)] = tuple(_spread(-3.0, -0.001, 0.001))

    @property
    def start_rate(self) -> tuple[float, float, float]:
        """The rate at which slews start (rad/s)."""
        if isinstance(self.rate, tuple):
            return cast(tuple[float, float, float], self.rate)
        x, y, z = (self.rate * part / math.hypot(*self.axis) for part in self.axis)
        return (x, y, z)

    @model_validator(mode="after")
    def _possible(self) -> Self:
        size = math.hypot(*self.axis)
        if not 0.0 < size < math.inf:
            raise at_key("axis", "a direction that is not zero", list(self.axis))
        if self.roots[-1] >= 0.0:
            raise at_key("roots", "roots below zero; others are not stable", self.roots[-1])
        fast = math.hypot(*self.start_rate)
        if fast > self.rate_limit:
            most = f"a rate within rate_limit, {math.degrees(self.rate_limit):g} deg/s, which the start exceeds"
            raise at_key("rate", most, f"{math.degrees(fast):g} deg/s")
        return self
