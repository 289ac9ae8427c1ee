"""The manifest in a campaign's folder, which defines what is flown, and the comparison of two manifests."""

from __future__ import annotations

import hashlib
import json
import math
import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any, cast

import numpy as np

from starhold.errors import InputError
from starhold.scenario.checking import cut
from starhold.version import __version__

FILE = "manifest.json"
_LONGEST_VALUE = 60
_MISSING = object()
_KEYS = {"version": "starhold_version", "settings": "campaign"}
"""The fields whose keys in the file differ from their names, with these keys."""


@dataclass(frozen=True)
class Manifest:
    """The definition of a campaign. scenario, text: name and whole text of the scenario file. settings: everything else that
    determines results, as in a file: dispersions, requirements, sampling, and the hashes of other files that the scenario
    reads, but not the number of runs. laws: names of the laws in order; each flies all runs. runs, chunk: numbers of runs of
    each law and of a full chunk; results do not depend on `chunk`. seed: that of the draws. extensible: whether the draws of
    a run are the same for any number of runs, which is false for Latin hypercubes. columns: names of the columns of each
    law, known once its first chunk is stored. folder, allow_unstable: the folder to which file names in the text are
    relative, and whether gains known to be unstable are accepted; results depend on neither."""

    scenario: str
    text: str
    settings: Mapping[str, Any]
    laws: tuple[str, ...]
    runs: int
    chunk: int
    seed: int
    extensible: bool = True
    columns: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    version: str = __version__
    folder: str = ""
    allow_unstable: bool = False

    def determining(self) -> dict[str, Any]:
        """Everything on which results depend, by the keys that `difference` names."""
        settings = cast(dict[str, Any], plain(self.settings))
        settings.pop("runs", None)
        tables = _tables(self.text)
        others: dict[str, Any] = {"laws": list(self.laws), "seed": self.seed, "starhold_version": self.version}
        if not self.extensible:
            others["runs"] = self.runs
        return {"campaign": settings, "": tables, **others}

    def fingerprint(self) -> str:
        """The SHA-256, in hexadecimal, of everything on which results depend."""
        return hashlib.sha256(json.dumps(self.determining(), sort_keys=True).encode()).hexdigest()

    def to_json(self) -> str:
        """Return the manifest as the text of a JSON file."""
        content = {_KEYS.get(one.name, one.name): plain(getattr(self, one.name)) for one in fields(self)}
        content["fingerprint"] = self.fingerprint()
        return json.dumps({**content, "seal": _seal(content)}, indent=2, allow_nan=False) + "\n"

    @classmethod
    def from_json(cls, text: str, where: str) -> Manifest:
        """Return the manifest in a text. InputError where it holds none, or was changed since it was written."""
        try:
            data = json.loads(text)
            # A text with a valid seal has the types that were written.
            if data.pop("seal") != _seal(data) or not isinstance(data["folder"], str):
                raise InputError(where, "", "a file changed by hand", "the file as starhold wrote it")
            given = {one.name: data[_KEYS.get(one.name, one.name)] for one in fields(cls)}
            columns = {law: tuple(names) for law, names in given["columns"].items()}
            return cls(**given | {"laws": tuple(given["laws"]), "columns": columns})
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
            raise InputError(where, "", "no manifest of a campaign", "the file as starhold wrote it") from None

    def difference(self, old: Manifest) -> str | None:
        """Return the first difference from an older manifest that changes results, such as `campaign.seed: 2, was 1`, or
        None."""
        new, kept = self.determining(), old.determining()
        for key in dict.fromkeys((*new, *kept)):
            if sentence := difference(new.get(key, _MISSING), kept.get(key, _MISSING), key):
                return sentence
        return None


def plain(value: Any) -> Any:
    """Return a value converted to types of JSON; infinities, NaN and values of unknown types become text."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in cast(Mapping[Any, Any], value).items()}
    if isinstance(value, np.ndarray | np.generic):
        return plain(cast(Any, value).tolist())
    if isinstance(value, list | tuple):
        return [plain(item) for item in cast(list[Any], value)]
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value if value is None or isinstance(value, str | bool | int | float) else str(value)


def difference(new: Any, old: Any, key: str) -> str | None:
    """Return the first difference of two JSON values, with its dotted key; entries of lists count from 1."""
    if isinstance(new, dict) and isinstance(old, dict):
        mine, theirs = cast(dict[str, Any], new), cast(dict[str, Any], old)
        for name in dict.fromkeys((*mine, *theirs)):
            below = f"{key}.{_quoted(name)}" if key else _quoted(name)
            if sentence := difference(mine.get(name, _MISSING), theirs.get(name, _MISSING), below):
                return sentence
        return None
    if isinstance(new, list) and isinstance(old, list) and len(cast(list[Any], new)) == len(cast(list[Any], old)):
        pairs = zip(cast(list[Any], new), cast(list[Any], old), strict=True)
        sentences = (difference(mine, theirs, f"{key}[{number}]") for number, (mine, theirs) in enumerate(pairs, 1))
        return next((sentence for sentence in sentences if sentence), None)
    mine, theirs = _written(new), _written(old)
    if mine == theirs:
        return None
    # Of two long values, only the parts that differ are shown.
    pairs = zip(mine, theirs, strict=False)
    same = next((place for place, (a, b) in enumerate(pairs) if a != b), min(len(mine), len(theirs)))
    if same > _LONGEST_VALUE // 2:
        mine, theirs = (f"...{text[same - 10 :]}" for text in (mine, theirs))
    return f"{key}: {cut(mine, _LONGEST_VALUE)}, was {cut(theirs, _LONGEST_VALUE)}"


def _seal(content: Mapping[str, Any]) -> str:
    """Return the SHA-256, in hexadecimal, of a manifest's content without its folder, because a scenario may be moved."""
    sealed = {key: value for key, value in content.items() if key != "folder"}
    return hashlib.sha256(json.dumps(sealed, sort_keys=True).encode()).hexdigest()


def _tables(text: str) -> dict[str, Any]:
    """Return the tables of a scenario's text, without comments; its lines where it is not TOML."""
    try:
        tables = cast(dict[str, Any], plain(tomllib.loads(text)))
    except (ValueError, RecursionError):
        return {"line": text.splitlines()}
    campaign = tables.get("campaign")
    if isinstance(campaign, dict):
        # These are compared as validated numbers, so that writing out a default counts as no change.
        for key in ("runs", "seed"):
            cast(dict[str, Any], campaign).pop(key, None)
    return tables


def _quoted(name: str) -> str:
    return name if re.fullmatch(r"[\w-]+", name) else json.dumps(name, ensure_ascii=False)


def _written(value: Any) -> str:
    return "nothing" if value is _MISSING else json.dumps(value, ensure_ascii=False)
