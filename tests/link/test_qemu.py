"""Exported laws, compiled for other processors and run by an emulator, fly the bits of the simulation."""

import pytest

from starhold.link.process import fly_by_process
from starhold.loop.kernels import numbers_of
from starhold.simulation.lane import fly
from tests.export.flown import built, code_of, loop_of, need, same
from tests.tiers import drawn, fewer

BOARDS = {
    "arm": ("arm-linux-gnueabihf-gcc", "-march=armv7-a", "-mfpu=vfpv4"),
    "riscv64": ("riscv64-linux-gnu-gcc",),
    "sparc64": ("sparc64-linux-gnu-gcc",),
}
"""Compilers with their flags, by what comes after `qemu-`. The first two have fused multiply-adds; the last one's bytes are
in the other order, as those of a LEON3."""
LAWS = ["mission", "lyapunov", "estimator", "wheel", "mpc"]
"""The first has an estimator and modes, of which the whole goes through four."""


@pytest.mark.parametrize(("name", "machine"), drawn([(name, machine) for machine in BOARDS for name in LAWS], 6))
def test_a_processor_flies_the_bits_of_the_simulation(name, machine, tmp_path):
    need(f"qemu-{machine}")
    compiler, *flags = BOARDS[machine]
    steps = {"mpc": 12, "mission": fewer(5500, 25)}.get(name, fewer(400, 2))
    flight = built(tmp_path, code_of(name), "-O2", "-static", *flags, compiler=compiler)
    samples, carry = fly_by_process(f"qemu-{machine} {flight}", loop_of(name), steps)
    expected, at_end = fly(loop_of(name), steps)
    same(samples, expected)
    same(numbers_of((carry.state, carry.effectors)), numbers_of((at_end.state, at_end.effectors)))
