"""Writes a law in C into a folder: header, source, self-test, the file that builds them, and a manifest."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from starhold.errors import InputError
from starhold.export.code import Code
from starhold.export.cost import Cost, measure
from starhold.export.proof import UNPROVED, Proof
from starhold.export.shells import filled
from starhold.export.source import texts
from starhold.export.vectors import selftest_rows, vectors
from starhold.files import atomic_write
from starhold.version import __version__

MANIFEST = "export.json"
"""The file that lists the others; it is written last."""


@dataclass(frozen=True)
class Exported:
    """A law that was written as C: its code, what was proved, what it costs, and the files by name."""

    code: Code
    proof: Proof
    costs: tuple[Cost, ...]
    files: Mapping[str, str | bytes]
    steps: int
    """Of the self-test."""


def make_files(
    code: Code, scenario: str, law: str, proof: Proof = UNPROVED, more: Mapping[str, str | bytes] = MappingProxyType({})
) -> Exported:
    """Return the files of a law in C, `more` among them, and its costs by the installed compilers."""
    header, source = texts(code, scenario, law, proof)
    cases = vectors(code)
    files: dict[str, str | bytes] = {
        f"{code.name}.h": header,
        f"{code.name}.c": source,
        **filled("build", code, ROWS=selftest_rows(cases), COUNT=len(cases), INPUTS=max(1, len(cases[0].inputs))),
        **more,
    }
    return Exported(code, proof, tuple(measure(code, header, source)), files, len(cases))


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(str(folder), "", "", f"cannot be made: {error.strerror or error}") from None


def write(exported: Exported, folder: Path, scenario: str, law: str) -> None:
    """Write the files into an existing folder, each whole, the manifest last. InputError where one cannot be written."""
    for name, text in exported.files.items():
        if Path(name).parent != Path():
            _make(folder / Path(name).parent)
        with atomic_write(folder / name) as hidden:
            hidden.write_bytes(text.encode() if isinstance(text, str) else text)
    content = {
        "starhold_version": __version__,
        "scenario": scenario,
        "law": law,
        "name": exported.code.name,
        "period": exported.code.flight.loop.period,
        "certificate": {"file": exported.proof.file, "sha256": exported.proof.digest, "outcome": exported.proof.outcome},
        "operations_at_most": exported.code.work._asdict(),
        "measured": [cost._asdict() for cost in exported.costs],
        "files": list(exported.files),
    }
    with atomic_write(folder / MANIFEST) as hidden:
        hidden.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")
