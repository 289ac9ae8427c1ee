"""The digest of a campaign's results: the same for any chunk size, order of writing and number of threads or workers."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from starhold.campaign.store import Store
from starhold.errors import InputError


def digest(store: Store, runs: int | None = None) -> str:
    """SHA-256, in hexadecimal, of the results: law by law in the manifest's order, column by column in the order of names,
    run by run; numbers as little-endian bytes, text as lengths and UTF-8; then counts and extremes. runs: the number of runs
    of each law, where fewer than planned are flown. InputError where a chunk is missing or one too many is stored."""
    wanted = store.manifest.runs if runs is None else runs
    whole = hashlib.sha256(b"starhold campaign 1\n")
    for law in store.manifest.laws:
        covered = 0
        for file in store.files(law):
            covered = file.last + 1 if file.first == covered else -1
        if covered != wanted:
            allowed = "all of them; --resume flies what is missing"
            raise InputError(str(store.folder), "", f"not {wanted} runs of {law}", allowed)
        for part in chain([_named(law, np.array(wanted))], _columns(store, law), _envelopes(store, law)):
            whole.update(part)
    return whole.hexdigest()


def _columns(store: Store, law: str) -> Iterator[bytes]:
    names = sorted(store.manifest.columns.get(law, ()))
    return map(_named, names, store.each_column(names, law))


def _envelopes(store: Store, law: str) -> Iterator[bytes]:
    counts, extremes = store.envelopes(law)
    for kind in (counts, extremes):
        yield from (_named(name, values) for name, values in sorted(kind.items()))


def _named(name: str, values: NDArray[Any]) -> bytes:
    """An array with its name, type and shape, so that no two different results give the same bytes."""
    kind = values.dtype.kind
    if kind in "OU":
        kind = "text"
        words = [str(word).encode() for word in values.tolist()]
        data = np.array([len(word) for word in words], "<i8").tobytes() + b"".join(words)
    else:
        if kind == "f":
            values = np.where(np.isnan(values), np.nan, values)
        data = values.astype(values.dtype.newbyteorder("<"), copy=False).tobytes()
    head = f"{len(name.encode())} {name} {kind} {values.shape} {len(data)}\n"
    return head.encode() + data
