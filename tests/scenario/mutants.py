"""Scenarios with something wrong: built-in ones with keys, values, types and sizes changed at random, by a seed."""

import json
import math
import random
import tomllib
from copy import deepcopy

from starhold.scenario.bodies import bodies
from starhold.scenario.reading import builtin_names, builtin_text
from starhold.scenario.writing import template_text

ODD = [
    *(True, False, 0, 1, -1, 2, 3, 0.5, 7, 90, 1000, 2**31, 2**63, 10**30, 10**50),
    *(math.nan, math.inf, -math.inf, 1e-300, 1e-30, 1e-12, 1e-6, 1e6, 1e12, 1e29, 1e155, 1e300, -1e29, -0.0),
    *("", " ", "x", "yes", "true", "none", "axis", "target", "orbital", "history", "L1", "nan", "1e400 m", "9**9**9 s"),
    *("1 m", "1 km", "1 s", "1 h", "1e30 yr", "1 N m", "1 mNm", "1 deg", "400 deg", "1 Hz", "1 m/s", "5 %", "a\nb", "\x00"),
    *("[/red]", [], [[]], {}, [{}], [0, 0, 0], [1, 0, 0], [1, 2, 3], [0, 0, 0, 0], [1, 0, 0, 0], [10, 0, 0, 0]),
    *([1e29, 1, 1], ["1 m", 2, "x"], [math.nan] * 3, [1] * 100, {"from": 0, "to": 1, "step": 1e-9}),
    *([[1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 0, 0], [0, 0, 0], [0, 0, 0]]),
]
TEXTS = [*(template_text(body) for body in bodies()), *(builtin_text(name) for name in builtin_names())]
SHORT = 40
"""Control steps of a mutant whose timing is left alone."""


def keys_of(table, place=()):
    """The places of all values, tables and lists included."""
    if isinstance(table, dict):
        for key, value in table.items():
            yield (*place, key)
            yield from keys_of(value, (*place, key))
    elif isinstance(table, list):
        for number, value in enumerate(table):
            yield (*place, number)
            yield from keys_of(value, (*place, number))


def at(table, place):
    for key in place:
        table = table[key]
    return table


WORDS = sorted({place[-1] for text in TEXTS for place in keys_of(tomllib.loads(text)) if isinstance(place[-1], str)})


def scale(table, chance):
    """Change the size or the sign of one number of a scenario's tables, with or without a unit."""
    places = [place for place in keys_of(table) if number_in(at(table, place)) is not None]
    *parent, last = chance.choice(places)
    value = at(table, parent)[last]
    far = 10.0 ** chance.randint(-25, 25)
    factor = chance.choice([-1.0, 0.0, 1e3, 1e-3, 180.0 / math.pi, far, chance.uniform(0.1, 10.0)])
    number, unit = number_in(value)
    at(table, parent)[last] = f"{number * factor!r} {unit}" if unit else type(number)(number * factor)


def number_in(value):
    """The number of a quantity and its unit, None for what is none."""
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        return None
    if not isinstance(value, str):
        return value, ""
    number, _, unit = value.partition(" ")
    try:
        return float(number), unit
    except ValueError:
        return None


def mutate(table, chance):
    """Change one thing of a scenario's tables."""
    places = list(keys_of(table))
    *parent, last = chance.choice(places)
    holder = at(table, parent)
    value, way = holder[last], chance.randrange(8)
    if way == 0:
        del holder[last]
    elif way == 1 and isinstance(last, str):
        holder[chance.choice([last[:-1], last + "s", last.upper(), "x" * 300])] = holder.pop(last)
    elif way == 2:
        holder[last] = deepcopy(at(table, chance.choice(places)))
    elif way == 3 and isinstance(value, int | float) and not isinstance(value, bool):
        holder[last] = chance.choice([-value, value * 10.0 ** chance.randint(-20, 20), round(value, -1), str(value)])
    elif way == 4 and isinstance(value, str):
        holder[last] = chance.choice([value[:-1], value + " m", value.replace(" ", ""), value * 50, value.upper()])
    elif way == 5 and isinstance(value, list):
        holder[last] = chance.choice([value[:-1], value + value, [value], list(reversed(value))])
    elif way == 6:
        if isinstance(value, dict):
            value[chance.choice(WORDS)] = chance.choice(ODD)
        else:
            holder[last] = chance.choice(ODD)
    else:
        holder[last] = chance.choice(ODD)


def shown(value):
    """A value as TOML."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(str(key))} = {shown(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(shown, value)) + "]"
    if isinstance(value, float):
        return repr(value)
    return json.dumps(value) if isinstance(value, str | bool | int) else f"{value}"


def mutant(seed):
    """The text of a mutant; the same for the same seed."""
    chance = random.Random(seed)
    table = tomllib.loads(chance.choice(TEXTS))
    timing = table["simulation"]
    timing["duration"] = SHORT * timing.get("control_period", 0.001 if "libration" in table else 0.1)
    for _ in range(chance.choice([1, 1, 1, 2, 3])):
        chance.choice([mutate, scale, scale, scale])(table, chance)
    return "\n".join(f"{json.dumps(str(key))} = {shown(value)}" for key, value in table.items())
