"""The appendages of a loop, whose motion is a program of the kernel, recorded from the equations that fly, with all their
numbers; and whether laws know the momentum of effectors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from starhold.algebra.operations import UnreadableError
from starhold.algebra.structure import leaves, mapped
from starhold.algebra.vector import ZERO
from starhold.errors import InputError
from starhold.laws.program import law_program
from starhold.loop.closed_loop import ClosedLoop
from starhold.loop.kernels import make_step
from starhold.parts.part import Fitted
from starhold.trace.straight_line import straight_line

TAKING = ("command", "switch", "pulse", "push", "bound")
"""Equations of effectors that are no appendages: they take commands, move the orbit, or have a bound of their own."""
TOLD_MOMENTUM = "measurement.wheel_momentum."
"""The prefix of those inputs of a law's program that contain the momentum of effectors."""


def appendages(loop: ClosedLoop) -> tuple[Fitted, ...]:
    """Return the effectors that move as the body moves them, and by themselves."""
    return tuple(
        f
        for f in loop.used("effector")
        if not (f.part.flag("ACTS") or f.part.flag("OUTSIDE")) and not any(f.part.hook(name) for name in TAKING)
    )


def start_of(loop: ClosedLoop) -> list[float]:
    """Return the state that the appendages of a loop start with."""
    return list(leaves(_alone(loop).carry().effectors))


def appended_motion(loop: ClosedLoop) -> dict[str, Any]:
    """Record the derivatives of the rate and of the appendages' states, for a rate, a state and a torque on the body."""
    alone = _alone(loop)
    craft, setup, begun, slope = alone.craft, alone.setup(), alone.carry(), make_step(alone.composition()).slope

    def motion(attitude: Any, rate: Any, position: Any, velocity: Any, torque: Any, state: Any) -> Any:
        body = type(begun.state)(attitude, rate, position, velocity, torque)
        numbers = iter(state)
        carry = begun._replace(state=body, effectors=mapped(begun.effectors, lambda _: next(numbers)))
        rates, inner, _ = slope(carry, craft, setup)
        return rates[body._fields.index("rate")], inner

    # A dependence on the body's position or attitude becomes an input that the kernel does not know.
    given = {"attitude": (1.0, *ZERO), "rate": ZERO, "position": ZERO, "velocity": ZERO, "torque": ZERO}
    return straight_line(motion, **given, state=tuple(start_of(loop)))


def recorded_states(loop: ClosedLoop, arrays: Mapping[str, Any]) -> Any:
    """Return the states of appendages (n, numbers) of a recording; None where a part does not record its state as it is."""
    columns, taken = list[Any](), set[str]()
    for fitted, start in zip(loop.used("effector"), loop.carry().effectors, strict=True):
        record = fitted.part.hook("record")
        # Names that occurred before begin with that of the part.
        count = iter(range(1, 1 + len(list(leaves(start)))))
        state = mapped(start, lambda _, count=count: 1e-3 * next(count))
        sample = None if record is None else record(state, (), loop.start, fitted.prepared(loop.period))
        names = [] if sample is None else [f"{fitted.prefix}{x}" if x in taken else x for x in sample._fields]
        taken |= {*names}
        if fitted not in appendages(loop):
            continue
        if sample is None or list(leaves(sample)) != list(leaves(state)):
            return None
        columns += [arrays[name] for name in names]
    return np.hstack([np.atleast_2d(x.T).T for x in columns])


def tells_momentum(loop: ClosedLoop, fitted: Fitted) -> bool:
    """Return whether a law reads the momentum that effectors have, and this one may have some."""
    measured: Any = fitted.part.hook("measured_momentum") or fitted.part.hook("momentum")
    if measured is None:
        return False
    params = fitted.prepared(loop.period)
    state = fitted.remembered(params)

    def read(state: Any) -> Any:
        return measured(state, params)

    stored = straight_line(read, state=state)
    try:
        law = law_program(loop.law, loop.gains, loop.known, loop.period, loop.remembers)
    except (InputError, UnreadableError):
        return True
    reads = any(name.startswith(TOLD_MOMENTUM) for name in law["inputs"])
    return reads and (bool(stored["inputs"]) or any(read(state)))


def _alone(loop: ClosedLoop) -> ClosedLoop:
    moved, bare = appendages(loop), loop.without("sensor", "estimator", "watcher", "environment", "actuator")
    # Not by their names, which parts of two files may share.
    return replace(bare, parts=tuple(f for f in bare.parts if f.part.role != "effector" or f in moved))
