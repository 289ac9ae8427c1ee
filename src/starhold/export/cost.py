"""Measures the stack and flash of a step of a law with the compilers that are installed."""

from __future__ import annotations

import re
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import NamedTuple

from starhold.export.code import Code
from starhold.trace.program import Call, statements

COMPILERS = {
    "gcc": "this machine",
    "arm-none-eabi-gcc": "ARM",
    "arm-linux-gnueabihf-gcc": "ARMv7",
    "riscv64-linux-gnu-gcc": "RISC-V 64",
    "sparc64-linux-gnu-gcc": "SPARC V9",
    "sparc-gaisler-elf-gcc": "SPARC V8, LEON3",
}
"""Compilers that are asked, by name, and what they compile for."""
FLAGS = ("-std=c99", "-ffp-contract=off", "-O2", "-fno-math-errno")


class Cost(NamedTuple):
    """A compiler and what it compiles for; bytes of code and constants, and of stack that a step takes at the most, without
    those of the sqrt of a library where the processor has none."""

    compiler: str
    target: str
    flash: int
    stack: int


def measure(code: Code, header: str, source: str) -> list[Cost]:
    """Return the costs by each installed compiler; empty where there is none."""
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
    """Return the most stack of a path of calls; what is inlined has its bytes where it is."""
    frames: dict[str, int] = {}
    for line in usage.splitlines():
        name, size, *_ = line.split("\t")
        # Copies that the compiler made are called after the function, with a dot.
        title = re.sub(r"\..*", "", name.rpartition(":")[2])
        frames[title] = max(frames.get(title, 0), int(size))
    printed, deepest = code.printed, dict[str, int]()
    for name, function in printed.functions.items():
        called = {s.function.name for s in statements(function.body) if isinstance(s, Call)}
        title = f"{code.name}_step" if printed.is_main(function) else printed.titles[name]
        deepest[name] = frames.get(title, 0) + max([deepest[one] for one in called], default=0)
    return deepest[code.program.main.name]
