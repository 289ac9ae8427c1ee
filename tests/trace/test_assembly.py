"""What machines are given: every operation on numbers rounds to nearest, and none is fused with another; and how this one
stores what has no room in registers."""

import ctypes
import platform
import re
from collections import Counter
from typing import Any

import llvmlite.binding as llvm
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from starhold.algebra.operations import INDEX, WORD
from starhold.algebra.scalar import less, sqrt, where
from starhold.algebra.structured import Buffer, function, repeat, until
from starhold.algebra.words import number_in, number_of, word_add, word_and
from starhold.trace import machine as loading
from starhold.trace.llvm import Llvm
from starhold.trace.machine import word
from starhold.trace.program import Memory
from starhold.trace.ptx import Threads, assembly, ptx
from tests.trace.machines import Job, Subject, column, need_target, same
from tests.trace.scripts import Script, scripts, subject, values

FUSED = re.compile(r"\b(?:v?f(?:n?m(?:add|sub|la|ls)|ma)\w*|f64x2\.\w*madd|fmaf?|__fma)\b", re.I)
"""Names of fused operations of all of these machines."""


@function
def fall(cells: Buffer, x: float, rate: float) -> float:
    """A sum of products with numbers in memory, where a fused operation would be of use."""

    def turn(k: Any, x: Any) -> Any:
        cells[k] = x * rate + cells[k]
        return (x - rate * cells[k],)

    return repeat(cells.size, turn, x)[0]


def law(cells: Buffer, table: Buffer, count: Any, seed: Any, lane: Any) -> None:
    """Something of everything that laws do."""
    x = fall(cells.part(0, count), table[0], table[1])
    y = fall(cells.part(1, count), x, number_of(count))
    (z,) = until(lambda z: less(z * z - y, 1e-9), lambda z: (0.5 * (z + y / z),), 1.0, at_most=40)
    cells[4] = where(less(z, 0.0), -z, sqrt(z)) + number_in(word_and(word_add(seed, lane), 0xFFFF))


MEMORIES = Memory("cells", True, True, 5), Memory("table", False, False, 2)
PROGRAM = Subject(law, MEMORIES, {"count": INDEX, "seed": WORD}).program("law")

OTHERS = {
    "wasm32": ("wasm32-unknown-unknown", "", ""),
    "sparc": ("sparc-none-elf", "leon3", ""),
    "riscv64": ("riscv64-unknown-elf", "generic-rv64", "+m,+a,+f,+d,+c"),
    "aarch64": ("aarch64-unknown-linux-gnu", "cortex-a72", ""),
}
NAMES = {
    "wasm32": ("f64.add", "f64.sub", "f64.mul", "f64.div", "f64.sqrt"),
    "sparc": ("faddd", "fsubd", "fmuld", "fdivd", "fsqrtd"),
    "riscv64": ("fadd.d", "fsub.d", "fmul.d", "fdiv.d", "fsqrt.d"),
    "aarch64": ("fadd", "fsub", "fmul", "fdiv", "fsqrt"),
}


def instructions(text: str) -> Counter[str]:
    """How often each instruction stands in an assembly, by name."""
    return Counter(re.findall(r"^\s+(?:@\S+\s+)?([a-z_][\w.]*)", text, re.M))


@pytest.mark.parametrize("processor", ["sm_80", "sm_90"])
def test_ptx_rounds_every_operation_to_nearest_and_fuses_none(processor: str) -> None:
    need_target("nvptx64", "nvptx64-nvidia-cuda")
    text = ptx(PROGRAM, processor)
    assert f".target {processor}" in text
    assert len(re.findall(r"^\.visible \.entry law\(", text, re.M)) == 1
    arithmetic = {
        name for name in instructions(text) if re.match(r"(add|sub|mul|div|sqrt|rcp|fma|mad)\b.*f(16|32|64)", name)
    }
    assert arithmetic == {f"{name}.rn.f64" for name in ("add", "sub", "mul", "div", "sqrt")}
    assert not FUSED.search(text)
    assert not {name for name in instructions(text) if ".approx" in name or ".ftz" in name or name.endswith(".f32")}


def test_ptx_gives_each_thread_a_lane() -> None:
    need_target("nvptx64", "nvptx64-nvidia-cuda")
    text = ptx(PROGRAM)
    # Two memories, a count, a word and the number of lanes; threads beyond it return at once.
    assert len(re.findall(r"^\s*\.param \.u64", text, re.M)) == len(MEMORIES) + 3
    last = re.search(r"ld\.param\S* \s*(%rd\d+), \[law_param_4\];", text)
    assert last is not None
    assert re.search(rf"setp\.(?:lt|ge)\.s64 \s*%p\d+, %rd\d+, {last[1]};", text)
    assert "%tid.x" in text
    assert "%ctaid.x" in text
    assert "%ntid.x" in text


def on_threads(job: Job, lanes: int, size: int) -> dict[str, NDArray[np.float64]]:
    """What the text for a GPU leaves where this processor runs it, one thread after the other, in blocks of such a size."""
    registers = ("tid.x", "ctaid.x", "ntid.x")
    text = str(Threads(job.program)).replace("define ptx_kernel ", "define ")
    for name in registers:
        text = text.replace(f"@llvm.nvvm.read.ptx.sreg.{name}", f"@{name}")
        read = f"@now.{name} = global i32 0\ndefine i32 @{name}() {{\n  %r = load i32, ptr @now.{name}\n  ret i32 %r\n}}"
        text = text.replace(f"declare i32 @{name}()", read)
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    module = llvm.parse_assembly(text)
    module.verify()
    machine = llvm.Target.from_default_triple().create_target_machine()
    engine = llvm.create_mcjit_compiler(module, machine)
    engine.finalize_object()
    now = [ctypes.c_int32.from_address(engine.get_global_value_address(f"now.{name}")) for name in registers]
    arrays = {name: np.array(array) for name, array in job.memories.items()}
    given = [arrays[memory.name].ctypes.data for memory in job.program.memories]
    given += [word(job.inputs[name]) for name, _ in job.program.main.params]
    kernel: Any = ctypes.CFUNCTYPE(None, *[ctypes.c_int64] * (len(given) + 1))(
        engine.get_function_address(job.program.main.name)
    )
    for block in range(-(-lanes // size)):
        for thread in range(size):
            now[0].value, now[1].value, now[2].value = thread, block, size
            kernel(*given, lanes)
    return arrays


@settings(max_examples=12)
@given(scripts, st.integers(0, 2**64 - 1), st.integers(0, 3))
def test_the_text_of_ptx_leaves_the_bits_of_plain_python_where_this_processor_runs_it(
    script: Script, seed: int, count: int
) -> None:
    drawn = subject(script)
    program, inputs = drawn.program(), {"count": count, "seed": seed}
    memories = {name: array[:, :5].copy() if array.ndim == 2 else array for name, array in values(seed).items()}
    left = on_threads(Job(program, memories, inputs), lanes=5, size=4)
    for lane in range(5):
        expected = drawn.plain(column(program, memories, lane), inputs, lane)
        same(expected, column(program, left, lane), f"thread {lane}")


def test_ptx_is_refused_where_lanes_would_write_to_the_same_memory() -> None:
    program = Subject(lambda out, lane: out.put(0, (1.0,)), (Memory("out", False, True, 1),), {}).program()
    with pytest.raises(ValueError, match="out: all lanes write to the same memory"):
        ptx(program)


@pytest.mark.parametrize("name", OTHERS)
def test_the_same_text_compiles_for_other_machines_and_nothing_is_fused(name: str) -> None:
    triple, processor, features = OTHERS[name]
    need_target(name, triple)
    text = assembly(Llvm(PROGRAM, 1), triple, processor, features)
    found = instructions(text)
    assert not FUSED.search(text), FUSED.findall(text)
    assert all(found[instruction] for instruction in NAMES[name]), found


@pytest.mark.skipif(platform.machine().lower() not in ("x86_64", "amd64"), reason="of this processor's registers")
def test_what_a_kernel_keeps_on_the_stack_is_aligned() -> None:
    def crowded(x: Buffer, y: Buffer, _: Any) -> None:
        """More numbers at once than registers."""
        roots = [sqrt(x[k]) + 1.0 / (k + 3) for k in range(x.size)]
        y.put(0, (root * sum(roots) for root in roots))

    program = Subject(crowded, (Memory("x", True, False, 48), Memory("y", True, True, 48)), {}).program()
    module = llvm.parse_assembly(str(Llvm(program, 8)))
    text = loading._machine().emit_assembly(module)
    assert re.search(r"\bv?movap[sd]\s.*\(%r[sb]p\)", text)
    assert not re.search(r"\bv?movup[sd]\s.*\(%r[sb]p\)", text)


def test_a_machine_that_llvm_does_not_know_is_an_error() -> None:
    with pytest.raises(RuntimeError, match="nowhere"):
        assembly(Llvm(PROGRAM, 1), "nowhere-none-none")


def test_the_search_for_fused_operations_finds_them() -> None:
    fused = "fma.rn.f64", "fmadd.d", "fmadd", "fmla", "fmadds", "vfmadd213sd", "fnmsub", "call fma", "f64x2.relaxed_madd"
    assert all(FUSED.search(f" {text} %a, %b") for text in fused)
    assert not FUSED.search("fmul d0\n faddd %f0\n f64.mul\n fmv.d fa0\n fmov d0\n format")
