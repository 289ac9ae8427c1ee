"""CCSDS orbit ephemeris messages (OEM), written and read in keyword = value form.

Versions 1.0 to 3.0 (CCSDS 502.0-B-1 to -B-3). Positions and velocities of a message are in km and km/s; here they are in SI.
"""

from __future__ import annotations

from itertools import pairwise
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.quaternion import to_reference
from starhold.errors import InputError, shortly
from starhold.export.aem import SECOND, Lines, open_run, read_message, stamp_of, write_message
from starhold.files import read_text
from starhold.parts.epoch import OF_DATE, OF_J2000, date_of, days_of, precession

if TYPE_CHECKING:
    import xarray as xr

VERSIONS = ("1.0", "2.0", "3.0")
NEEDED = ("OBJECT_NAME", "CENTER_NAME", "REF_FRAME", "TIME_SYSTEM")


class Oem(NamedTuple):
    """The orbit of a message: the epoch of the first state, times (n,) in s since then, positions and velocities (n, 6; m,
    m/s), the names of the object, the centre, the frame and the time system, and the first rows of its segments, each with
    the end of the previous segment."""

    times: NDArray[np.float64]
    states: NDArray[np.float64]
    epoch: str
    object_name: str
    center: str
    frame: str
    time_system: str
    begins: tuple[int, ...] = (0,)


@shortly
def export_oem(
    run: xr.Dataset | str | Path,
    file: str | Path,
    *,
    epoch: str | None = None,
    object_name: str = "SPACECRAFT",
    object_id: str = "0000-000A",
    frame: str = OF_J2000,
    center: str = "EARTH",
) -> Path:
    """Write the orbit of a run as a CCSDS orbit ephemeris message, and return its path.

    run: what `simulate` returns, a run.nc or the folder of one. epoch: UTC at the start of the run, by default that of the
    scenario's [orbit], else 2000-01-01T12:00:00. frame: "EME2000", to which an orbit in axes of date (MOD_EARTH) is
    converted; any other name is taken as the name of the inertial axes. center: the central body. Numbers have all their
    digits. Raise InputError for a run without an orbit, a word that does not fit, and a file that cannot be written."""
    flown: Any = open_run(run)
    if "attitude" not in flown or not np.linalg.norm(flown["position"].to_numpy(), axis=1).all():
        raise InputError("export oem", "", "a run without an orbit", "one of a scenario with [orbit]")
    states = np.concatenate([flown["position"].to_numpy(), flown["velocity"].to_numpy()], axis=1)
    if flown.attrs.get("frame") == OF_DATE and frame == OF_J2000:
        turn = precession(days_of(date_of(flown.attrs["epoch"])))
        halves: list[Any] = [to_reference(turn, tuple(half.T)) for half in (states[:, :3], states[:, 3:])]
        states = np.concatenate(halves).T
    about = {"OBJECT_NAME": object_name, "OBJECT_ID": object_id, "CENTER_NAME": center, "REF_FRAME": frame}
    return write_message("oem", "2.0", flown, file, epoch, about, states / 1e3)


@shortly
def read_oem(file: str | Path) -> Oem:
    """Return a CCSDS orbit ephemeris message: `times` (s, since the first), `states` (positions and velocities, m and m/s),
    the names in it, and the beginnings of its segments. Accelerations and covariances are skipped. Raise InputError if the
    file is none."""
    return read_message(file, parse_oem, "a CCSDS orbit ephemeris message")


def parse_oem(path: Path) -> Oem:
    """Return the orbit of a message. All segments are read; they must have the same object and frame and follow each other
    without a gap. Raise OSError, or ValueError with the line and its error."""
    lines = Lines(read_text(path))
    version = lines.value("CCSDS_OEM_VERS")
    if version not in VERSIONS:
        raise ValueError(f"line {lines.number}: CCSDS_OEM_VERS = {version}, of which {', '.join(VERSIONS)} are read")
    list(lines.before("META_START"))
    instants, rows, begins = list[int](), list[list[float]](), list[int]()
    about, more = dict[str, str](), True
    while more:
        number = lines.number
        metadata = dict(lines.pair(line) for line in lines.before("META_STOP"))
        for key in NEEDED:
            if key not in metadata:
                raise ValueError(f"no {key}")
            if metadata[key] != about.setdefault(key, metadata[key]):
                raise ValueError(f"line {number}: a segment of {key} = {metadata[key]}, after one of {about[key]}")
        times_here, states, more = _segment(lines)
        if instants and times_here[0] != instants[-1]:
            ends = f"a segment from {stamp_of(times_here[0])} on, after one that ends at {stamp_of(instants[-1])}"
            raise ValueError(f"line {number}: {ends}: each has to begin where the one before ends")
        begins.append(len(rows))
        instants, rows = instants + times_here, rows + states
    times = np.array([(instant - instants[0]) / SECOND for instant in instants])
    name, center, frame, system = (about[key] for key in NEEDED)
    return Oem(times, 1e3 * np.array(rows), stamp_of(instants[0]), name, center, frame, system, tuple(begins))


def _segment(lines: Lines) -> tuple[list[int], list[list[float]], bool]:
    """Return the instants (ns) and states (km, km/s) of a segment, and whether another one follows. Raise ValueError for
    any other line, and for instants that do not increase."""
    instants, rows, more = list[int](), list[list[float]](), False
    while (line := lines.following()) is not None:
        more = line == "META_START"
        if more:
            break
        if line == "COVARIANCE_START":
            list(lines.before("COVARIANCE_STOP"))
            continue
        instant, numbers = lines.row(line, (6, 9))
        if not all(map(isfinite, numbers)):
            raise ValueError(f"line {lines.number}: a number that is not finite")
        instants.append(instant)
        rows.append(numbers[:6])
    if len(rows) < 2:
        raise ValueError(f"{len(rows)} states")
    for earlier, later in pairwise(instants):
        if later <= earlier:
            raise ValueError(f"the epoch {stamp_of(later)} after {stamp_of(earlier)}")
    return instants, rows, more
