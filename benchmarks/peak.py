"""What share of the processor's arithmetic the many-lane kernel reaches.

The processor's peak on one core is measured: independent chains of multiplications and additions on numbers in the
first cache, many chain shapes, the fastest counts. Once in strict IEEE arithmetic, as starhold's kernels compute (a
product and a sum are two instructions), and once with the two fused, which strict arithmetic forbids. Division and
square root are measured too: they are far slower, and have a unit of their own.

The operations of a step are counted by flying it in plain Python with numbers that count: the same equations, another
reader. What the compiler finds twice or in vain it may drop, so the count is what the equations ask for, not what runs.

Run: python benchmarks/peak.py
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

import numba
import numpy as np

import common
from common import header, interleaved, show
from starhold.algebra import scalar
from starhold.algebra.scalar import less, sqrt, where
from starhold.algebra.structure import LANES, flatten, pack
from starhold.laws.catalogue import catalogue
from starhold.loop.closed_loop import Carry, ClosedLoop
from starhold.loop.kernels import make_kernels, make_step
from starhold.models.craft import make_craft

CHAINS, DEPTHS = (1, 2, 4), (4, 8, 16, 32)
"""Shapes of the peak: chains for each number of the array, and operations on each chain."""
SIZE, AGAIN = 512, 200
"""Numbers of the array, and passes over it in a timed call."""
BLOCKS, STEPS, REPEATS = 2, 500, 40

tally: Counter[str] = Counter()


def _counting(kind: str, name: str) -> Callable[..., Any]:
    plain = getattr(float, name)

    def operation(*numbers: float) -> Any:
        result = plain(*numbers)
        if result is NotImplemented:
            return result
        tally[kind] += 1
        return Counted(result)

    return operation


class Counted(float):
    """A number that counts the operations it takes part in; operations of constants alone are not counted."""

    __add__, __radd__ = _counting("add", "__add__"), _counting("add", "__radd__")
    __sub__, __rsub__ = _counting("add", "__sub__"), _counting("add", "__rsub__")
    __mul__, __rmul__ = _counting("multiply", "__mul__"), _counting("multiply", "__rmul__")
    __truediv__, __rtruediv__ = _counting("divide", "__truediv__"), _counting("divide", "__rtruediv__")
    __neg__ = _counting("negate", "__neg__")

    def __lt__(self, other: float) -> bool:
        tally["compare"] += 1
        return float.__lt__(self, other)

    def __gt__(self, other: float) -> bool:
        # Python asks this of the right operand of `plain < counted`.
        tally["compare"] += 1
        return float.__gt__(self, other)


def _root(x: float) -> Counted:
    tally["root"] += 1
    return Counted(math.sqrt(x))


@contextmanager
def counting() -> Iterator[Counter[str]]:
    """Count within; yields the tally."""
    tally.clear()
    with patch.object(scalar, "math", SimpleNamespace(sqrt=_root, nan=math.nan)):
        yield tally


def counted(structure: Any) -> Any:
    """The same structure with every float turned into one that counts."""
    if isinstance(structure, tuple):
        parts = [counted(part) for part in structure]
        return type(structure)(*parts) if hasattr(structure, "_fields") else tuple(parts)
    return Counted(structure) if isinstance(structure, float) else structure


def check_counter() -> None:
    """The counter counts what it should, roots and selects included, and changes no result."""
    with counting():
        a, b = Counted(2.0), Counted(3.0)
        value = where(less(1.0, a), sqrt(a * b + 1.0), -b) / 2.0 - 0.5 * a
        seen = dict(tally)
    assert seen == {"multiply": 2, "add": 2, "root": 1, "negate": 1, "divide": 1, "compare": 1}, seen
    assert isinstance(value, Counted)
    assert value == math.sqrt(7.0) / 2.0 - 1.0


def operations(loop: ClosedLoop) -> Counter[str]:
    """Operations of one control step of one lane, in the order of the many-lane kernel."""
    equations, setup = make_step(loop.parts()), loop.setup()
    carry: Carry = counted(loop.carry())
    for step in range(2):
        with counting():
            carry = equations.decide(equations.check(carry, step, setup), step, 0, loop.gains, loop.craft, setup)
            for _ in range(loop.substeps):
                carry = equations.hold(carry, loop.craft, setup)
            total = Counter(tally)
    plain = loop.carry()
    for step in range(2):
        plain = equations.decide(equations.check(plain, step, setup), step, 0, loop.gains, loop.craft, setup)
        plain = equations.hold(plain, loop.craft, setup)
    assert flatten(plain) == [float(number) for number in flatten(carry)]
    return total


def chain(body: str, chains: int, depth: int, fused: bool) -> Callable[[Any], None]:
    """A kernel that repeats `body` on independent chains, written out so that the compiler keeps them in registers."""
    names = [f"v{k}" for k in range(chains)]
    lines = [f"{name} = x[{k}, i]" for k, name in enumerate(names)]
    lines += [body.format(v=name) for _ in range(depth) for name in names]
    lines += [f"x[{k}, i] = {name}" for k, name in enumerate(names)]
    text = "\n            ".join(lines)
    space: dict[str, Any] = {"sqrt": math.sqrt, "AGAIN": AGAIN, "SIZE": SIZE}
    head = "def kernel(x):\n    for again in range(AGAIN):\n        for i in range(SIZE):\n            "
    exec(head + text, space)
    options: dict[str, Any] = {"fastmath": {"contract"}} if fused else {}
    kernel = numba.njit(error_model="numpy", **options)(space["kernel"])
    numbers = np.linspace(1.0, 2.0, chains * SIZE).reshape(chains, SIZE)
    return lambda: kernel(numbers)


BODIES = {
    "multiply and add, strict": ("{v} = {v} * 0.999 + 1e-3", 2, False),
    "fused multiply-add": ("{v} = {v} * 0.999 + 1e-3", 2, True),
    "divide": ("{v} = 1.5 / {v}", 1, False),
    "root": ("{v} = sqrt({v})", 1, False),
}
"""Text of a chain's link, floating-point operations in it, fused or not."""


def measure(loops: dict[str, ClosedLoop]) -> tuple[dict[str, float], dict[str, float]]:
    """Operations a second of each body (its best shape), and seconds of a lane-step of each loop."""
    tasks: dict[str, Callable[[], Any]] = {}
    work: dict[str, tuple[str, int]] = {}
    for name, (body, count, fused) in BODIES.items():
        slow = name in ("divide", "root")
        for chains in CHAINS if not slow else CHAINS[:2]:
            for depth in DEPTHS if not slow else DEPTHS[:2]:
                key = f"{name} {chains} {depth}"
                tasks[key] = chain(body, chains, depth, fused)
                work[key] = (name, count * chains * depth * SIZE * AGAIN)
    for name, loop in loops.items():
        tasks[name], tasks[f"{name}, none"] = lane_steps(loop, STEPS), lane_steps(loop, 0)
    times = interleaved(tasks, REPEATS)
    rates: dict[str, float] = {}
    for key, (name, count) in work.items():
        rates[name] = max(rates.get(name, 0.0), count / times[key].work)
    # Entering compiled code costs a little too, which is no arithmetic.
    return rates, {name: (times[name].work - times[f"{name}, none"].work) / (BLOCKS * LANES * STEPS) for name in loops}


def lane_steps(loop: ClosedLoop, steps: int) -> Callable[[], None]:
    """The many-lane kernel alone on some blocks, on one thread; each call goes on from where the last one was."""
    blocks = pack(np.repeat(np.array(flatten(loop.carry()))[:, None], BLOCKS * LANES, axis=1))
    kernel, setup, like = make_kernels(loop.parts()).many, loop.setup(), loop.carry()

    def work() -> None:
        for block in blocks:
            kernel(block, like, 0, steps, 0, loop.gains, loop.gains, loop.craft, loop.craft, setup, loop.substeps)

    return work


def main() -> None:
    """Check the counter, measure, print."""
    print(header())
    check_counter()
    full = make_craft([[2.0, 0.1, -0.2], [0.1, 3.0, 0.15], [-0.2, 0.15, 4.0]], torque_limit=0.01)
    loops: dict[str, ClosedLoop] = {}
    for name in ("lyapunov", "sliding", "pd"):
        law = catalogue()[name]
        loops[name] = common.problem(law, law.examples()[0], common.PUBLISHED, torque_limit=0.01, limit="axis")
    loops["lyapunov, full inertia"] = replace(loops["lyapunov"], craft=full)
    rates, costs = measure(loops)

    print("Peak of one core, billion operations a second")
    show(["operation", "10^9/s"], [[name, f"{rate / 1e9:.2f}"] for name, rate in rates.items()])

    strict, fused = rates["multiply and add, strict"], rates["fused multiply-add"]
    counts: list[list[str]] = []
    shares: list[list[str]] = []
    for name, loop in loops.items():
        ops = operations(loop)
        hard = ops["divide"] + ops["root"]
        total = ops["add"] + ops["multiply"] + hard
        counts.append([name, *(str(ops[kind]) for kind in KINDS), str(total)])
        rate = total / costs[name]
        cells = [f"{costs[name] * 1e9:.2f}", f"{rate / 1e9:.1f}", f"{rate / strict:.0%}", f"{rate / fused:.0%}"]
        easy, slow = (total - hard) / strict, ops["divide"] / rates["divide"] + ops["root"] / rates["root"]
        shares.append([name, *cells, f"{easy * 1e9:.2f}", f"{slow * 1e9:.2f}"])
    print("Operations of a lane-step: the control law and four slopes of the motion. `flop`: sum of the first four.")
    show(["law", *KINDS, "flop"], counts)
    print("The kernel on one core. Last two: the time that its additions and multiplications, and its divisions and")
    print("roots, take at their measured peaks. The units work side by side: the larger is a lower bound.")
    show(["law", "ns", "10^9 flop/s", "of strict peak", "of fused peak", "add, multiply ns", "divide, root ns"], shares)


KINDS = ("add", "multiply", "divide", "root", "negate", "compare")

if __name__ == "__main__":
    main()
