"""Initial states of orbits from files: mean elements, as two lines (TLE) or an orbit mean-elements message (OMM), by SGP4;
an orbit ephemeris message (OEM) by interpolation.

SGP4 (Hoots and Roehrich 1980; Vallado et al. 2006), of the package `sgp4`, gives position and velocity in axes of the true
equator and the mean equinox (TEME), which are rotated to the mean equator and equinox of date.

From this state on, the scenario's own motion is flown; `say_distance` warns how far it departs from that of the file.
"""

from __future__ import annotations

import json
import re
import warnings
from collections.abc import Mapping
from functools import reduce
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from starhold.algebra.quaternion import to_body
from starhold.algebra.vector import Vector, add
from starhold.errors import InputError, optional
from starhold.export.aem import SECOND, instant_of
from starhold.export.oem import Oem, parse_oem
from starhold.files import read_text
from starhold.parts.catalogue import fit
from starhold.parts.epoch import OF_DATE, OF_J2000, Date, date_of, date_text, days_of, iso_text, precession, true_to_mean
from starhold.scenario.checking import show

if TYPE_CHECKING:
    from starhold.scenario.reading import Scenario

KINDS = ("tle", "omm", "oem")
BESIDE = ("epoch", "ephemeris")
"""Keys of [orbit] that may accompany a file."""
FRAMES = (OF_J2000, "ICRF", "GCRF", OF_DATE, "TEME")
"""Reference frames of an ephemeris that are read. ICRF and GCRF are treated as EME2000, from which they differ by 0.02"."""
NEAREST = 6
"""The number of states from which a state of an ephemeris is interpolated."""
OLD = 14.0
"""Days from the epoch of mean elements after which their error, some km per day, causes a warning."""
SHOWN = 64
"""The number of instants at which the flown orbit is compared with the file's."""
ALLOWED = {
    "tle": "a text file of one satellite's two lines of 69 characters, with or without a name above",
    "omm": "an orbit mean-elements message of one satellite, as .xml, .csv, .json, or keyword = value",
    "oem": "an orbit ephemeris message about the Earth, UTC, as keyword = value",
}


class ElementSet(NamedTuple):
    """The mean elements of a file: its name, and either the two lines or the fields of a message by keyword."""

    file: str
    lines: tuple[str, ...] = ()
    fields: tuple[tuple[str, str], ...] = ()
    motion = "SGP4's orbit"

    def satellite(self) -> Any:
        """The satellite, an object of `sgp4`. ValueError or KeyError for elements that cannot be read."""
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
        """Return position (m) and velocity (m/s) `later` seconds after an epoch (UTC), in the mean equator and equinox of
        that epoch. ValueError where SGP4 fails."""
        days = days_of(epoch)
        error, position, velocity = self.satellite().sgp4(2451545.0, days + later / 86400.0)
        if error:
            raise ValueError(f"at {date_text(epoch)} SGP4 has no orbit: {import_module('sgp4.api').SGP4_ERRORS[error]}")
        turn = true_to_mean(days)
        x, y = (to_body(turn, tuple(1e3 * part for part in vector)) for vector in (position, velocity))  # pyright: ignore
        return x, y

    @property
    def last(self) -> float:
        """How long after its epoch it has states (s)."""
        return np.inf


class Ephemeris(NamedTuple):
    """The states of a file: its name, the reference frame, the epoch of the first state, and for each state the time since
    then (s), the position (m) and the velocity (m/s)."""

    file: str
    frame: str
    first: str
    rows: tuple[tuple[float, ...], ...]
    begins: tuple[int, ...] = (0,)
    """The index of the first state of each segment."""
    motion = "the ephemeris"

    @property
    def epoch(self) -> Date:
        """The epoch of the first state, UTC."""
        return date_of(self.first)

    @property
    def last(self) -> float:
        """How long after its epoch it has states (s)."""
        return self.rows[-1][0]

    def state(self, epoch: Date, later: float = 0.0) -> tuple[Vector, Vector]:
        """Return position (m) and velocity (m/s) `later` seconds after an epoch (UTC), in the mean equator and equinox of
        that epoch, from the polynomial through the nearest states. ValueError outside the time span of the states."""
        from scipy.interpolate import KroghInterpolator

        time = (instant_of(iso_text(epoch)) - instant_of(self.first)) / SECOND + later
        # Days are floats, which resolve an instant to a microsecond.
        if not -1e-5 <= time <= self.last + 1e-5:
            side = "before the first" if time < 0.0 else "after the last"
            raise ValueError(f"{date_text(epoch)} is {side} state of {self.file}")
        # A manoeuvre may lie between two segments: no polynomial goes through both.
        first = max((begin for begin in self.begins if self.rows[begin][0] <= time), default=0)
        segment = self.rows[first : next((begin for begin in self.begins if begin > first), None)]
        times = np.array([row[0] for row in segment])
        begin = int(np.clip(np.searchsorted(times, time) - NEAREST // 2, 0, max(len(times) - NEAREST, 0)))
        rows = np.array(segment[begin : begin + NEAREST])
        # Each time twice: for the position and for its derivative.
        nodes, values = np.repeat(rows[:, 0] - time, 2), rows[:, 1:].reshape(-1, 3)
        interpolated = KroghInterpolator(nodes, values).derivatives(0.0, der=2)
        days = days_of(epoch)
        turns = {OF_DATE: (1.0, 0.0, 0.0, 0.0), "TEME": true_to_mean(days)}
        x, y = (to_body(turns.get(self.frame) or precession(days), tuple(vector)) for vector in interpolated.tolist())  # pyright: ignore
        return x, y


def with_orbit(data: Mapping[str, Any], folder: Path, where: str) -> Mapping[str, Any]:
    """Return a scenario's raw tables with the position and velocity from the file that [orbit] names, if any. InputError
    where the file cannot be read or has no state at the epoch."""
    table = data.get("orbit")
    kind = next((kind for kind in KINDS if isinstance(table, dict) and kind in table), None)
    if kind is None or not isinstance(table, dict):
        return data
    key = f"orbit.{kind}"
    other = next((name for name in table if name not in (kind, *BESIDE)), None)
    if other is not None:
        raise InputError(where, f"orbit.{other}", f"a key beside {kind}", f"{kind} alone, or with {' and '.join(BESIDE)}")
    if not isinstance(table[kind], str):
        raise InputError(where, key, show(table[kind]), f"the name of {ALLOWED[kind]}")
    if kind != "oem":
        optional("sgp4.api", f"{where}: {key}", "orbits")
    path = folder / table[kind]
    try:
        elements = READERS[kind](path)
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
        allowed = f"a date near that of the elements, {date_text(begin)}"
        if isinstance(elements, Ephemeris):
            allowed = f"a date of the ephemeris: from {date_text(begin)}, for {elements.last:.10g} s"
        raise InputError(where, "orbit.epoch", str(error), allowed) from None
    away = abs(days_of(epoch) - days_of(begin))
    if away > OLD and isinstance(elements, ElementSet):
        warnings.warn(f"{key}: the elements are of {date_text(begin)}, {away:.0f} days from the epoch", stacklevel=2)
    state = {"position": list(position), "velocity": list(velocity), "epoch": list(epoch)}
    return {**data, "orbit": {**table, kind: elements, **state}}


def say_distance(scenario: Scenario) -> None:
    """Warn how far the flown motion departs from the motion in the file that [orbit] names, if any."""
    orbit = scenario.orbit
    kind = next((kind for kind in KINDS if getattr(orbit, kind, None) is not None), None)
    if orbit is None or kind is None:
        return
    source: ElementSet | Ephemeris = getattr(orbit, kind)
    begun = days_of(orbit.epoch) - days_of(source.epoch)
    duration = scenario.table.simulation.duration
    covered = min(duration, source.last - 86400.0 * begun)
    if covered <= 0.0:
        return
    pushing = [f for f in scenario.parts if f.part.hook("acceleration") or f.part.hook("push")]
    pushing = [f for f in pushing if getattr(f.params, "moves_orbit", 1)]
    # Only forces that depend on the position alone are included.
    movers = [fit("environment", "two-body"), *(f for f in pushing if f.part.hook("perturbation"))]
    left = [f.called for f in pushing if f not in movers]
    times = np.linspace(0.0, covered, SHOWN)
    followed = np.array([source.state(orbit.epoch, float(t))[0] for t in times])
    far = 1e-3 * float(np.linalg.norm(_flown(scenario, movers, times) - followed, axis=1).max())
    more = f" with {' and '.join(f.called for f in movers[1:])}" if movers[1:] else ""
    said = f"orbit.{kind}: two-body motion{more} from this state departs by {far:.3g} km from {source.motion}"
    said += f" in {covered:.6g} s"
    said += ", where it ends" if covered < duration else ""
    said += f", without {' and '.join(left)}" if left else ""
    said += "; a part such as oblateness brings it nearer" if not more else ""
    warnings.warn(said, stacklevel=2)


def _flown(scenario: Scenario, movers: list[Any], times: Any) -> Any:
    """Return positions (n, 3; m) at times (n,) (s) of the motion under forces that depend only on the position."""
    from scipy.integrate import solve_ivp

    craft, forces = scenario.made.craft, [(f.part.module.acceleration, f.prepared(1.0)) for f in movers]

    def slope(_: float, y: Any) -> Any:
        x, y, z, *velocity = y.tolist()
        state = SimpleNamespace(position=(x, y, z))
        return [*velocity, *reduce(add, (force(state, numbers, craft, ()) for force, numbers in forces))]

    begun = [x for vector in scenario.table.orbit.start for x in vector]
    return solve_ivp(slope, (0.0, times[-1]), begun, "DOP853", times, rtol=1e-10, atol=1e-3).y[:3].T


def _two_lines(path: Path) -> ElementSet:
    """Return the two lines in a file. ValueError says which line is wrong, and why."""
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
    """Return the mean elements in a message. ValueError, KeyError or SyntaxError where the file is not such a message."""
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


def _ephemeris(path: Path) -> Ephemeris:
    """Return the states in a message. ValueError for another file, and for a message not about the Earth or not in UTC."""
    oem: Oem = parse_oem(path)
    for key, given, allowed in (
        ("CENTER_NAME", oem.center.upper(), ("EARTH",)),
        ("REF_FRAME", oem.frame, FRAMES),
        ("TIME_SYSTEM", oem.time_system, ("UTC",)),
    ):
        if given not in allowed:
            raise ValueError(f"{key} = {given}, of which {', '.join(allowed)} are read")
    rows = np.column_stack([oem.times, oem.states]).tolist()
    return Ephemeris(path.name, oem.frame, oem.epoch, tuple(map(tuple, rows)), oem.begins)


READERS = {"tle": _two_lines, "omm": _message, "oem": _ephemeris}
