"""Reads files of telemetry as tables, and the mappings that define their columns."""

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
"""The start of 1970 as a Julian date and as a modified Julian date."""
GPS_EPOCH = 315964800.0
"""The beginning of GPS time, 1980 January 6, in s since 1970."""
_LEAPS = """1981-07 1982-07 1983-07 1985-07 1988-01 1990-01 1991-01 1992-07 1993-07 1994-07 1996-01 1997-07 1999-01 2006-01
2009-01 2012-07 2015-07 2017-01"""
LEAPS = np.array([np.datetime64(f"{month}-01", "s") for month in _LEAPS.split()]).astype(float)
"""The UTC times (s since 1970) after which there is one more leap second since 1980 (IERS Bulletin C)."""
MOST_SHOWN = 200
"""The most characters of a list of columns in an error."""
OFF_AXES = 1e-6
"""The largest deviation from orthogonality of a matrix between axes."""


class TimeTable(Table):
    """The column of times, its unit, and its origin: the start of a run, the first sample, or an absolute epoch."""

    column: str = "time"
    base: Literal["run", "first", "utc", "unix", "gps", "jd", "mjd"] = "run"
    unit: str = ""


class ColumnsTable(Table):
    """The columns of one quantity, in TELEMETRY or in another file beside it, and their unit if not SI. For a quaternion:
    the position of its scalar, whether it is conjugate (rotates the body to the reference frame), and the reference frame;
    axes: the matrix from the file's axes to the body's."""

    columns: tuple[str, ...] = ()
    file: str = ""
    unit: str = ""
    scalar: Literal["first", "last"] = "first"
    conjugate: Flag = False
    frame: Literal["", "EME2000"] = ""
    axes: Annotated[
        Any, *quantity(Gain("1", shape=(3, 3), spread=False, text="matrix from the file's axes to the body's"))
    ] = None


class MappingTable(Table):
    """The mapping of a file. missing: words for a missing number, besides an empty cell and nan; interval: between rows."""

    kind: Literal["", "csv", "parquet", "aem", "netcdf"] = ""
    separator: str = ","
    missing: tuple[str, ...] = ()
    interval: Annotated[Any, *quantity(Gain("s", above=0.0, text="time between rows"))] = None
    time: TimeTable = TimeTable()
    columns: dict[str, ColumnsTable] = Field(default_factory=dict[str, ColumnsTable])


class MappingFile(Table):
    """The contents of a mapping file."""

    telemetry: MappingTable


def mapping_names() -> list[str]:
    """Return the names of the built-in mappings."""
    return sorted(item.name.removesuffix(".toml") for item in _shipped().iterdir() if item.name.endswith(".toml"))


def _shipped() -> Any:
    return resources.files("starhold.studies") / "mappings"


def read_mapping(source: str | Path) -> MappingTable:
    """Return the mapping in a file, or the built-in one of this name. InputError where it is not a mapping."""
    where = str(source)
    try:
        text = (_shipped() / f"{where}.toml").read_text("utf-8") if where in mapping_names() else read_text(Path(where))
    except (OSError, UnicodeDecodeError) as error:
        given = getattr(error, "strerror", None) or "text in another encoding"
        raise InputError(where, "", given, f"a TOML file with a mapping, or {', '.join(mapping_names())}") from None
    return validate(MappingFile, read_toml(text, where), where, "").telemetry


def existing(source: Any) -> Any:
    """Return the name of telemetry unchanged. InputError, before anything else is read, if no such file or folder exists."""
    if isinstance(source, str) and not Path(source).exists():
        raise InputError(str(source), "", "no file", "a file of telemetry")
    return source


def existing_mapping(source: Any) -> Any:
    """Return the name of a mapping unchanged. InputError where there is none, or it cannot be read."""
    read_mapping(source)
    return source


def heads_of(name: str, meant: Quantity, size: int) -> tuple[str, ...]:
    """Return the columns of a quantity in starhold's tables, such as rate_x, attitude_q0, wheel_momentum_1, error_angle."""
    labels = LABELS.get(meant.dimension, tuple(str(k + 1) for k in range(size)))
    return tuple(f"{name}_{label}" for label in labels) if meant.dimension else (name,)


def table_of(source: Any, path: Path, mapping: MappingTable) -> tuple[Any, MappingTable]:
    """Return the table in a file, or of a Dataset, as a DataFrame, and the mapping completed from the file's own header."""
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
            # For a row longer than the heading pandas would only warn.
            warnings.simplefilter("error")
            words: dict[str, Any] = {"na_values": list(mapping.missing), "encoding": "utf-8-sig", "comment": "#"}
            words |= {"sep": mapping.separator, "skipinitialspace": True, "index_col": False, "low_memory": False}
            return pd.read_csv(path, float_precision="round_trip", **words), mapping
    except (OSError, ValueError, Warning) as error:
        raise InputError(str(path), "", getattr(error, "strerror", None) or str(error), f"a file of kind {kind}") from None


def _message(path: Path, mapping: MappingTable) -> tuple[Any, MappingTable]:
    """Return the attitude in an attitude ephemeris message, and the mapping with its time system."""
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
    """Return the column of a table with this name. InputError where there is none."""
    if name not in frame:
        raise InputError(
            str(path), "", f"no column {name}", cut(nearest(name, [str(head) for head in frame.columns]), MOST_SHOWN)
        )
    return frame[name]


def numbers_in(column: Any, name: str, path: Path) -> Array:
    """Return the numbers (n,) of a column, NaN where a number is missing. InputError for a word."""
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
    """Return times (n,) in s, NaN where missing: absolute ones since 1970, UTC with days of 86400 s, others unchanged."""
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
    """Return the numbers (n, k) of a quantity, SI. InputError where the columns or the unit do not fit it."""
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
        raise InputError(
            where, key, f"{meant.text}, which is not a quaternion", "scalar, conjugate and frame for quaternions"
        )
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
        raise InputError(where, f"{key}.axes", f"{meant.text}, which is not a vector", "axes for vectors and quaternions")
    return np.stack(multiply(tuple(values.T), to_quaternion(turned)), axis=1)  # type: ignore[arg-type]
