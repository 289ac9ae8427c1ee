"""Stores a chunk as one Parquet file: its rows as columns, its counts and extremes in the schema's metadata.

A missing number (NaN) is stored as null, so that every reader of Parquet omits it from averages. Only the counts are
compressed, because results are random in nearly all of their bits.
"""

import json
import zlib
from base64 import b64decode, b64encode
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from starhold.campaign.chunk import Chunk, Counts, Extremes
from starhold.campaign.extras import extra

FINGERPRINT, LAW, FIRST, COUNTS, EXTREMES = (
    f"starhold.{key}" for key in ("fingerprint", "law", "first", "counts", "extremes")
)
"""Keys of the file's metadata."""


def encode(chunk: Chunk, fingerprint: str) -> bytes:
    """Return the bytes of a chunk's file. fingerprint: that of the campaign's manifest."""
    pyarrow, parquet = extra("pyarrow"), extra("pyarrow.parquet")
    table = pyarrow.table({name: _to_arrow(values, pyarrow) for name, values in chunk.rows.items()})
    words = [name for name, values in chunk.rows.items() if _is_text(values)]
    sink = pyarrow.BufferOutputStream()
    form = {"compression": "none", "use_dictionary": words, "write_statistics": ["run"], "store_schema": False}
    with parquet.ParquetWriter(sink, table.schema, **form) as writer:
        writer.write_table(table, row_group_size=max(chunk.count, 1))
        whose = {FINGERPRINT: fingerprint, LAW: chunk.law, FIRST: str(chunk.first)}
        writer.add_key_value_metadata({**whose, COUNTS: _pack(chunk.counts), EXTREMES: _pack(chunk.extremes)})
    return sink.getvalue().to_pybytes()


def belongs(path: Path, law: str, first: int, count: int, fingerprint: str) -> bool:
    """Return whether a file holds exactly these runs of this law in the campaign of this fingerprint."""
    rows, metadata = extra("pyarrow.parquet").read_metadata(path).num_rows, _metadata(path)
    return (rows, metadata.get(LAW), metadata.get(FIRST), metadata.get(FINGERPRINT)) == (count, law, str(first), fingerprint)


def names(path: Path) -> tuple[str, ...]:
    """Return the names of a file's columns in order."""
    return tuple(extra("pyarrow.parquet").read_schema(path).names)


def read(path: Path, columns: list[str]) -> dict[str, NDArray[Any]]:
    """Return some of the columns by name, as stored, without reading the others."""
    with extra("pyarrow.parquet").ParquetFile(path) as file:
        table = file.read(columns, use_threads=False)
        return {name: table.column(name).to_numpy() for name in columns}


def added_up(path: Path) -> tuple[Counts, Extremes]:
    """Return the counts and the extremes of the chunk in a file."""
    metadata = _metadata(path)
    return cast(Counts, _unpack(metadata[COUNTS])), cast(Extremes, _unpack(metadata[EXTREMES]))


def _metadata(path: Path) -> dict[str, str]:
    metadata = extra("pyarrow.parquet").read_metadata(path).metadata or {}
    return {key.decode(): value.decode() for key, value in metadata.items()}


def _is_text(values: NDArray[Any]) -> bool:
    return values.dtype.kind in "OU"


def _to_arrow(values: NDArray[Any], pyarrow: Any) -> Any:
    if _is_text(values):
        return pyarrow.array(values.tolist(), type=pyarrow.string())
    return pyarrow.array(values, from_pandas=True)


def _pack(arrays: dict[str, NDArray[Any]]) -> str:
    """Return arrays as text: JSON with their shapes and their compressed bytes in base 64."""
    shapes: dict[str, tuple[str, list[int]]] = {}
    parts: list[bytes] = []
    for name, values in sorted(arrays.items()):
        # Counts of a chunk are small: most of their 8 bytes are zeros, which are cheaper to drop than to compress.
        small = values.dtype.kind == "i" and values.min(initial=0) >= 0
        stored = values.astype((np.min_scalar_type(values.max(initial=0)) if small else values.dtype).newbyteorder("<"))
        shapes[name] = (stored.dtype.str, list(values.shape))
        parts.append(stored.tobytes())
    packed = b64encode(zlib.compress(b"".join(parts), 1)).decode()
    return f"{json.dumps(shapes)}\n{packed}"


def _unpack(text: str) -> dict[str, NDArray[Any]]:
    head, _, packed = text.partition("\n")
    stored, start = zlib.decompress(b64decode(packed)), 0
    arrays: dict[str, NDArray[Any]] = {}
    for name, (kind, shape) in json.loads(head).items():
        size = int(np.prod(shape, dtype=int))
        values = np.frombuffer(stored, kind, size, start).reshape(shape)
        start += values.nbytes
        arrays[name] = values.astype(float if values.dtype.kind == "f" else np.int64)
    return arrays
