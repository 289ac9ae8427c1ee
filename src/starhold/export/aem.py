"""CCSDS attitude ephemeris messages (AEM), written and read in keyword = value form.

Versions 1.0 (CCSDS 504.0-B-1) and 2.0 (504.0-B-2). The quaternion Q1 Q2 Q3 QC of a message has its scalar last, and rotates
REF_FRAME_A into REF_FRAME_B with the convention of `starhold.algebra.quaternion`: a vector's components in A become those in
B."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping
from datetime import UTC, date, datetime, timedelta
from itertools import pairwise
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.quaternion import conjugate, multiply
from starhold.errors import InputError, expect, shortly
from starhold.files import read_text, write_text
from starhold.parts.epoch import OF_DATE, OF_J2000, Date, date_of, days_of, precession

if TYPE_CHECKING:
    import xarray as xr

BODY = "SC_BODY"
"""The prefix of the names of spacecraft-fixed frames."""
OFF_UNIT = 1e-3
"""The largest deviation of a quaternion's length from 1 that counts as rounding."""
VALUES = {"QUATERNION": 4, "QUATERNION/DERIVATIVE": 8, "QUATERNION/RATE": 7, "QUATERNION/ANGVEL": 7}
"""The attitude types that are read, and the count of numbers in a line; all except the quaternion are skipped."""
NAME = re.compile(r"[ -~]*[!-~][ -~]*")
_Message = TypeVar("_Message")
_EPOCH = re.compile(r"(\d{4})-(?:(\d{2})-(\d{2})|(\d{3}))T(\d{2}):(\d{2}):(\d{2})(?:\.(\d*))?Z?")
SECOND = 10**9
"""Nanoseconds in a second; instants are counted in ns."""
UNDATED = "2000-01-01T12:00:00"
"""The default epoch of a run."""
WORD = "a word that a CCSDS message may hold"


def from_date(attitudes: Any, epoch: Date, back: bool = False) -> NDArray[np.float64]:
    """Return attitudes (n, 4) relative to the mean equator and equinox of date as attitudes relative to those of J2000
    (EME2000); back: the reverse."""
    turn = precession(days_of(epoch))
    turned: Any = multiply(conjugate(turn) if back else turn, tuple(np.asarray(attitudes, dtype=float).T))
    return np.stack(turned, axis=1)


class Aem(NamedTuple):
    """The attitudes of a message: the epoch of the first, times (n,) in s since then, quaternions (n, 4), scalar first,
    from the reference frame to the body frame, and the names of the object, the frame and the time system."""

    times: NDArray[np.float64]
    attitudes: NDArray[np.float64]
    epoch: str
    object_name: str
    frame: str
    time_system: str


@shortly
def export_aem(
    run: xr.Dataset | str | Path,
    file: str | Path,
    *,
    epoch: str | None = None,
    object_name: str = "SPACECRAFT",
    object_id: str = "0000-000A",
    frame: str = OF_J2000,
    version: Literal["1.0", "2.0"] = "2.0",
) -> Path:
    """Write the attitudes of a run as a CCSDS attitude ephemeris message, and return its path.

    run: what `simulate` returns, a run.nc or the folder of one. epoch: UTC at the start of the run, by default that of the
    scenario's [orbit], else 2000-01-01T12:00:00. frame: "EME2000", to which the attitudes of a run in axes of date
    (MOD_EARTH) are converted; any other name is taken as the name of the inertial axes. The quaternions rotate the frame
    into the body axes, scalar last. Raise InputError for a run without attitudes, a word that does not fit, and a file that
    cannot be written."""
    flown: Any = open_run(run)
    if "attitude" not in flown:
        raise InputError("export aem", "", "a run without attitudes", "one of a rigid body")
    attitudes = flown["attitude"].to_numpy()
    if flown.attrs.get("frame") == OF_DATE and frame == OF_J2000:
        attitudes = from_date(attitudes, date_of(flown.attrs["epoch"]))
    if version not in ("1.0", "2.0"):
        raise InputError("export aem", "", f"version {version}, which is neither 1.0 nor 2.0", WORD)
    about = {"OBJECT_NAME": object_name, "OBJECT_ID": object_id, "REF_FRAME_A": frame, "REF_FRAME_B": f"{BODY}_1"}
    kind = {"ATTITUDE_TYPE": "QUATERNION"}
    if version == "1.0":
        about["ATTITUDE_DIR"], kind["QUATERNION_TYPE"] = "A2B", "LAST"
    return write_message("aem", version, flown, file, epoch, about, np.roll(attitudes, -1, axis=1), kind)


def open_run(place: Any) -> Any:
    """Return a Dataset as it is, or the contents of a run.nc, or of that in a folder. Raise InputError if there is none."""
    if hasattr(place, "data_vars"):
        return place
    import xarray as xr

    expect(place, (str, Path), "run", "a run of sh.simulate, a run.nc, or the folder of one")
    path = Path(place) / "run.nc" if Path(place).is_dir() else Path(place)
    try:
        return xr.load_dataset(path, engine="h5netcdf")
    except OSError as error:
        raise InputError(str(path), "", error.strerror or "no netCDF-4 file", "a run.nc, or the folder of one") from None


def write_message(
    kind: str, version: str, run: Any, file: str | Path, epoch: str | None, about: dict[str, str], table: Any,
    more: Mapping[str, str] = MappingProxyType({}),
) -> Path:  # fmt: skip
    """Write a message of one segment about the samples of a run, one row of the table each, and return its path. epoch: that
    of the run if None; about, more: metadata before and after the time span. Raise InputError for fewer than two different
    times, for a word that a message cannot contain, and for a file that cannot be written."""
    try:
        begun = instant_of(run.attrs.get("epoch", UNDATED) if epoch is None else epoch)
        for text in about.values():
            if not NAME.fullmatch(text):
                raise ValueError(f"{text!r}, which is no line of printable ASCII")
        stamps = [stamp_of(begun + round(float(time) * SECOND)) for time in run["time"].to_numpy()]
        if len(set(stamps)) < max(len(stamps), 2):
            raise ValueError("fewer than two different times")
    except ValueError as error:
        raise InputError(f"export {kind}", "", str(error), WORD) from None
    span = {"TIME_SYSTEM": "UTC", "START_TIME": stamps[0], "STOP_TIME": stamps[-1]}
    metadata = [f"{key} = {value}" for key, value in {**about, **span, **more}.items()]
    rows = [
        " ".join([stamp, *map(repr, row)])
        for stamp, row in zip(stamps, np.asarray(table, dtype=float).tolist(), strict=True)
    ]
    rows = ["DATA_START", *rows, "DATA_STOP"] if kind == "aem" else rows
    made = [f"CREATION_DATE = {datetime.now(UTC):%Y-%m-%dT%H:%M:%S}", "ORIGINATOR = STARHOLD"]
    head = [f"CCSDS_{kind.upper()}_VERS = {version}", *made, "", "META_START", *metadata, "META_STOP", ""]
    write_text(Path(file), "\n".join([*head, *rows, ""]))
    return Path(file)


def read_message(file: str | Path, parse: Callable[[Path], _Message], kind: str) -> _Message:
    """Return a message of a kind, read by its function. Raise InputError if it cannot be read."""
    expect(file, (str, Path), "message", "the name of a file")
    try:
        return parse(Path(file))
    except OSError as error:
        raise InputError(str(file), "", f"{error.strerror}", "a file that can be read") from None
    except ValueError as error:
        raise InputError(str(file), "", str(error), kind) from None


@shortly
def read_aem(file: str | Path) -> Aem:
    """Return a CCSDS attitude ephemeris message of one segment: `times` (s, since the first), `attitudes` (scalar first,
    from the reference frame to the body axes), and the names in it. Raise InputError if the file is none."""
    return read_message(file, parse_aem, "a CCSDS attitude ephemeris message")


def parse_aem(path: Path) -> Aem:
    """Return the attitudes of a message of one segment. Raise OSError, or ValueError with the line and its error."""
    lines = Lines(read_text(path))
    version = lines.value("CCSDS_AEM_VERS")
    if version not in ("1.0", "2.0"):
        raise ValueError(f"line {lines.number}: CCSDS_AEM_VERS = {version}, of which 1.0 and 2.0 are read")
    list(lines.before("META_START"))
    metadata = dict(lines.pair(line) for line in lines.before("META_STOP"))
    list(lines.before("DATA_START"))
    count = _numbers(metadata)
    rows = [lines.attitude(line, count) for line in lines.before("DATA_STOP")]
    if lines.following() is not None:
        raise ValueError(f"line {lines.number}: a second segment; only messages of one segment are read")
    if len(rows) < 2:
        raise ValueError(f"{len(rows)} attitudes")
    instants, table = [row[0] for row in rows], np.array([row[1] for row in rows])
    for earlier, later in pairwise(instants):
        if later <= earlier:
            raise ValueError(f"the epoch {stamp_of(later)} after {stamp_of(earlier)}")
    # In version 1.0 the scalar part may come first.
    first = metadata.get("QUATERNION_TYPE") == "FIRST"
    attitudes = table if first else np.roll(table, 1, axis=1)
    frame = metadata["REF_FRAME_A"]
    if (metadata.get("ATTITUDE_DIR") == "B2A") != frame.startswith(BODY):
        attitudes = attitudes * np.array([1.0, -1.0, -1.0, -1.0])
    times = np.array([(instant - instants[0]) / SECOND for instant in instants])
    name = metadata["REF_FRAME_B"] if frame.startswith(BODY) else frame
    return Aem(times, attitudes, stamp_of(instants[0]), metadata["OBJECT_NAME"], name, metadata["TIME_SYSTEM"])


def _numbers(metadata: dict[str, str]) -> int:
    """Return the count of numbers in a line of data. Raise ValueError for a type that is not read."""
    for key in ("OBJECT_NAME", "REF_FRAME_A", "REF_FRAME_B", "TIME_SYSTEM", "ATTITUDE_TYPE"):
        if key not in metadata:
            raise ValueError(f"no {key}")
    allowed = {"ATTITUDE_DIR": ("A2B", "B2A"), "QUATERNION_TYPE": ("FIRST", "LAST"), "ATTITUDE_TYPE": tuple(VALUES)}
    for key, words in allowed.items():
        if key in metadata and metadata[key] not in words:
            raise ValueError(f"{key} = {metadata[key]}, of which {', '.join(words)} are read")
    frames = metadata["REF_FRAME_A"], metadata["REF_FRAME_B"]
    if sum(frame.startswith(BODY) for frame in frames) != 1:
        raise ValueError(f"frames {' and '.join(frames)}, of which one is to be {BODY}_…")
    return VALUES[metadata["ATTITUDE_TYPE"]]


class Lines:
    """The lines of a message that are neither empty nor comments, in order; `number` is that of the last line read."""

    def __init__(self, text: str) -> None:
        self.number = 0
        self._left = iter(enumerate(text.splitlines(), 1))

    def following(self) -> str | None:
        """Return the next line, or None."""
        for number, raw in self._left:
            self.number, line = number, raw.strip()
            if line and not line.startswith("COMMENT"):
                return line
        return None

    def before(self, end: str) -> Iterator[str]:
        """Return the lines before a given one, which is skipped."""
        while (line := self.following()) != end:
            if line is None:
                raise ValueError(f"no {end}")
            yield line

    def value(self, key: str) -> str:
        """Return the value of the next line, which must have this key."""
        line = self.following() or ""
        name, sign, value = line.partition("=")
        if not sign or name.strip() != key:
            raise ValueError(f"line {max(self.number, 1)}: {line[:40]!r} in place of {key} = …")
        return value.strip()

    def pair(self, line: str) -> tuple[str, str]:
        """Return the key and the value of a line."""
        key, sign, value = line.partition("=")
        if not sign:
            raise ValueError(f"line {self.number}: {line!r} in place of key = value")
        return key.strip(), value.strip()

    def row(self, line: str, counts: tuple[int, ...]) -> tuple[int, list[float]]:
        """Return the instant (ns) and the numbers of a line, which must have one of these counts."""
        epoch, *cells = line.split()
        try:
            values, instant = [float(cell) for cell in cells], instant_of(epoch)
            if len(values) not in counts:
                raise ValueError(f"{len(values)} numbers behind the epoch, {' or '.join(map(str, counts))} are wanted")
        except ValueError as error:
            raise ValueError(f"line {self.number}: {error}") from None
        return instant, values

    def attitude(self, line: str, count: int) -> tuple[int, list[float]]:
        """Return the instant (ns) and the quaternion of a line of `count` numbers."""
        instant, values = self.row(line, (count,))
        length = math.hypot(*values[:4])
        if not abs(length - 1.0) <= OFF_UNIT:
            raise ValueError(f"line {self.number}: a quaternion of length {length:.6g}")
        return instant, values[:4]


def instant_of(epoch: str) -> int:
    """Return the nanoseconds from the year 1 to an epoch, with days of 86400 s. Raise ValueError if it is not an epoch."""
    match = _EPOCH.fullmatch(epoch)
    if match is None:
        raise ValueError(f"{epoch!r} in place of an epoch such as 2026-03-01T12:00:00")
    year, month, day, of_year, hour, minute, second, part = match.groups()
    when = date(int(year), int(month or 1), int(day or 1)) + timedelta(days=int(of_year or 1) - 1)
    if not (int(hour) < 24 and int(minute) < 60 and int(second) <= 60) or when.year != int(year):
        raise ValueError(f"{epoch!r}, which is no time of a day")
    seconds = 86400 * when.toordinal() + 3600 * int(hour) + 60 * int(minute) + int(second)
    return seconds * SECOND + int(f"{part or '0':0<9}"[:9])


def stamp_of(instant: int) -> str:
    """Return the epoch at an instant (ns since the year 1)."""
    seconds, part = divmod(instant, SECOND)
    days, second = divmod(seconds, 86400)
    clock = f"{second // 3600:02}:{second // 60 % 60:02}:{second % 60:02}"
    fraction = f".{part:09}".rstrip("0") if part else ""
    return f"{date.fromordinal(days).isoformat()}T{clock}{fraction}"
