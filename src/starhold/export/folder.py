"""Writes a law in C into a folder: header, source, self-test, the file that builds them, and a manifest."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from starhold.errors import InputError
from starhold.export import basilisk, cfs, fmu, fprime
from starhold.export.code import Code
from starhold.export.cost import Cost, measure
from starhold.export.proof import UNPROVED, Proof
from starhold.export.source import cmake, texts
from starhold.export.vectors import selftest, vectors
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


SHELLS: dict[str, Callable[[Code], Mapping[str, str | bytes]]] = {
    "basilisk": basilisk.files,
    "fmu": fmu.files,
    "cfs": cfs.files,
    "fprime": fprime.files,
}
"""What makes the files of a shell over the C, by its name."""


def shell_files(code: Code, shells: Iterable[str]) -> dict[str, str | bytes]:
    """Return the files of shells. InputError for an unknown one, and where a law does not fit one."""
    found: dict[str, str | bytes] = {}
    for shell in shells:
        if shell not in SHELLS:
            raise InputError("export c", "shell", shell, f"one of {', '.join(SHELLS)}")
        found |= SHELLS[shell](code)
    return found


def make_files(
    code: Code, scenario: str, law: str, proof: Proof = UNPROVED, more: Mapping[str, str | bytes] = MappingProxyType({})
) -> Exported:
    """Return the files of a law in C, `more` among them, and what compilers that are installed tell of them."""
    header, source = texts(code, scenario, law, proof)
    cases = vectors(code)
    files: dict[str, str | bytes] = {
        f"{code.name}.h": header,
        f"{code.name}.c": source,
        f"{code.name}_selftest.c": selftest(code, cases),
        "CMakeLists.txt": cmake(code.name),
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
