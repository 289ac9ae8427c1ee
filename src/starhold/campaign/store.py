"""The folder of a campaign: a manifest, and a Parquet file for each chunk, named by its runs and the hash of its bytes.

    manifest.json                                            what is flown
    runs/LAW/000000000-000016383.0123456789abcdef.parquet    one chunk
    campaign.json                                            digest and totals, once all is flown

Files get their names only when they are complete and on the disk, so a folder is valid at any instant.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from starhold.campaign import manifest as manifests
from starhold.campaign import parquet
from starhold.campaign.chunk import Chunk, Counts, Extremes, merge
from starhold.campaign.extras import extra
from starhold.campaign.manifest import Manifest
from starhold.errors import InputError
from starhold.files import atomic_write, claim, clear_unfinished, read_text

RUNS, TOTALS = "runs", "campaign.json"
MARKS = (manifests.FILE, TOTALS, RUNS)
"""Files and folders of which each marks the folder of a campaign."""
BESIDE = ("worst-*.toml", "recorded/*.nc", "report.html")
"""Further files of results in the folder."""
_MOST_BYTES = 2**25
"""Bytes of columns (8 per number) that are read at once where all columns are needed: each read opens all files again."""
_NAME = re.compile(r"(\d{9,})-(\d{9,})\.([0-9a-f]{16})\.parquet")


@dataclass(frozen=True)
class ChunkFile:
    """A file with the runs `first` to `last` of a law."""

    path: Path
    first: int
    last: int


class Store:
    """A campaign's folder, open for reading; after `create` or `resume` also for writing. notices: one line for each
    unusable chunk."""

    def __init__(self, folder: Path, manifest: Manifest, writing: bool = False) -> None:
        self.folder, self.manifest, self.notices = folder, manifest, list[str]()
        self._writing, self._fingerprint = writing, manifest.fingerprint()
        self._files: dict[str, list[ChunkFile]] = {}

    @classmethod
    def create(cls, folder: Path, manifest: Manifest, force: bool = False) -> Store:
        """Create a campaign in a folder, which is made if absent. InputError where it holds a campaign already, which
        `force` removes instead; where it cannot be written; and while another process writes there."""
        extra("pyarrow")
        try:
            folder.mkdir(parents=True, exist_ok=True)
            _claim(folder)
            marks = [mark for mark in MARKS if (folder / mark).exists()]
            if marks and not force:
                allowed = "another folder with -o, --force, or --resume"
                raise InputError(str(folder), "", f"a campaign already there ({marks[0]})", allowed)
            # They may belong to another command, or to the user.
            beside = [path for pattern in BESIDE for path in folder.glob(pattern)]
            if beside and not force:
                given = f"results already there ({beside[0].relative_to(folder)})"
                raise InputError(str(folder), "", given, "another folder with -o, or --force")
            _clear(folder)
        except OSError as error:
            raise InputError(
                str(folder), "", "", f"cannot write there: {error.strerror}; name another folder with -o"
            ) from None
        store = cls(folder, replace(manifest, columns={}), writing=True)
        store._write_manifest()
        return store

    @classmethod
    def open(cls, folder: Path) -> Store:
        """Open the campaign in a folder for reading; InputError where there is none."""
        extra("pyarrow")
        path = folder / manifests.FILE
        try:
            text = read_text(path)
        except (OSError, UnicodeDecodeError):
            raise InputError(str(folder), "", f"no {manifests.FILE}", "the folder of a campaign") from None
        return cls(folder, Manifest.from_json(text, str(path)))

    def resume(self, manifest: Manifest) -> Store:
        """Return this campaign opened for more runs, with the numbers of runs and of runs per chunk of the new manifest.
        InputError with the first difference where the new manifest would change results or has fewer runs, and while another
        process writes into the folder."""
        try:
            _claim(self.folder)
        except OSError as error:
            raise InputError(str(self.folder), "", "", f"cannot be written: {error.strerror}") from None
        # Read again: another process may have written before this one claimed the folder.
        old = Store.open(self.folder).manifest
        if difference := manifest.difference(old):
            raise InputError(
                str(self.folder),
                "",
                "",
                f"{difference}; resume the campaign unchanged, or start another one with another -o",
            )
        if manifest.runs < old.runs:
            raise InputError(str(self.folder), "", "", f"campaign.runs: {manifest.runs}, was {old.runs}; at least as many")
        self.manifest = replace(manifest, columns=old.columns)
        self._writing = True
        self._files.clear()
        self._write_manifest()
        return self

    def files(self, law: str) -> list[ChunkFile]:
        """Return the usable chunks of a law in the order of their runs.

        The first call compares the bytes of all chunks with their hashes and adds a line to `notices` for each unusable one,
        which a store open for writing removes."""
        if law not in self._files:
            kept: list[ChunkFile] = []
            for file in sorted(self._listed(law), key=lambda file: (file.first, file.last)):
                if reason := self._fault(file, law, kept):
                    self._reject(file, reason)
                else:
                    kept.append(file)
            self._files[law] = kept
        return self._files[law]

    def missing(self, law: str) -> list[tuple[int, int]]:
        """Return the first run and the number of runs of each block still to be flown for a law, none longer than a
        chunk."""
        blocks: list[tuple[int, int]] = []
        start, size, runs = 0, self.manifest.chunk, self.manifest.runs
        for first, last in [*((file.first, file.last) for file in self.files(law)), (runs, runs)]:
            while start < min(first, runs):
                # Split at multiples of the chunk size, so that a repaired campaign has the same files as any other.
                end = min(start - start % size + size, first, runs)
                blocks.append((start, end - start))
                start = end
            start = max(start, last + 1)
        return blocks

    def put(self, chunk: Chunk) -> None:
        """Write a chunk; after the return it survives a crash. InputError where the disk is full or fails. ValueError where
        its law, runs or columns do not belong to the campaign."""
        if not self._writing:
            raise ValueError("this store is open for reading only")
        file = self._fit(chunk)
        data = parquet.encode(chunk, self._fingerprint)
        folder = self.folder / RUNS / chunk.law
        digest = hashlib.sha256(data).hexdigest()[:16]
        path = folder / f"{file.first:09}-{file.last:09}.{digest}.parquet"
        try:
            # Totals without this chunk would be wrong.
            (self.folder / TOTALS).unlink(missing_ok=True)
            folder.mkdir(parents=True, exist_ok=True)
            # The manifest first, so that no chunk is stored whose columns are not in it.
            if chunk.law not in self.manifest.columns:
                self.manifest = replace(self.manifest, columns={**self.manifest.columns, chunk.law: tuple(chunk.rows)})
                self._write_manifest()
            _write(path, data)
        except OSError as error:
            raise InputError(str(path), "", "", f"cannot be written: {error.strerror}{_KEPT}") from None
        except InputError as error:
            raise InputError(error.where, error.key, error.given, error.allowed + _KEPT) from None
        kept = self.files(chunk.law)
        if all(other.path != path for other in kept):
            kept.append(replace(file, path=path))
            kept.sort(key=lambda file: file.first)

    def columns(self, names: Sequence[str], law: str) -> dict[str, NDArray[Any]]:
        """Return columns by name, with one element per stored run, in the order of runs.

        These columns and one chunk of them are in memory at once. InputError where the law has no such column."""
        self._check_known(names, law)
        files = self.files(law)
        whole: dict[str, NDArray[Any]] = {}
        start, total = 0, sum(file.last - file.first + 1 for file in files)
        for file in files:
            part = parquet.read(file.path, list(names))
            for name, values in part.items():
                if name not in whole:
                    whole[name] = np.empty(total, values.dtype)
                whole[name][start : start + len(values)] = values
            start += file.last - file.first + 1
        return whole or {name: np.empty(0) for name in names}

    def each_column(self, names: Sequence[str], law: str) -> Iterator[NDArray[Any]]:
        """Yield columns one by one, with only a few in memory. InputError as in `columns`."""
        width = max(1, _MOST_BYTES // (8 * self.manifest.runs))
        for start in range(0, len(names), width):
            group = names[start : start + width]
            columns = self.columns(group, law)
            for name in group:
                yield columns.pop(name)

    def row(self, law: str, run: int) -> dict[str, Any]:
        """Return the values of one run by column. InputError where this run of the law is not stored."""
        for file in self.files(law):
            if file.first <= run <= file.last:
                stored = parquet.read(file.path, list(parquet.names(file.path)))
                return {name: values[run - file.first] for name, values in stored.items()}
        raise InputError(str(self.folder), "", f"no run {run} of {law}", f"0 to {self.manifest.runs - 1}, once flown")

    def envelopes(self, law: str) -> tuple[Counts, Extremes]:
        """Return the merged counts and extremes of all stored runs of a law."""
        return merge(parquet.added_up(file.path) for file in self.files(law))

    def finish(self, digest: str, totals: Mapping[str, Any]) -> Path:
        """Write `campaign.json` with the digest (see `campaign.digest`), the number of stored runs of each law, and the
        totals; return its path."""
        runs = {law: sum(file.last - file.first + 1 for file in self.files(law)) for law in self.manifest.laws}
        content = {"digest": digest, "fingerprint": self._fingerprint, "runs": runs, **totals}
        path = self.folder / TOTALS
        _write(path, (json.dumps(manifests.plain(content), indent=2, allow_nan=False) + "\n").encode())
        return path

    def _listed(self, law: str) -> list[ChunkFile]:
        """Return the files whose names are those of chunks."""
        place = self.folder / RUNS / law
        matches = [(path, _NAME.fullmatch(path.name)) for path in (place.iterdir() if place.is_dir() else ())]
        return [ChunkFile(path, int(match[1]), int(match[2])) for path, match in matches if match]

    def _fault(self, file: ChunkFile, law: str, kept: list[ChunkFile]) -> str:
        """Return the reason why a chunk is unusable, or ""."""
        try:
            with file.path.open("rb") as source:
                digest = hashlib.file_digest(source, "sha256").hexdigest()[:16]
            if digest != file.path.name.split(".")[1]:
                return "its bytes were changed"
            if not parquet.belongs(file.path, law, file.first, file.last - file.first + 1, self._fingerprint):
                return "it is of another campaign or of other runs"
        except (OSError, ValueError) as error:
            return f"cannot be read: {error}"
        return "its runs are in another file too" if kept and file.first <= kept[-1].last else ""

    def _reject(self, file: ChunkFile, reason: str) -> None:
        runs = f"runs {file.first} to {file.last}"
        if not self._writing:
            self.notices.append(f"{file.path}: {reason}; {runs} are left out, --resume flies them again")
            return
        self.notices.append(f"{file.path}: {reason}; {runs} are flown again")
        try:
            file.path.unlink()
        except OSError as error:
            raise InputError(str(file.path), "", "", f"cannot be removed: {error.strerror}") from None

    def _fit(self, chunk: Chunk) -> ChunkFile:
        """Return the place of a chunk in this campaign; ValueError where it has none."""
        last = chunk.first + chunk.count - 1
        if chunk.law not in self.manifest.laws or not 0 <= chunk.first <= last < self.manifest.runs:
            raise ValueError(f"no part of this campaign: {chunk.law}, runs {chunk.first} to {last}")
        known = self.manifest.columns.get(chunk.law, tuple(chunk.rows))
        if set(known) != set(chunk.rows):
            raise ValueError(f"columns of {chunk.law} that not all chunks have: {sorted(set(known) ^ set(chunk.rows))}")
        if any(other.first <= last and chunk.first <= other.last for other in self.files(chunk.law)):
            raise ValueError(f"stored already: {chunk.law}, some of the runs {chunk.first} to {last}")
        return ChunkFile(self.folder, chunk.first, last)

    def _check_known(self, names: Sequence[str], law: str) -> None:
        if law not in self.manifest.laws:
            raise InputError(str(self.folder), "", f'law "{law}"', ", ".join(self.manifest.laws))
        known = self.manifest.columns.get(law, ())
        for name in names:
            if known and name not in known:
                raise InputError(str(self.folder), "", f'column "{name}"', ", ".join(known))

    def _write_manifest(self) -> None:
        _write(self.folder / manifests.FILE, self.manifest.to_json().encode())


_KEPT = "; what was computed is kept, --resume continues from there"


def _claim(folder: Path) -> None:
    """Lock the folder for writing by this process, and remove incomplete files of killed processes. OSError on failure."""
    try:
        claim(folder)
    except BlockingIOError:
        raise InputError(str(folder), "", "another starhold is writing there", "another folder with -o") from None
    clear_unfinished(folder)
    clear_unfinished(folder / RUNS)


def _clear(folder: Path) -> None:
    """Remove a campaign and nothing else; the manifest comes last, so that remains of the campaign can be recognized."""
    (folder / TOTALS).unlink(missing_ok=True)
    for pattern in BESIDE:
        for path in folder.glob(pattern):
            path.unlink()
    for path in (folder / RUNS).glob("*/*"):
        if _NAME.fullmatch(path.name):
            path.unlink()
    for place in (*(folder / RUNS).glob("*"), folder / RUNS):
        if place.is_dir() and not any(place.iterdir()):
            place.rmdir()
    (folder / manifests.FILE).unlink(missing_ok=True)


def _write(path: Path, data: bytes) -> None:
    """Write a file that gets its name only once it is complete and on the disk."""
    with atomic_write(path) as hidden, hidden.open("wb") as sink:
        sink.write(data)
        sink.flush()
        os.fsync(sink.fileno())
    _sync(path.parent)


def _sync(folder: Path) -> None:
    """Flush a folder's directory entry to the disk, where the system supports it."""
    if os.name != "posix":
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
