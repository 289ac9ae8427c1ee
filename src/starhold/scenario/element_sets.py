"""Mean elements in files, two lines (TLE) or an orbit mean-elements message (OMM), give an orbit's start by SGP4.

SGP4 (Hoots and Roehrich 1980; Vallado et al. 2006), of the package `sgp4`, gives position and velocity in axes of the true
equator and the mean equinox (TEME), which are turned to the mean equator and equinox of date.
"""

from __future__ import annotations

import json
import re
import warnings
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from starhold.algebra.quaternion import to_body
from starhold.algebra.vector import Vector
from starhold.errors import InputError
from starhold.files import read_text
from starhold.parts.epoch import Date, date_of, date_text, days_of, true_to_mean
from starhold.parts.orbit import carried
from starhold.scenario.checking import show

KINDS = ("tle", "omm")
OLD = 14.0
"""Days from the elements' epoch beyond which their error, some km a day, is worth a warning."""
SHOWN = 64
"""Instants of a flight at which its orbit is compared with SGP4's."""
ALLOWED = {
    "tle": "a text file of one satellite's two lines of 69 characters, with or without a name above",
    "omm": "an orbit mean-elements message of one satellite, as .xml, .csv, .json, or keyword = value",
}


class ElementSet(NamedTuple):
    """The mean elements of a file: its name, the two lines, or the fields of a message and their values."""

    file: str
    lines: tuple[str, ...] = ()
    fields: tuple[tuple[str, str], ...] = ()

    def satellite(self) -> Any:
        """The satellite as `sgp4` has it. ValueError or KeyError for elements that it cannot read."""
        record = import_module("sgp4.api").Satrec
        if self.lines:
            return record.twoline2rv(*self.lines)
        satellite = record()
        import_module("sgp4.omm").initialize(satellite, dict(self.fields))
        return satellite

    @property
    def epoch(self) -> Date:
        """The epoch of the elements, UTC."""
        return date_of(import_module("sgp4.conveniences").sat_epoch_datetime(self.satellite()))

    def state(self, epoch: Date, later: float = 0.0) -> tuple[Vector, Vector]:
        """Position (m) and velocity (m/s) so many seconds after an epoch (UTC), in the mean equator and equinox of that
        epoch. ValueError where SGP4 has none."""
        days = days_of(epoch)
        error, position, velocity = self.satellite().sgp4(2451545.0, days + later / 86400.0)
        if error:
            raise ValueError(f"at {date_text(epoch)} SGP4 has no orbit: {import_module('sgp4.api').SGP4_ERRORS[error]}")
        turn = true_to_mean(days)
        x, y = (to_body(turn, tuple(1e3 * part for part in vector)) for vector in (position, velocity))  # pyright: ignore
        return x, y


def with_orbit(data: Mapping[str, Any], folder: Path, where: str) -> Mapping[str, Any]:
    """Raw tables of a scenario with the state that SGP4 gives beside the file that [orbit] names. InputError for a file that
    holds no such elements."""
    table = data.get("orbit")
    kind = next((kind for kind in KINDS if isinstance(table, dict) and kind in table), None)
    if kind is None or not isinstance(table, dict):
        return data
    key = f"orbit.{kind}"
    other = next((name for name in table if name not in (kind, "epoch")), None)
    if other is not None:
        raise InputError(where, f"orbit.{other}", f"a key beside {kind}", f"{kind} alone, or with epoch")
    if not isinstance(table[kind], str):
        raise InputError(where, key, show(table[kind]), f"the name of {ALLOWED[kind]}")
    try:
        import_module("sgp4.api")
    except ImportError:
        raise InputError(where, key, "no package sgp4", "pip install 'starhold[orbits]'") from None
    path = folder / table[kind]
    try:
        elements = (_two_lines if kind == "tle" else _message)(path)
        begin = elements.epoch
    except OSError as error:
        raise InputError(where, key, f"{path}: {error.strerror}", ALLOWED[kind]) from None
    except (ValueError, KeyError, TypeError, SyntaxError) as error:
        said = f"no {error.args[0]}" if isinstance(error, KeyError) else str(error)
        raise InputError(where, key, f"{path}: {said}", ALLOWED[kind]) from None
    try:
        epoch = date_of(table["epoch"]) if "epoch" in table else begin
        position, velocity = elements.state(epoch)
    except ValueError as error:
        raise InputError(where, "orbit.epoch", str(error), f"a date near that of the elements, {date_text(begin)}") from None
    away = abs(days_of(epoch) - days_of(begin))
    if away > OLD:
        warnings.warn(f"{key}: the elements are of {date_text(begin)}, {away:.0f} days from the epoch", stacklevel=2)
    state = {"position": list(position), "velocity": list(velocity), "epoch": list(epoch)}
    return {**data, "orbit": {kind: elements, **state}}


def apart(elements: ElementSet, epoch: Date, gravity: float, duration: float) -> float:
    """The largest distance (m) between the two-body orbit from SGP4's state and SGP4's own orbit during a flight."""
    position, velocity = elements.state(epoch)
    times = np.linspace(0.0, duration, SHOWN)
    followed = np.array([elements.state(epoch, float(t))[0] for t in times])
    return float(np.linalg.norm(carried(position, velocity, gravity, times) - followed, axis=1).max())


def _two_lines(path: Path) -> ElementSet:
    """The two lines of a file. ValueError says which line is wrong, and why."""
    rows = [(number, line.rstrip()) for number, line in enumerate(read_text(path).splitlines(), 1) if line.strip()]
    pair = [(number, line) for number, line in rows if re.match(r"[12] ", line)]
    if [line[0] for _, line in pair] != ["1", "2"] or len(rows) > 3:
        raise ValueError(f"{len(pair)} lines that begin with 1 or 2, of {len(rows)}")
    checksum = import_module("sgp4.io").compute_checksum
    for number, line in pair:
        if len(line) != 69:
            raise ValueError(f"line {number} has {len(line)} characters, not 69")
        if line[68] != str(checksum(line)):
            raise ValueError(f"line {number} ends with the checksum {line[68]}, but its digits add up to {checksum(line)}")
    (_, first), (_, second) = pair
    if first[2:7] != second[2:7]:
        raise ValueError(f"lines of two satellites, {first[2:7].strip()} and {second[2:7].strip()}")
    return ElementSet(path.name, (first, second))


def _message(path: Path) -> ElementSet:
    """The fields of a message. ValueError, KeyError or SyntaxError for another file."""
    text, omm = read_text(path), import_module("sgp4.omm")
    parsers = {".xml": omm.parse_xml, ".csv": omm.parse_csv}
    if path.suffix in parsers:
        with path.open(encoding="utf-8") as file:
            messages = list(parsers[path.suffix](file))
    elif path.suffix == ".json":
        given = json.loads(text)
        messages = given if isinstance(given, list) else [given]
    else:
        messages = [dict(re.findall(r"^\s*(\w+)\s*=\s*(.*?)\s*(?:\[.*\])?\s*$", text, re.MULTILINE))]
    if len(messages) != 1:
        raise ValueError(f"{len(messages)} satellites")
    fields = {str(name): str(value) for name, value in messages[0].items()}
    if fields.get("MEAN_ELEMENT_THEORY", "SGP4") not in ("SGP4", "SGP/SGP4"):
        raise ValueError(f"MEAN_ELEMENT_THEORY {fields['MEAN_ELEMENT_THEORY']}, not SGP4")
    return ElementSet(path.name, fields=tuple(fields.items()))
