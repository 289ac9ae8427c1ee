"""Whatever runs a recorded program: plain Python, machine code for lanes, C by each compiler, JavaScript in node.

A `Subject` is an equation over buffers, counts and words. A `Job` is a program and what it is given; each machine gives what
its memories hold afterwards, by name. Where it costs much to start one, it takes many jobs at once.
"""

import ctypes
import json
import math
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import llvmlite.binding as llvm
import numpy as np
import pytest
from numpy.typing import NDArray

from starhold.algebra.operations import INDEX, WORD
from starhold.algebra.structured import Buffer
from starhold.trace.c99 import C99
from starhold.trace.javascript import JavaScript
from starhold.trace.machine import aligned, load, word
from starhold.trace.program import Memory, Program
from starhold.trace.recording import Recorder

Arrays: TypeAlias = Mapping[str, NDArray[np.float64]]
"""What memories hold, by name: (numbers,), or (numbers, lanes) for memories of lanes where there is more than one lane."""

COMPILERS = ("gcc", "clang")
MACHINES = ("lane", "lanes", *COMPILERS, "node")
LEVELS = (("-O0",), ("-O3", "-march=native"))
STRICT = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-ffp-contract=off"]
MASK = (1 << 64) - 1


class Job(NamedTuple):
    """A program, what its memories hold, and its counts and words by name."""

    program: Program
    memories: Arrays
    inputs: Mapping[str, int]


class Subject(NamedTuple):
    """An equation that is given buffers of these memories, then counts and words of these kinds, and last the number of the
    lane."""

    equation: Callable[..., Any]
    memories: tuple[Memory, ...]
    inputs: Mapping[str, str]

    def program(self, name: str = "run") -> Program:
        """Its recording."""
        recorder = Recorder()
        cells = [recorder.memory(m.name, lanes=m.lanes, writable=m.writable, size=m.size) for m in self.memories]
        buffers = [Buffer(c, 0, m.size) for c, m in zip(cells, self.memories, strict=True)]
        inputs = [recorder.input(given, kind) for given, kind in self.inputs.items()]
        with recorder.recording():
            self.equation(*buffers, *inputs, recorder.lane())
        return recorder.program(name)

    def plain(self, memories: Arrays, inputs: Mapping[str, int], lane: int = 0) -> dict[str, NDArray[np.float64]]:
        """What plain Python leaves of the memories of one lane."""
        cells = [memories[m.name].tolist() for m in self.memories]
        given = [inputs[name] & MASK if kind == WORD else inputs[name] for name, kind in self.inputs.items()]
        self.equation(*map(Buffer, cells), *given, lane)
        return {m.name: np.array(c) for m, c in zip(self.memories, cells, strict=True)}


def column(program: Program, memories: Arrays, lane: int) -> dict[str, NDArray[np.float64]]:
    """What the memories of one of many lanes hold."""
    return {m.name: memories[m.name][:, lane] if m.lanes else memories[m.name] for m in program.memories}


def agree(machine: str, *cases: tuple[Subject, Arrays, Mapping[str, int]]) -> None:
    """Assert that a machine leaves the bits that plain Python leaves; memories of lanes are given for 16 lanes.

    "lanes" is machine code for 8 and 16 lanes; the machines of one lane, "lane", a compiler and "node", are given the
    memories of the first four. Compilers run without and with optimisation. Skips where a machine is not installed.
    """
    if machine == "lanes":
        for subject, memories, inputs in cases:
            _agree_lanes(subject, memories, inputs)
        return
    jobs: list[Job] = []
    expected: list[dict[str, NDArray[np.float64]]] = []
    for subject, memories, inputs in cases:
        program = subject.program()
        for lane in range(4):
            jobs.append(Job(program, column(program, memories, lane), inputs))
            expected.append(subject.plain(jobs[-1].memories, inputs))
    if machine == "lane":
        found = {machine: [on_lanes(job) for job in jobs]}
    elif machine == "node":
        found = {machine: on_node(jobs)}
    else:
        found = {f"{machine} {' '.join(level)}": on_c(jobs, machine, *level) for level in LEVELS}
    for label, results in found.items():
        for want, have in zip(expected, results, strict=True):
            same(want, have, label)


def _agree_lanes(subject: Subject, memories: Arrays, inputs: Mapping[str, int]) -> None:
    program = subject.program()
    expected = [subject.plain(column(program, memories, lane), inputs, lane) for lane in range(16)]
    for width in (8, 16):
        part = {m.name: memories[m.name][:, :width] if m.lanes else memories[m.name] for m in program.memories}
        left = on_lanes(Job(program, part, inputs), width)
        for lane in range(width):
            same(expected[lane], column(program, left, lane), f"lane {lane} of {width}")


def same(expected: Arrays, found: Arrays, machine: str) -> None:
    """Assert that memories hold the same bits; any NaN equals any NaN."""
    for name, want in expected.items():
        differ = np.flatnonzero(bits(want) != bits(found[name]))
        assert not differ.size, (machine, name, differ[:8], want[differ[:8]], found[name][differ[:8]])


def bits(numbers: NDArray[np.float64]) -> NDArray[np.uint64]:
    """The bits of numbers, of every NaN the same."""
    return np.where(np.isnan(numbers), math.nan, numbers).view(np.uint64)


def need(name: str) -> None:
    """Skip the test where a machine is not installed."""
    if name not in ("lane", "lanes") and shutil.which(name) is None:
        pytest.skip(f"{name} is not installed")


_KERNELS: dict[tuple[int, int], tuple[Program, Callable[..., None]]] = {}


def on_lanes(job: Job, width: int = 1) -> dict[str, NDArray[np.float64]]:
    """Run machine code for so many lanes at once."""
    program = job.program
    key = (id(program), width)
    if key not in _KERNELS:
        if len(_KERNELS) >= 64:
            _KERNELS.clear()
        # The program stays, so that its number is not given to another.
        _KERNELS[key] = program, load(program, width)
    arrays: dict[str, NDArray[np.float64]] = {}
    for memory in program.memories:
        given = job.memories[memory.name]
        shape = (max(1, len(given)), width) if memory.lanes else (max(1, len(given)),)
        arrays[memory.name] = aligned(*shape)[: len(given)]
        arrays[memory.name][:] = given.reshape(arrays[memory.name].shape)
    pointers = [arrays[memory.name].ctypes.data for memory in program.memories]
    _KERNELS[key][1](*pointers, *(word(job.inputs[name]) for name, _ in program.main.params))
    return {name: array.reshape(job.memories[name].shape).copy() for name, array in arrays.items()}


def on_c(jobs: Sequence[Job], compiler: str, *flags: str) -> list[dict[str, NDArray[np.float64]]]:
    """Compile the programs as C, without a warning, and run them."""
    need(compiler)
    functions: dict[int, Any] = {}
    with tempfile.TemporaryDirectory() as folder:
        texts: dict[int, C99] = {}
        for job in jobs:
            if id(job.program) not in texts:
                texts[id(job.program)] = C99(renamed(job.program, f"program_{len(texts)}"))
        for text in texts.values():
            Path(folder, text.name).with_suffix(".c").write_text(str(text))
        files = [f"{text.name}.c" for text in texts.values()]
        command = [compiler, *STRICT, *flags, "-shared", "-fPIC", "-o", "all.so", *files, "-lm"]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
        assert done.returncode == 0, (command, done.stderr)
        library = ctypes.CDLL(str(Path(folder, "all.so")))
        for number, text in texts.items():
            functions[number] = library[text.name]
            kinds = {INDEX: ctypes.c_long, WORD: ctypes.c_uint64}
            pointers = [ctypes.c_void_p] * len(text.program.memories)
            functions[number].argtypes = pointers + [kinds[kind] for _, kind in text.program.main.params]
            functions[number].restype = None
    found: list[dict[str, NDArray[np.float64]]] = []
    for job in jobs:
        arrays = {name: np.array(array) for name, array in job.memories.items()}
        pointers = [arrays[memory.name].ctypes.data for memory in job.program.memories]
        functions[id(job.program)](*pointers, *(job.inputs[name] for name, _ in job.program.main.params))
        found.append(arrays)
    return found


def renamed(program: Program, name: str) -> Program:
    """The program, called otherwise."""
    return program._replace(functions=(*program.functions[:-1], program.main._replace(name=name)))


_NODE = """
const jobs = JSON.parse(require("fs").readFileSync(0, "utf8"));
const done = jobs.map(([program, memories, inputs]) => {
    const arrays = memories.map((hex) => {
        const bytes = Uint8Array.from(Buffer.from(hex, "hex"));
        return new Float64Array(bytes.buffer);
    });
    programs[program](...arrays, ...inputs);
    return arrays.map((array) => Buffer.from(array.buffer).toString("hex"));
});
process.stdout.write(JSON.stringify(done));
"""


def on_node(jobs: Sequence[Job]) -> list[dict[str, NDArray[np.float64]]]:
    """Run the programs as JavaScript, all in one process."""
    need("node")
    places: dict[int, int] = {}
    script = ["const programs = [];"]
    given: list[Any] = []
    for job in jobs:
        if id(job.program) not in places:
            places[id(job.program)] = len(places)
            text = JavaScript(job.program)
            script.append(f"programs.push((() => {{\n{text}\nreturn {text.name};\n}})());")
        memories = [np.ascontiguousarray(job.memories[memory.name]).tobytes().hex() for memory in job.program.memories]
        inputs = [_halves(job.inputs[name]) if kind == WORD else job.inputs[name] for name, kind in job.program.main.params]
        given.append((places[id(job.program)], memories, inputs))
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "run.js")
        file.write_text("\n".join([*script, _NODE]))
        done = subprocess.run(["node", str(file)], input=json.dumps(given), capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return [
        {m.name: np.frombuffer(bytes.fromhex(text)) for m, text in zip(job.program.memories, texts, strict=True)}
        for job, texts in zip(jobs, json.loads(done.stdout), strict=True)
    ]


def _halves(number: int) -> list[int]:
    return [number >> 32 & 0xFFFFFFFF, number & 0xFFFFFFFF]


def need_target(name: str, triple: str) -> None:
    """Skip where LLVM was built without a machine."""
    llvm.initialize_all_targets()
    try:
        llvm.Target.from_triple(triple)
    except RuntimeError:
        pytest.skip(f"LLVM was built without {name}")
