"""Prints a program as assembly of another machine, from the same intermediate representation: PTX for NVIDIA's GPUs, where
each thread is a lane, or assembly for any processor that LLVM supports, for one lane.

No test runs it on a GPU. Tests run the text for LLVM on this processor, one thread after the other. They check that every
operation of the PTX rounds to nearest and none is fused, and run it in an interpreter of PTX.
"""

from importlib import import_module
from typing import Any

from starhold.algebra.operations import INDEX
from starhold.trace.llvm import Llvm, check_apart
from starhold.trace.program import Function, Program, Value

TRIPLE = "nvptx64-nvidia-cuda"
_REGISTERS = ("tid.x", "ctaid.x", "ntid.x")


class Threads(Llvm):
    """Printer of a GPU kernel whose threads are the lanes; threads beyond the number of lanes do nothing.

    Its arguments are the memories (a memory of lanes has one number per lane for each index), counts and words, and last
    the number of lanes. Blocks along x may have any size."""

    convention = "ptx_kernel "
    passed = ("%.lanes", "%.thread")
    lane = "%.thread"

    def __init__(self, program: Program) -> None:
        check_apart(program)
        super().__init__(program, 1)

    def _declarations(self) -> list[str]:
        return [*super()._declarations(), *(f"declare i32 @llvm.nvvm.read.ptx.sreg.{name}()" for name in _REGISTERS)]

    def _parameters(self, function: Function) -> list[tuple[str, str]]:
        given = super()._parameters(function)
        return [*given, ("i64", "%.lanes")] if function is self.program.main else given

    def _begin(self, main: Function) -> None:
        thread, block, size = (
            self._let(f"zext i32 {self._let(f'call i32 @llvm.nvvm.read.ptx.sreg.{name}()')} to i64") for name in _REGISTERS
        )
        before = self._let(f"mul i64 {block}, {size}")
        self._put(f"%.thread = add i64 {before}, {thread}")
        runs = self._let("icmp slt i64 %.thread, %.lanes")
        self._put(f"br i1 {runs}, label %.runs, label %.rests")
        self._begin_block(".rests")
        self._put("ret void")
        self._begin_block(".runs")
        super()._begin(main)

    def _address(self, name: str, index: Value) -> str:
        if self.program.memory(name).lanes:
            row = self._let(f"mul {self._typed(index, INDEX)}, %.lanes")
            index = self._let(f"add i64 {row}, %.thread")
        return super()._address(name, index)


def ptx(program: Program, processor: str = "sm_80") -> str:
    """Return the program as PTX for a GPU (sm_80 is an A100, sm_90 an H100 or H200) and those after it."""
    return assembly(Threads(program), TRIPLE, processor)


def assembly(text: Llvm, triple: str, processor: str = "", features: str = "") -> str:
    """Return the assembly of a printed program for a target machine, optimised by LLVM. RuntimeError if this LLVM does not
    support the target."""
    llvm: Any = import_module("llvmlite.binding")
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    machine = llvm.Target.from_triple(triple).create_target_machine(cpu=processor, features=features, opt=3)
    module = llvm.parse_assembly(str(text))
    module.triple, module.data_layout = triple, str(machine.target_data)
    module.verify()
    builder = llvm.create_pass_builder(machine, llvm.create_pipeline_tuning_options(speed_level=3))
    builder.getModulePassManager().run(module, builder)
    return str(machine.emit_assembly(module))
