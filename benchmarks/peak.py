"""What share of the processor's arithmetic the many-lane kernel reaches.

The processor's peak on one core is measured: independent chains of multiplications and additions on numbers in registers,
many chain shapes, the fastest counts, in explicit vectors of the widest kind that the machine has. Once in strict IEEE
arithmetic, as starhold's kernels compute (a product and a sum are two instructions), and once with the two fused, which
strict arithmetic forbids. Division and square root are measured too: they are far slower, and have a unit of their own.

The operations of a step are those of a lane in the kernel's own trace, common subexpressions once and nothing in vain. What
all lanes share, such as the orbit, is computed once for all of them, and counts as nothing. What is done on a condition does
not count either, such as friction where there is some and the torque of sunlight: shares are a little higher than told.

Run: python benchmarks/peak.py
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import llvmlite.binding as llvm

import common
import steps
from common import header, interleaved, show
from starhold.laws.catalogue import catalogue
from starhold.loop.closed_loop import ClosedLoop
from starhold.loop.kernels import Numbers, make_step
from starhold.loop.programs import steady
from starhold.parts.craft import make_craft
from starhold.scenario.building import build
from starhold.scenario.reading import load
from starhold.simulation.lanes import RunningBatch, carry_columns
from starhold.trace.bounds import Work, work
from starhold.trace.llvm import hexadecimal
from starhold.trace.program import Block, Loop, Program
from starhold.trace.sharing import split

CHAINS, DEPTH, AGAIN = (4, 8, 12, 16), 8, 100_000
"""Independent chains, operations on each in a turn of the loop, and turns."""
STEPS, REPEATS = 1000, 20


def width() -> int:
    """Numbers in the widest vector of this processor."""
    features = llvm.get_host_cpu_features()
    return 8 if features.get("avx512f") else 4 if features.get("avx") else 2


BODIES = {
    "multiply and add, strict": ("fmul {t} {x}, {c}|fadd {t} {x}, {d}", 2),
    "fused multiply-add": ("call {t} @llvm.fma.v{w}f64({t} {x}, {t} {c}, {t} {d})", 2),
    "divide": ("fdiv {t} {c}, {x}", 1),
    "root": ("call {t} @llvm.sqrt.v{w}f64({t} {x})", 1),
}
"""Text of a chain's link, and floating-point operations in it."""


def chain(body: str, chains: int) -> Callable[[], None]:
    """A kernel that repeats `body` on independent chains of vectors in registers."""
    w = width()
    t = f"<{w} x double>"
    links = body.split("|")
    c, d = (f"splat (double {hexadecimal(number)})" for number in (0.999, 1e-3))
    lines = [
        f"declare {t} @llvm.fma.v{w}f64({t}, {t}, {t})",
        f"declare {t} @llvm.sqrt.v{w}f64({t})",
        'define void @peak(ptr %out) "prefer-vector-width"="512" "min-legal-vector-width"="512" {',
        "entry:",
        "  br label %turn",
        "turn:",
        "  %k = phi i64 [ 0, %entry ], [ %k1, %turn ]",
    ]
    ends = {n: f"%v{n}.{DEPTH * len(links) - 1}" for n in range(chains)}
    lines += [
        f"  %v{n} = phi {t} [ splat (double {hexadecimal(1.0 + n / 64)}), %entry ], [ {end}, %turn ]"
        for n, end in ends.items()
    ]
    for place in range(DEPTH * len(links)):
        for n in range(chains):
            x = f"%v{n}" if place == 0 else f"%v{n}.{place - 1}"
            lines.append(f"  %v{n}.{place} = " + links[place % len(links)].format(t=t, w=w, x=x, c=c, d=d))
    lines += [
        "  %k1 = add i64 %k, 1",
        f"  %more = icmp ult i64 %k1, {AGAIN}",
        "  br i1 %more, label %turn, label %end",
        "end:",
    ]
    for n, end in ends.items():
        lines += [f"  %p{n} = getelementptr {t}, ptr %out, i64 {n}", f"  store {t} {end}, ptr %p{n}, align 8"]
    lines += ["  ret void", "}"]
    target = llvm.Target.from_default_triple()
    features = llvm.get_host_cpu_features().flatten()
    machine = target.create_target_machine(opt=3, cpu=llvm.get_host_cpu_name(), features=features)
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly("\n".join(lines)), machine)
    engine.finalize_object()
    kernel: Any = ctypes.CFUNCTYPE(None, ctypes.c_void_p)(engine.get_function_address("peak"))
    out = (ctypes.c_double * (chains * w))()
    kernel.kept = engine, out
    return lambda: kernel(ctypes.addressof(out))


def operations(loop: ClosedLoop, always: bool = False) -> tuple[Work, Work]:
    """Operations of one control step of lanes with starts of their own: those that all share, and those of each. always:
    those alone that are done on no condition."""
    batch, numbers = RunningBatch(loop, carry_columns(loop, steps.starts(loop, 2)), 0, 2), Numbers.of(loop.phases(1)[0])
    program, _ = steady(make_step(loop.composition()), batch.alike, loop.carry(), numbers, loop.substeps, None)
    shared, lane = split(program, 1)
    return _of_a_step(shared, always), _of_a_step(lane, always)


def _of_a_step(program: Program, always: bool) -> Work:
    if always:
        main = program.main
        program = program._replace(functions=(*program.functions[:-1], main._replace(body=_always(main.body))))
    counts = {"first": 0, "blocks": 1, "width": 1}
    one, two = (work(program, counts | {"count": count}).work for count in (1, 2))
    return Work(*(b - a for a, b in zip(one, two, strict=True)))


def _always(block: Block) -> Block:
    """What is done on no condition."""
    inner = (s._replace(body=_always(s.body)) if isinstance(s, Loop) else s for s in block)
    return tuple(s._replace(head=(), body=()) if isinstance(s, Loop) and s.most == 1 else s for s in inner)


def measure(loops: dict[str, ClosedLoop]) -> tuple[dict[str, float], dict[str, float]]:
    """Operations a second of each body (its best shape), and seconds of a lane-step of each loop."""
    tasks: dict[str, Callable[[], Any]] = {}
    counts: dict[str, tuple[str, int]] = {}
    for name, (body, count) in BODIES.items():
        for chains in CHAINS:
            key = f"{name} {chains}"
            tasks[key] = chain(body, chains)
            counts[key] = (name, count * chains * DEPTH * width() * AGAIN)
    for name, loop in loops.items():
        batch = steps.Batch(loop, 1)
        tasks[name], tasks[f"{name}, none"] = (lambda batch=batch, count=count: batch.run(count) for count in (STEPS, 0))
    times = interleaved(tasks, REPEATS)
    rates: dict[str, float] = {}
    for key, (name, count) in counts.items():
        rates[name] = max(rates.get(name, 0.0), count / times[key].work)
    # Setting up a batch costs a little too, which is no arithmetic.
    done = STEPS * steps.LANES
    return rates, {name: (times[name].work - times[f"{name}, none"].work) / done for name in loops}


def main() -> None:
    """Measure and print."""
    print(header())
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    full = make_craft([[2.0, 0.1, -0.2], [0.1, 3.0, 0.15], [-0.2, 0.15, 4.0]], torque_limit=0.01)
    loops: dict[str, ClosedLoop] = {}
    for name in ("lyapunov", "sliding", "pd"):
        law = catalogue()[name]
        loops[name] = common.problem(law, law.examples()[0], common.PUBLISHED, torque_limit=0.01, limit="axis")
    loops["lyapunov, full inertia"] = replace(loops["lyapunov"], craft=full)
    scenario = load("cubesat-nadir")
    loops["cubesat-nadir"] = replace(build(scenario, scenario.pick("lyapunov")), events=())
    rates, costs = measure(loops)

    print("Peak of one core, billion operations a second")
    show(["operation", "10^9/s"], [[name, f"{rate / 1e9:.2f}"] for name, rate in rates.items()])

    strict, fused = rates["multiply and add, strict"], rates["fused multiply-add"]
    counts: list[list[str]] = []
    shares: list[list[str]] = []
    for name, loop in loops.items():
        _, ops = operations(loop, always=True)
        cells = (ops.additions, ops.multiplications, ops.divisions, ops.roots, ops.arithmetic)
        counts.append([name, *map(str, (*cells, ops.negations, ops.comparisons, ops.selects))])
        rate = ops.arithmetic / costs[name]
        row = [f"{costs[name] * 1e9:.2f}", f"{rate / 1e9:.1f}", f"{rate / strict:.0%}", f"{rate / fused:.0%}"]
        easy, hard = (
            (ops.additions + ops.multiplications) / strict,
            ops.divisions / rates["divide"] + ops.roots / rates["root"],
        )
        shares.append([name, *row, f"{easy * 1e9:.2f}", f"{hard * 1e9:.2f}"])
    print("Operations of a lane-step: the control law and four slopes of the motion. `flop`: sum of the first four.")
    show(["law, scenario", "add", "multiply", "divide", "root", "flop", "negate", "compare", "select"], counts)
    print("The kernel on one core. Last two: the time that its additions and multiplications, and its divisions and")
    print("roots, take at their measured peaks. The units work side by side: the larger is a lower bound.")
    show(
        ["law, scenario", "ns", "10^9 flop/s", "of strict peak", "of fused peak", "add, multiply ns", "divide, root ns"],
        shares,
    )


if __name__ == "__main__":
    main()
