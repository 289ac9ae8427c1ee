"""Writes a law in C into a folder: header, source, self-test, build file and manifest."""

import json
import re
import shutil
import subprocess
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

from starhold.errors import InputError
from starhold.export.code import Code
from starhold.export.shells import filled
from starhold.export.source import UNPROVED, Proof, texts
from starhold.export.vectors import selftest_rows, vectors
from starhold.files import atomic_write, write_text
from starhold.trace.program import Call, statements
from starhold.version import __version__

COMPILERS = {
    "gcc": "this machine",
    "arm-none-eabi-gcc": "ARM",
    "arm-linux-gnueabihf-gcc": "ARMv7",
    "riscv64-linux-gnu-gcc": "RISC-V 64",
    "sparc64-linux-gnu-gcc": "SPARC V9",
    "sparc-gaisler-elf-gcc": "SPARC V8, LEON3",
}
"""The compilers used to estimate costs, with their targets."""
FLAGS = ("-std=c99", "-ffp-contract=off", "-O2", "-fno-math-errno")


class Cost(NamedTuple):
    """A compiler and its target; bytes of code and constants, and the largest stack of a step, without the library's sqrt
    if the processor has none."""

    compiler: str
    target: str
    flash: int
    stack: int


def measure(code: Code, header: str, source: str) -> list[Cost]:
    """Return the costs for each installed compiler; empty if there is none."""
    return [cost for name in COMPILERS if (cost := _measured(name, code, header, source)) is not None]


def _measured(compiler: str, code: Code, header: str, source: str) -> Cost | None:
    sizer = compiler.removesuffix("gcc") + "size"
    if shutil.which(compiler) is None or shutil.which(sizer) is None:
        return None
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, f"{code.name}.h").write_text(header, encoding="utf-8")
        Path(folder, f"{code.name}.c").write_text(source, encoding="utf-8")
        built = _run(folder, compiler, *FLAGS, "-fstack-usage", "-c", f"{code.name}.c", "-o", "law.o")
        sized = _run(folder, sizer, "law.o") if built is not None else None
        usage = next(iter(Path(folder).glob("*.su")), None)
        if sized is None or usage is None:
            return None
        # The first line is a heading; code and constants are the first column.
        return Cost(compiler, COMPILERS[compiler], int(sized.splitlines()[1].split()[0]), _stack(code, usage.read_text()))


def _run(folder: str, *command: str) -> str | None:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    return done.stdout if done.returncode == 0 else None


def _stack(code: Code, usage: str) -> int:
    """Return the largest stack (bytes) over paths of calls; inlined functions count in their callers."""
    frames: dict[str, int] = {}
    for line in usage.splitlines():
        name, size, *_ = line.split("\t")
        # Copies made by the compiler are named after the function, with a dot.
        title = re.sub(r"\..*", "", name.rpartition(":")[2])
        frames[title] = max(frames.get(title, 0), int(size))
    printed, deepest = code.printed, dict[str, int]()
    for name, function in printed.functions.items():
        called = {s.function.name for s in statements(function.body) if isinstance(s, Call)}
        title = f"{code.name}_step" if printed.is_main(function) else printed.titles[name]
        deepest[name] = frames.get(title, 0) + max([deepest[one] for one in called], default=0)
    return deepest[code.program.main.name]


MANIFEST = "export.json"
"""The file that lists the others, written last."""


@dataclass(frozen=True)
class Exported:
    """An exported law: its code, its proofs, its costs, and the files by name."""

    code: Code
    proof: Proof
    costs: tuple[Cost, ...]
    files: Mapping[str, str | bytes]
    steps: int
    """The number of steps of the self-test."""


def make_files(
    code: Code, scenario: str, law: str, proof: Proof = UNPROVED, more: Mapping[str, str | bytes] = MappingProxyType({})
) -> Exported:
    """Return the files of a law in C, including `more`, and its costs for the installed compilers."""
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
    """Write the files into an existing folder, each atomically, the manifest last. Raise InputError if one fails."""
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
    write_text(folder / MANIFEST, json.dumps(content, indent=2) + "\n")
