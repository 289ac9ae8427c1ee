"""Flies a loop with a law in a child process: the binary protocol over the child's pipes."""

from __future__ import annotations

import contextlib
import os
import select
import shlex
import subprocess
from typing import Any

from numpy.typing import NDArray

from starhold.errors import CutShortError, InputError
from starhold.link.plant import Ending, Plant, Rules
from starhold.link.protocol import Decoder
from starhold.loop.closed_loop import ClosedLoop
from starhold.simulation.lane import Progress
from starhold.simulation.stepper import Stepper

PATIENCE = 60.0
"""A process that is silent for this time (s) is assumed to hang."""
GRACE = 5.0
"""Time (s) in which a process may end by itself after the flight."""
EVERY = 100
"""Control steps between two reports of progress."""


class LostLawError(CutShortError):
    """A law's process failed. flight: the flight until then."""

    def __init__(self, flight: Stepper, failure: str, allowed: str) -> None:
        super().__init__("run", "--law-process", failure, allowed)
        self.flight = flight


def fly_by_process(
    command: str, loop: ClosedLoop, steps: int, record_every: int = 1, progress: Progress | None = None
) -> tuple[NDArray[Any], Any]:
    """Return the samples and the final carry, like `fly`, of a loop whose commands come from a process.

    command: the program and its arguments, run without a shell, in lockstep. Raise InputError if it cannot be started,
    LostLawError if it ends before the flight, hangs, or sends an invalid message."""
    flight = Stepper(loop)
    plant = Plant(flight, {}, Rules(steps))
    try:
        words = shlex.split(command)
        child = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0)
    except (OSError, ValueError, IndexError) as error:
        raise InputError("run", "--law-process", command, f"a program that runs: {error}") from None
    with child:
        try:
            _converse(plant, child, command, progress)
            with contextlib.suppress(subprocess.TimeoutExpired):
                child.communicate(timeout=GRACE)
        finally:
            child.kill()
    return flight.samples(record_every)


def _converse(plant: Plant, child: subprocess.Popen[bytes], command: str, progress: Progress | None) -> None:
    """Exchange messages until the flight ends."""
    assert child.stdin is not None
    assert child.stdout is not None
    source, sink = child.stdout.fileno(), child.stdin.fileno()
    waiting, decoder = bytearray(), Decoder()
    plant.send = waiting.extend
    shown = 0

    def lost(what: str, allowed: str = "a command for every step") -> LostLawError:
        return LostLawError(plant.flight, f"{command}, at step {plant.flight.steps}, {what}", allowed)

    while plant.ending is None or waiting:
        readable, writable, _ = select.select([source], [sink] if waiting else [], [], PATIENCE)
        if not readable and not writable:
            raise lost(f"nothing for {PATIENCE:g} s")
        try:
            if writable:
                del waiting[: os.write(sink, waiting[: select.PIPE_BUF])]
            data = os.read(source, 2**16) if readable else None
        except BrokenPipeError:
            data = b""
        if plant.ending is not None:
            # Messages after the end are ignored; a process that has exited needs no final message.
            if data == b"":
                return
            continue
        if data == b"":
            with contextlib.suppress(subprocess.TimeoutExpired):
                child.wait(GRACE)
            raise lost(f"a process that ended with {child.returncode}")
        plant.received(data or b"", decoder)
        if plant.faults:
            fault = next(iter(plant.faults))
            raise lost(f"a message that is {fault}", "the protocol of docs/in-the-loop.md")
        if plant.ending is Ending.STOPPED:
            raise lost("a process that stops the flight")
        if progress is not None and (plant.flight.steps - shown >= EVERY or plant.ending is not None):
            shown = plant.flight.steps
            progress(shown, plant.rules.steps)
