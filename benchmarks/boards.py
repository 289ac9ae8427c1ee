"""Exported laws on other processors: instructions a call, and the bits of the simulation.

Each law is exported as a process, compiled for the machine and run by qemu as the law of its scenario. One flight is
compared with the simulation bit by bit; in a shorter one qemu runs an instruction at a time and lists them, and those
between the entry into the law's step and the return from it are counted, with all that it calls. Instructions are not
cycles: what a call costs in time depends on the processor's pipeline, caches and memory.

Run: python benchmarks/boards.py    (machines whose compiler or emulator is not installed are left out)
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Thread
from typing import Any

import numpy as np

import starhold as sh
from common import header, show
from starhold.export.code import make_code
from starhold.export.shells import shell_files
from starhold.export.source import texts
from starhold.link.process import fly_by_process
from starhold.scenario.building import build
from starhold.simulation.lane import fly

LAWS = {
    "lyapunov": ("three-laws", "lyapunov"),
    "nadir": ("cubesat-nadir", "lyapunov"),
    "mission": ("cubesat-mission", "mission"),
}
"""Names in C: scenario and law."""
MACHINES = {
    "ARMv7-A, VFPv4": ("arm", "arm-linux-gnueabihf-gcc", "-march=armv7-a", "-mfpu=vfpv4", "-mfloat-abi=hard"),
    "RISC-V, RV64GC": ("riscv64", "riscv64-linux-gnu-gcc"),
    "SPARC V9": ("sparc64", "sparc64-linux-gnu-gcc"),
}
FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-static")
STEPS, COUNTED = 2_000, 40


def compiled(name: str, loop: Any, compiler: str, *flags: str, folder: Path) -> Path:
    """The program of a law."""
    code = make_code(loop, name)
    text = texts(code, "benchmark", name)
    for place, content in {f"{name}.h": text.header, f"{name}.c": text.source, **shell_files(code, ["process"])}.items():
        (folder / place).write_text(str(content))
    sources = (f"{name}.c", f"{name}_process.c")
    subprocess.run([compiler, *FLAGS, *flags, "-o", "flight", *sources, "-lm"], cwd=folder, check=True)
    return folder / "flight"


def one_at_a_time(emulator: str) -> str:
    """The option with which an emulator runs one instruction at a time, which got another name in version 8.1."""
    shown = subprocess.run([emulator, "-help"], capture_output=True, text=True, check=False).stdout
    return "-one-insn-per-tb" if "one-insn-per-tb" in shown else "-singlestep"


def counts(lines: Iterator[str], step: str) -> Iterator[int]:
    """The instructions of each call of a step by what an emulator lists: the function's name ends each line, and the call
    is over when `main` goes on."""
    count = 0
    for line in lines:
        function = line.rsplit("] ", 1)[-1].strip()
        if function == step or count:
            if function == "main":
                yield count
                count = 0
            else:
                count += 1


@contextmanager
def counting(step: str, folder: Path) -> Iterator[tuple[Path, list[int]]]:
    """A pipe into which an emulator lists instructions, and what is counted there, complete at the end."""
    pipe, found = folder / "listed", list[int]()
    os.mkfifo(pipe)

    def read() -> None:
        with pipe.open(errors="replace") as lines:
            found.extend(counts(iter(lines), step))

    reader = Thread(target=read)
    reader.start()
    yield pipe, found
    reader.join()


def measured(name: str, machine: str) -> list[str]:
    """A row of the table."""
    qemu, compiler, *flags = MACHINES[machine]
    scenario = sh.load(LAWS[name][0])
    loop = build(scenario, scenario.pick(LAWS[name][1]))
    with tempfile.TemporaryDirectory() as made:
        flight = compiled(name, loop, compiler, *flags, folder=Path(made))
        flown, simulated = fly_by_process(f"qemu-{qemu} {flight}", loop, STEPS)[0], fly(loop, STEPS)[0]
        same = np.array_equal(flown.view(np.uint64), simulated.view(np.uint64))
        with counting(f"{name}_step", Path(made)) as (pipe, found):
            fly_by_process(f"qemu-{qemu} {one_at_a_time(f'qemu-{qemu}')} -d exec,nochain -D {pipe} {flight}", loop, COUNTED)
    version = re.search(r"(\S+)$", subprocess.run([compiler, "-dumpfullversion"], capture_output=True, text=True).stdout)
    assert version is not None
    assert len(found) == COUNTED + 1
    spread = [f"{number:.0f}" for number in (np.median(found), max(found))]
    return [", ".join(LAWS[name]), machine, f"gcc {version[1]}", *spread, "equal" if same else "DIFFER"]


def main() -> None:
    """Print the table."""
    print(header())
    there = [name for name, (qemu, gcc, *_) in MACHINES.items() if shutil.which(f"qemu-{qemu}") and shutil.which(gcc)]
    rows = [measured(name, machine) for name in LAWS for machine in there]
    show(["law", "machine", "compiler", "instructions a call", "at most", f"bits of {STEPS} steps"], rows)


if __name__ == "__main__":
    main()
