"""Compiles programs for this processor and loads them."""

import ctypes
from collections.abc import Callable
from functools import cache
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from starhold.trace.llvm import Llvm
from starhold.trace.ordering import ordered
from starhold.trace.program import Call, Program, statements

ALIGNMENT = 64
"""Alignment of memories in bytes: the width of the widest vector registers of present processors."""


@cache
def _llvm() -> Any:
    """Return llvmlite, loaded when the first kernel is compiled."""
    llvm: Any = import_module("llvmlite.binding")
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return llvm


def _machine() -> Any:
    """Return a target machine for this processor with all features. An engine takes ownership, so each needs its own."""
    llvm = _llvm()
    target, features = llvm.Target.from_default_triple(), llvm.get_host_cpu_features().flatten()
    return target.create_target_machine(opt=3, cpu=llvm.get_host_cpu_name(), features=features)


LONG = 2_000_000
"""Control steps of one lane from which it pays to let LLVM optimise the kernel."""
FEW, MANY = 16, 48
"""Numbers carried from step to step up to which 16 and 32 registers, respectively, suffice for two vectors of each."""


def widest(carried: int, noted: int = 0) -> int:
    """Return the number of simultaneous lanes that is fastest on this processor, for lanes that carry `carried` numbers and
    record `noted` numbers. Each number fills two of the widest registers if few are carried (with 32 registers: at most
    `MANY`, and none recorded), else one."""
    if is_wide():
        return 8 if noted or carried > MANY else 16
    return 8 if carried + noted <= FEW else 4


def is_wide() -> bool:
    """Return whether this processor has 32 registers of 512 bits."""
    return bool(_llvm().get_host_cpu_features().get("avx512f"))


def load(program: Program, width: int, passes: bool | None = None) -> Callable[..., None]:
    """Return the program as a function for `width` lanes at once. Its arguments are the addresses of the memories (a memory
    of lanes has `width` numbers for each index, aligned to their size), then counts and words. It releases the GIL.

    passes: whether LLVM optimises the printed text before it generates code; None: where measurements say that it pays,
    which is on many lanes if registers are plentiful and nothing is called. On one lane it takes longer than code
    generation and saves some thousandths of the time of a step, or a fifth where matrices are solved: it pays from `LONG`
    steps on."""
    calls = any(isinstance(s, Call) and s.rows == 1 for s in statements(program.main.body))
    if passes is None:
        passes = width > 1 and is_wide() and not calls
    llvm, machine = _llvm(), _machine()
    # With many lanes, or a law that solves an optimization, the time is spent elsewhere.
    module = llvm.parse_assembly(str(Llvm(program if width > 1 or calls else ordered(program), width)))
    module.verify()
    if passes:
        options = llvm.create_pipeline_tuning_options(speed_level=3)
        # It pays for the matrices of a law that solves an optimization, and costs time on vectors of three components.
        options.slp_vectorization = width == 1 and calls
        builder = llvm.create_pass_builder(machine, options)
        builder.getModulePassManager().run(module, builder)
    engine = llvm.create_mcjit_compiler(module, machine)
    engine.finalize_object()
    kinds = [ctypes.c_void_p] * len(program.memories) + [ctypes.c_int64] * len(program.main.params)
    kernel: Any = ctypes.CFUNCTYPE(None, *kinds)(engine.get_function_address(program.main.name))
    # The code lives as long as its engine.
    kernel.engine = engine
    return kernel


def aligned(*shape: int) -> NDArray[np.float64]:
    """Return an array of zeros aligned so that a whole vector may be read at once."""
    size = int(np.prod(shape))
    step = max(ALIGNMENT, 8 * shape[-1]) // 8 if shape else 8
    store = np.zeros(size + step)
    start = -(store.ctypes.data // 8) % step
    return store[start : start + size].reshape(shape)


def word(number: int) -> int:
    """Return a seed or a run's number as the signed integer that a kernel takes."""
    number &= 0xFFFFFFFFFFFFFFFF
    return number - (1 << 64) if number >= 1 << 63 else number
