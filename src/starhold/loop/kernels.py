"""The compiled kernels that repeat the step of a closed loop, of whatever kind, over one lane or many.

All readers share the equations of a step, so one lane, any lane of a batch and plain Python agree bit for bit. No fast-math
anywhere.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numba

from starhold.algebra.structure import LANES, load, move, store
from starhold.loop.closed_loop import Carry, Parts
from starhold.loop.fingerprint import fingerprint, outside_modules
from starhold.loop.station import StationParts, station_step
from starhold.loop.step import Step, attitude_step

AnyParts: TypeAlias = Parts | StationParts


class Kernels(NamedTuple):
    """Compiled: `one` flies a trajectory and records it, `many` flies the columns of an array."""

    one: Callable[..., Any]
    many: Callable[..., Any]


@cache
def make_step(parts: AnyParts) -> Step:
    """The equations of a control step made of these parts."""
    return station_step(parts) if isinstance(parts, StationParts) else attitude_step(parts)


@cache
def make_kernels(parts: AnyParts) -> Kernels:
    """Kernels for these parts, from the disk cache where nothing they are built from has changed."""
    return Kernels(_one(parts), _many(parts))


def compiled(function: Callable[..., Any], parts: AnyParts) -> Callable[..., Any]:
    """Compile a kernel, or find it in the disk cache under a name made of its parts and all their sources.

    A name of its own for each kernel also means that a law which is no longer there spoils no other law's cache entry.
    """
    sources = fingerprint()[:16]
    mark = fingerprint(outside_modules(parts)) + "".join(f"{part.__module__}.{part.__qualname__}" for part in parts)
    function.__qualname__ = f"{function.__name__}-{sources}-{hashlib.sha256(mark.encode()).hexdigest()[:32]}"
    kernel: Any = numba.njit(error_model="numpy", cache=True, nogil=True)(function)
    _drop_stale(Path(kernel.stats.cache_path), sources)
    return kernel


@cache
def _drop_stale(folder: Path, sources: str) -> None:
    """Delete the cached kernels of sources that have changed since; no process will ask for them again."""
    for file in folder.glob("*.*-*-*.nb[ic]"):
        if f"-{sources}-" not in file.name:
            with suppress(OSError):
                file.unlink()


def _one(parts: AnyParts) -> Callable[..., Any]:
    _, decide, hold, check, sample = make_step(parts)

    def one(carry, first, count, finish, every, run, gains, known, craft, setup, substeps, out, end):
        """Fly control steps first .. first+count-1; write every `every`-th into a column of `out`, and with `finish` the
        last state as well. What is carried on goes into the one column of `end`; stops where the motion is lost. `known` is
        the craft that the law takes it for."""
        # Nothing is returned: a result made of Python objects would be built by code that a signal can break into.
        for step in range(first, first + count):
            carry = check(carry, step, setup)
            if carry.lost_at >= 0.0:
                break
            carry = decide(carry, step, run, gains, known, setup)
            if step % every == 0:
                store(out, step // every, sample(carry, step, setup))
            for _ in range(substeps):
                carry = hold(carry, craft, setup)
        last = first + count
        carry = check(carry, last, setup)
        if finish and carry.lost_at < 0.0 and last % every == 0:
            store(out, last // every, sample(decide(carry, last, run, gains, known, setup), last, setup))
        store(end, 0, carry)

    return compiled(one, parts)


def _many(parts: AnyParts) -> Callable[..., Any]:
    _, decide, hold, check, _ = make_step(parts)

    def many(x, like, first, count, run, gains, like_gains, known, craft, setup, substeps):
        """Fly control steps first .. first+count-1 of every lane of the block x, in place; lane 0 is
        run number `run`. Gains are a NamedTuple shared by all lanes, or a block too."""
        for step in range(first, first + count):
            for k in range(LANES):
                c = check(load(x, k, like), step, setup)
                store(x, k, decide(c, step, run + k, load(gains, k, like_gains), known, setup))
            for _ in range(substeps):
                for k in range(LANES):
                    store(x, k, hold(load(x, k, like), craft, setup))
        for k in range(LANES):
            store(x, k, check(load(x, k, like), first + count, setup))

    return compiled(many, parts)


@cache
def make_replay(parts: Parts) -> Callable[..., Any]:
    """A kernel that repeats the control calls of a run, to time them: from the state to the limited command."""
    decide = make_step(parts).decide

    def replay(samples, first, last, carry, gains, craft, setup, end):
        """Decide on the states in columns first .. last-1 of recorded samples, each call after the one before."""
        for k in range(first, last):
            # The first rows of a sample are the state; every number of it waits for the torque of the call before.
            u = carry.command
            wait = 0.0 * (u[0] + u[1] + u[2])
            state = move(load(samples, k, carry.state), wait, load(samples, k, carry.state))
            carry = Carry(state, carry.memory, carry.goal, carry.h, u, carry.disturbance, carry.lost_at)
            carry = decide(carry, k, 0, gains, craft, setup)
        store(end, 0, carry)

    return compiled(replay, parts)
