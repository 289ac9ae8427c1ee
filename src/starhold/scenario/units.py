"""Converts texts such as "0.01 N m" to numbers. Numbers and units are parsed here, without evaluating expressions; the units
library only supplies conversion factors."""

import hashlib
import re
from collections import defaultdict
from contextlib import suppress
from functools import cache
from typing import Any

LONGEST = 100
"""The most characters of a quantity."""
MOST_POWER = 9
"""The largest total exponent of a unit."""
_NUMBER = re.compile(r"[+-]?(?:\d+(?:_\d+)*(?:\.(?:\d+(?:_\d+)*)?)?|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)
_OVER = re.compile(r"(?:1\s*)?/\s*")
_FACTOR = re.compile(
    r"(?P<root>√\s*|sqrt\s*(?=\())?"
    r"(?:(?P<name>[^\W\d_]+(?:_[^\W\d_]+)*|[°%])|\((?P<group>(?:[^()]|(?<=sqrt)\([^()]*\))*)\))"
    r"(?:\^(?P<halves>-?[0-9]?\.5)|\^?(?P<power>-?[0-9]))?"
)
_HALVES = re.compile(r"\^\((-?[13579])/2\)")
_JOINT = re.compile(r"\s*[*·⋅/]\s*|\s+|[.-]")
_RAISED = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")
_TOGETHER = re.compile(r"(?P<force>[nuµμmkM]?N)m(?P<time>s?)|(?P<mass>k?g)m")
"""Matches units without spaces, as in mNm, Nms and kgm², which the library misreads."""
DECIBEL = "dB"
_SHARES = {"%": "percent", "percent": "percent", "ppm": "ppm"}

_DEGREE = 0.017453292519943295
COMMON = {
    ("deg", "rad"): _DEGREE,
    ("deg/s", "rad/s"): _DEGREE,
    ("deg/s^2", "rad/s^2"): _DEGREE,
    ("arcsec", "rad"): 4.84813681109536e-06,
    ("ms", "s"): 1e-3,
    ("min", "s"): 60.0,
    ("h", "s"): 3600.0,
    ("d", "s"): 86400.0,
    ("yr", "s"): 31557600.0,
    ("km", "m"): 1000.0,
    ("km/s", "m/s"): 1000.0,
    ("mN m", "N m"): 1e-3,
    ("mN m s", "N m s"): 1e-3,
    ("mA m^2", "A m^2"): 1e-3,
    ("nT", "T"): 1e-9,
}
"""The factors of common units, equal to the library's to the last bit; the library takes long to load."""


def to_number(text: str, unit: str) -> float:
    """Return the value of a text such as "20 mN m" in a unit such as "N m"; "6 dB" in the unit "1" gives the amplitude
    ratio. ValueError says what is allowed."""
    text = text.strip()
    number = _NUMBER.match(text)
    if number is None or len(text) > LONGEST:
        raise ValueError(_allowed(unit))
    value, given = float(number[0]), text[number.end() :].strip()
    if given == unit and unit != "1":
        return value
    if (given, unit) == (DECIBEL, "1"):
        return 10.0 ** (value / 20.0)
    if (given, unit) in COMMON:
        return value * COMMON[given, unit]
    return _convert(value, _powers(given, unit), unit)


def to_either(text: str, unit: str, also: str) -> float:
    """Return the value of a text in `unit`, or of a text in the unit `also` without conversion. ValueError names both."""
    for wanted in (unit, also):
        with suppress(ValueError):
            return to_number(text, wanted)
    raise ValueError(f"a quantity in {shown(unit)} or in {also}")


def apart(text: str) -> tuple[float, str]:
    """Return the number and the unit of a text that `to_number` accepts, as written."""
    number = _NUMBER.match(text.strip())
    assert number is not None
    return float(number[0]), text.strip()[number.end() :].strip()


def shown(unit: str) -> str:
    """Return the name of a unit in messages."""
    return "no unit" if unit == "1" else unit


def _allowed(unit: str) -> str:
    return f"a number, or a string with a number and a unit such as '1 {shown(unit)}'"


@cache
def _powers(given: str, unit: str) -> dict[str, float]:
    """Return the units in a text with their exponents; `unit`: the unit named in errors."""
    given = re.sub(f"[{'⁰¹²³⁴⁵⁶⁷⁸⁹⁻'}]+", lambda raised: "^" + raised[0].translate(_RAISED), given)
    given = re.sub(r"\s*(?:\*\*|\^)\s*", "^", given)
    given = _HALVES.sub(lambda halves: f"^{int(halves[1]) / 2}", given)
    powers = _read(given, unit) if given else {}
    if any(abs(power) > MOST_POWER for power in powers.values()):
        raise ValueError(_allowed(unit))
    return {name: power for name, power in powers.items() if power}


def _read(given: str, unit: str) -> dict[str, float]:
    """Return the units with their exponents, read factor by factor from left to right; parentheses are not nested, except
    around a root."""
    powers: defaultdict[str, float] = defaultdict(int)
    over = _OVER.match(given)
    sign, place = (-1, over.end()) if over else (1, 0)
    while factor := _FACTOR.match(given, place):
        power = float(factor["halves"]) if factor["halves"] else int(factor["power"] or 1)
        whole = sign * 0.5 if factor["root"] else sign
        if factor["name"] is None:
            for name, inner in _read(factor["group"].strip(), unit).items():
                powers[name] += whole * power * inner
        else:
            *others, last = _split(factor["name"])
            for name in others:
                powers[name] += whole
            powers[last] += whole * power
        if factor.end() == len(given):
            return powers
        joint = _JOINT.match(given, factor.end())
        if joint is None:
            break
        sign, place = -1 if "/" in joint[0] else 1, joint.end()
    raise ValueError(_allowed(unit))


def _split(name: str) -> list[str]:
    """Return the units in a compound name; an exponent after it applies to the last one."""
    together = _TOGETHER.fullmatch(name)
    if together is None:
        return [name]
    return [together["force"] or together["mass"], "m", *(["s"] if together["time"] else [])]


def _convert(value: float, powers: dict[str, float], unit: str) -> float:
    if unit == "1":
        # An angle is not dimensionless here, although it is in the library.
        if not powers:
            return value
        if not powers.keys() <= _SHARES.keys() or sum(powers.values()) != 1:
            raise ValueError(f"a quantity in {shown(unit)}")
        powers = {_SHARES[name]: power for name, power in powers.items()}
    import pint

    registry = unit_registry()
    try:
        given, wanted = _container({"deg" if name == "°" else name: power for name, power in powers.items()}), _wanted(unit)
        if not _angle_fits(given, wanted):
            raise ValueError(f"a quantity in {unit}")
        return float(registry.convert(value, given, wanted))
    except pint.UndefinedUnitError as error:
        raise ValueError(f"a quantity in {shown(unit)}; {error.unit_names} is not a known unit") from None
    except (pint.PintError, OverflowError, ZeroDivisionError):
        raise ValueError(f"a quantity in {shown(unit)}") from None


def _angle_fits(given: Any, wanted: Any) -> bool:
    """Return whether radians appear as the unit needs; 1/s is accepted for rad/s, but Hz, which may count turns, is not."""
    roots = [unit_registry().get_root_units(units)[1] for units in (given, wanted)]
    angle, wanted_angle = (root._units.get("radian", 0) for root in roots)
    if wanted_angle == 0 or angle == wanted_angle:
        return True
    return angle == 0 and len(roots[1]._units) > 1 and not any("hertz" in name for name in given)


@cache
def _wanted(unit: str) -> Any:
    return _container({} if unit == "1" else _powers(unit, unit))


def _container(powers: dict[str, float]) -> Any:
    from pint.util import UnitsContainer

    registry, named = unit_registry(), defaultdict[str, float](int)
    for name, power in powers.items():
        named[registry.get_name(name)] += power
    return UnitsContainer({name: power for name, power in named.items() if power})


@cache
def unit_registry() -> Any:
    """Return the registry of units (pint), read from a cache on the disk where possible.

    All Python environments of a user share pint's default cache folder, and its entries name files of the environment that
    wrote them; if that one is deleted, all others fail. So each environment has its own folder here."""
    import pint
    import platformdirs

    here = hashlib.sha256(f"{pint.__version__} {pint.__file__}".encode()).hexdigest()[:16]
    try:
        return pint.UnitRegistry(cache_folder=platformdirs.user_cache_path("starhold", appauthor=False) / f"units-{here}")
    except OSError:
        return pint.UnitRegistry()
