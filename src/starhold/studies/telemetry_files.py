"""Files of telemetry as tables, and the mappings that say what their columns hold."""

from __future__ import annotations

import warnings
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from starhold.algebra.cosines import to_quaternion
from starhold.algebra.quantity import Quantity
from starhold.algebra.quaternion import conjugate, multiply
from starhold.errors import InputError, input_at, optional
from starhold.export.aem import open_run, parse_aem
from starhold.files import read_text
from starhold.laws.interface import Gain
from starhold.parts.epoch import OF_J2000
from starhold.scenario.checking import cut, nearest, read_toml, show, validate
from starhold.scenario.quantity import quantity
from starhold.scenario.tables import Flag, Table
from starhold.scenario.units import to_number
from starhold.studies.frames import run_frame

Array: TypeAlias = NDArray[np.float64]
SUFFIXES = {".csv": "csv", ".parquet": "parquet", ".aem": "aem", ".nc": "netcdf"}
LABELS = {"axis": ("x", "y", "z"), "quaternion": ("q0", "q1", "q2", "q3")}
DAY = 86400.0
UNIX_DAY = {"jd": 2440587.5, "mjd": 40587.0}
"""The first day of 1970 as a Julian date and as a modified one."""
GPS_EPOCH = 315964800.0
"""The beginning of GPS time, 1980 January 6, in s since 1970."""
_LEAPS = """1981-07 1982-07 1983-07 1985-07 1988-01 1990-01 1991-01 1992-07 1993-07 1994-07 1996-01 1997-07 1999-01 2006-01
2009-01 2012-07 2015-07 2017-01"""
LEAPS = np.array([np.datetime64(f"{month}-01", "s") for month in _LEAPS.split()]).astype(float)
"""UTC in s since 1970 from which on there is one leap second more since 1980 (IERS Bulletin C)."""
MOST_SHOWN = 200
"""Characters of a list of columns in an error."""
OFF_AXES = 1e-6
"""By how much a matrix between axes may fail to be orthogonal."""


class TimeTable(Table):
    """The column of times, its unit, and from when they count: the start of a run, the first sample, or absolutely."""

    column: str = "time"
    base: Literal["run", "first", "utc", "unix", "gps", "jd", "mjd"] = "run"
    unit: str = ""


class ColumnsTable(Table):
    """Columns that hold one quantity, in TELEMETRY or in another file beside it, and their unit if not SI. Of a quaternion:
    where its scalar stands, whether it turns the body to the reference, and that reference; axes: the matrix from the
    file's axes to the body's."""

    columns: tuple[str, ...] = ()
    file: str = ""
    unit: str = ""
    scalar: Literal["first", "last"] = "first"
    conjugate: Flag = False
    frame: Literal["", "EME2000"] = ""
    axes: Annotated[Any, *quantity(Gain("1", shape=(3, 3), spread=False, text="from the file's axes to the body's"))] = None


class MappingTable(Table):
    """How a file is read. missing: words for no number, besides nothing and nan; interval: from one row to the next."""

    kind: Literal["", "csv", "parquet", "aem", "netcdf"] = ""
    separator: str = ","
    missing: tuple[str, ...] = ()
    interval: Annotated[Any, *quantity(Gain("s", above=0.0, text="from one row to the next"))] = None
    time: TimeTable = TimeTable()
    columns: dict[str, ColumnsTable] = Field(default_factory=dict[str, ColumnsTable])


class MappingFile(Table):
    """A file with a mapping."""

    telemetry: MappingTable


def mapping_names() -> list[str]:
    """The names of the mappings that come with starhold."""
    return sorted(item.name.removesuffix(".toml") for item in _shipped().iterdir() if item.name.endswith(".toml"))


def _shipped() -> Any:
    return resources.files("starhold.studies") / "mappings"


def read_mapping(source: str | Path) -> MappingTable:
    """The mapping in a file, or one that comes with starhold, by its name. InputError for what is none."""
    where = str(source)
    try:
        text = (_shipped() / f"{where}.toml").read_text("utf-8") if where in mapping_names() else read_text(Path(where))
    except (OSError, UnicodeDecodeError) as error:
        given = getattr(error, "strerror", None) or "text in another encoding"
        raise InputError(where, "", given, f"a TOML file with a mapping, or {', '.join(mapping_names())}") from None
    return validate(MappingFile, read_toml(text, where), where, "").telemetry


def existing(source: Any) -> Any:
    """The name of telemetry itself. InputError where there is no such file or folder, before anything else is read."""
    if isinstance(source, str) and not Path(source).exists():
        raise InputError(str(source), "", "no file", "a file of telemetry")
    return source


def existing_mapping(source: Any) -> Any:
    """The name of a mapping itself. InputError where there is none, or none that can be read."""
    read_mapping(source)
    return source


def heads_of(name: str, meant: Quantity, size: int) -> tuple[str, ...]:
    """The columns of a quantity in a table that starhold writes: rate_x, attitude_q0, wheel_momentum_1, error_angle."""
    labels = LABELS.get(meant.dimension, tuple(str(k + 1) for k in range(size)))
    return tuple(f"{name}_{label}" for label in labels) if meant.dimension else (name,)


def table_of(source: Any, path: Path, mapping: MappingTable) -> tuple[Any, MappingTable]:
    """The table in a file, or of a Dataset, as a DataFrame, and the mapping completed by what such a file says itself."""
    import pandas as pd

    kind = mapping.kind or SUFFIXES.get(path.suffix.lower(), "netcdf" if path.is_dir() else "")
    if hasattr(source, "data_vars") or kind == "netcdf":
        return run_frame(source if hasattr(source, "data_vars") else open_run(path)), mapping
    if kind not in SUFFIXES.values():
        raise InputError(str(path), "", show(path.suffix), f"telemetry, {', '.join(SUFFIXES)}, or a kind in a mapping")
    if not path.is_file():
        raise InputError(str(path), "", "no file", "a file of telemetry")
    try:
        if kind == "aem":
            return _message(path, mapping)
        if kind == "parquet":
            return optional("pyarrow.parquet", "Parquet", "campaign").read_table(path).to_pandas(), mapping
        with warnings.catch_warnings():
            # A row longer than the heading is but warned of.
            warnings.simplefilter("error")
            words: dict[str, Any] = {"na_values": list(mapping.missing), "encoding": "utf-8-sig", "comment": "#"}
            words |= {"sep": mapping.separator, "skipinitialspace": True, "index_col": False, "low_memory": False}
            return pd.read_csv(path, float_precision="round_trip", **words), mapping
    except (OSError, ValueError, Warning) as error:
        raise InputError(str(path), "", getattr(error, "strerror", None) or str(error), f"a file of kind {kind}") from None


def _message(path: Path, mapping: MappingTable) -> tuple[Any, MappingTable]:
    """An attitude ephemeris message: its attitude, and times by its own time system."""
    import pandas as pd

    message = parse_aem(path)
    base = {"UTC": "unix", "GPS": "gps"}.get(message.time_system, "first")
    begun = np.datetime64(message.epoch, "ns").astype(float) * 1e-9 - (GPS_EPOCH if base == "gps" else 0.0)
    frame = pd.DataFrame({"time": begun + message.times} | dict(zip(LABELS["quaternion"], message.attitudes.T, strict=True)))
    says = {"frame": OF_J2000 if message.frame == OF_J2000 else "", "columns": LABELS["quaternion"]}
    wanted = mapping.columns or {"attitude": ColumnsTable()}
    columns = {name: column.model_copy(update=says) for name, column in wanted.items()}
    return frame, mapping.model_copy(update={"time": TimeTable.model_validate({"base": base}), "columns": columns})


def column_of(frame: Any, name: str, path: Path) -> Any:
    """A column of a table. InputError where it has none of this name."""
    if name not in frame:
        raise InputError(
            str(path), "", f"no column {name}", cut(nearest(name, [str(head) for head in frame.columns]), MOST_SHOWN)
        )
    return frame[name]


def numbers_in(column: Any, name: str, path: Path) -> Array:
    """The numbers of a column, (n,), NaN where there is none. InputError for a word."""
    import pandas as pd

    values: Any = pd.to_numeric(column, errors="coerce")
    words = np.flatnonzero(values.isna() & column.notna())
    if len(words):
        given = show(str(column.iloc[words[0]]))
        raise InputError(
            str(path), f"row {words[0] + 1}, {name}", given, "a number, or nothing; missing = [...] in a mapping"
        )
    values = values.to_numpy(dtype=float)
    return np.where(np.isfinite(values), values, np.nan)


def seconds_of(frame: Any, time: TimeTable, path: Path, where: str) -> Array:
    """Times (n,) in s since 1970, UTC by days of 86400 s, where they are absolute, else as they count; NaN where there is
    none."""
    import pandas as pd

    raw = column_of(frame, time.column, path)
    if time.base == "utc":
        stamps = pd.to_datetime(raw, utc=True, format="ISO8601", errors="coerce")
        words = np.flatnonzero(stamps.isna() & raw.notna())
        if len(words):
            given = show(str(raw.iloc[words[0]]))
            raise InputError(str(path), f"row {words[0] + 1}, {time.column}", given, "a date and time in ISO 8601")
        return (stamps - pd.Timestamp(0, tz="UTC")).dt.total_seconds().to_numpy()
    with input_at(where, "telemetry.time.unit", show(time.unit)):
        worth = to_number(f"1 {time.unit or ('d' if time.base in UNIX_DAY else 's')}", "s")
    values = numbers_in(raw, time.column, path)
    if time.base in UNIX_DAY:
        return (values - UNIX_DAY[time.base] * DAY / worth) * worth
    if time.base == "gps":
        utc = values * worth + GPS_EPOCH
        return utc - np.searchsorted(LEAPS + np.arange(1, len(LEAPS) + 1), utc, side="right")
    return values * worth


def values_of(frame: Any, name: str, column: ColumnsTable, known: tuple[Quantity, int], path: Path, where: str) -> Array:
    """The numbers (n, k) of a quantity, SI. InputError for columns or a unit that do not fit it."""
    meant, size = known
    key = f"telemetry.columns.{name}"
    if len(column.columns) != size:
        raise InputError(where, f"{key}.columns", f"{len(column.columns)} columns", f"{size} for {name}, {meant.text}")
    values = np.stack([numbers_in(column_of(frame, head, path), head, path) for head in column.columns], axis=1)
    if column.unit:
        with input_at(where, f"{key}.unit", show(column.unit)):
            values = values * to_number(f"1 {column.unit}", meant.unit)
    turned, attitude = column.axes, meant.dimension == "quaternion"
    if not attitude and (column.conjugate or column.scalar == "last" or column.frame):
        raise InputError(where, key, f"{meant.text}, which is no quaternion", "scalar, conjugate and frame for quaternions")
    if attitude:
        values = np.roll(values, 1, axis=1) if column.scalar == "last" else values
        values = np.stack(conjugate(tuple(values.T)), axis=1) if column.conjugate else values  # type: ignore[arg-type]
    if turned is None:
        return values
    matrix = np.array(turned, dtype=float)
    if np.abs(matrix @ matrix.T - np.eye(3)).max() > OFF_AXES or (attitude and np.linalg.det(matrix) < 0.0):
        raise InputError(where, f"{key}.axes", show(turned), "an orthogonal matrix, a rotation for a quaternion")
    if meant.dimension == "axis":
        return values @ matrix.T
    if not attitude:
        raise InputError(where, f"{key}.axes", f"{meant.text}, which is no vector", "axes for vectors and quaternions")
    return np.stack(multiply(tuple(values.T), to_quaternion(turned)), axis=1)  # type: ignore[arg-type]
