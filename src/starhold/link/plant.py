"""A flight that one peer commands by messages: bytes in, bytes out. Transports and timers are elsewhere."""

from __future__ import annotations

import json
import time
from collections import Counter
from collections.abc import Callable
from enum import StrEnum
from typing import Any, NamedTuple

import numpy as np

from starhold.link.layout import Layout
from starhold.link.protocol import COMMANDS, STEPS, Decoder, Fault, Kind, Message, binary, line
from starhold.simulation.stepper import Stepper

KEPT = 1000
"""Number of readings whose send times are remembered, for late commands."""


class Missing(StrEnum):
    """The command in real time for a period without one: the previous command, zero, or the flight ends."""

    HOLD = "hold"
    ZERO = "zero"
    STOP = "stop"


class Ending(StrEnum):
    """The reasons for the end of a flight."""

    FLOWN = "flown to its end"
    STOPPED = "stopped by the flight software"
    GONE = "the flight software is gone"
    MISSED = "no command in time"
    DIVERGED = "the motion diverged"
    INTERRUPTED = "interrupted"


class Rules(NamedTuple):
    """steps: the control steps of the flight; rate: the ratio of simulated to real time, None for lockstep, in which the
    plant waits; missing: the command in real time for a period without one."""

    steps: int
    rate: float | None = None
    missing: Missing = Missing.HOLD


class Plant:
    """A plant commanded by flight software.

    `received` takes received bytes; `send`, which the owner sets, takes bytes to send. In real time the owner calls `tick`
    at the time `due` of `clock`. After the end, whose reason is `ending`, nothing moves."""

    def __init__(
        self, flight: Stepper, about: dict[str, Any], rules: Rules, clock: Callable[[], float] = time.perf_counter
    ) -> None:
        if not 0 < rules.steps < STEPS:
            raise ValueError(f"steps: found {rules.steps}; allowed: 1 to {STEPS - 1}")
        self.flight, self.rules, self.clock = flight, rules, clock
        self.layout = Layout(flight.loop)
        fields = [[one.name, one.size] for one in self.layout.fields]
        self._about = json.dumps(about | {"steps": rules.steps, "fields": fields})
        # Compile before the first period.
        flight.prepare()
        self._readings = flight.reset()
        self.send: Callable[[bytes], None] = lambda data: None
        self._is_text = False
        self.ending: Ending | None = None
        self.greeted = False
        self.faults = Counter[str]()
        self.latencies: list[float] = []
        """Times from sending readings to receiving the command for their step (s)."""
        self.missed = 0
        """Number of periods in real time without a command in time."""
        self.commanded = 0
        self.lateness: list[float] = []
        """The plant's own delay at the start of each period in real time (s)."""
        self._sent: dict[int, float] = {}
        self._begin()

    @property
    def due(self) -> float | None:
        """The end of the present period in real time, by `clock` (s); None in lockstep and before the first hello."""
        if self.rules.rate is None or self._begun is None or self.ending is not None:
            return None
        return self._begun + (self.flight.steps + 1) * self.flight.loop.period / self.rules.rate

    @property
    def behind(self) -> float:
        """The plant's own largest delay at the start of a period (s)."""
        return max(self.lateness, default=0.0)

    def received(self, data: bytes, decoder: Decoder) -> None:
        """Process the valid messages in these bytes of a stream, which has its own decoder."""
        for message in decoder.feed(data):
            self._heed(message, decoder)

    def datagram(self, data: bytes) -> None:
        """Process the messages in a datagram, which are complete; a line of JSON may lack its newline."""
        decoder = Decoder()
        self.received(data + b"\n" if data.startswith(b"{") else data, decoder)
        for fault in decoder.end():
            self._heed(fault, decoder)

    def tick(self) -> None:
        """Fly the period that is over, with the command received for it or by the rule for missing ones."""
        if self.due is None:
            return
        # A timer may fire early by less than its resolution.
        self.lateness.append(max(0.0, self.clock() - self.due))
        command, self._next = self._next, None
        if command is None:
            self.missed += 1
            if self.rules.missing is Missing.STOP:
                self.end(Ending.MISSED)
                return
            command = self._last if self.rules.missing is Missing.HOLD else self._nothing
        self._fly(command)

    def end(self, ending: Ending) -> None:
        """End the flight, once."""
        if self.ending is None:
            self.ending = ending
            if self.greeted and ending is not Ending.GONE:
                self._tell(Message(Kind.STOP, self.flight.steps, text=ending))

    def strange(self) -> None:
        """Count a message from another peer."""
        self.faults[Fault.STRANGER] += 1

    def _begin(self) -> None:
        self._begun = None if not self.greeted else self.clock()
        self._nothing = np.zeros(COMMANDS)
        self._last, self._next = self._nothing, None
        self._sent.clear()

    def _heed(self, message: Message | Fault, decoder: Decoder) -> None:
        if self.ending is not None:
            return
        if isinstance(message, Message) or not self.greeted:
            # Answers take the form of the last valid message.
            self._is_text = bool(decoder.is_text)
        if isinstance(message, Fault):
            self._refuse(message)
        elif message.kind is Kind.HELLO:
            self._greet()
        elif not self.greeted:
            self._refuse(Fault.ORDER)
        elif message.kind is Kind.COMMAND:
            self._command(message)
        elif message.kind is Kind.RESET:
            self._readings = self.flight.reset(*map(int, message.numbers))
            self._begin()
            self._read_out()
        else:
            self.end(Ending.STOPPED)

    def _greet(self) -> None:
        if not self.greeted:
            self.greeted = True
            self._begin()
        numbers = (self.flight.loop.period, 1 + self.layout.size, self.layout.check)
        self._tell(Message(Kind.HELLO, self.flight.steps, numbers, self._about))
        self._read_out()

    def _command(self, message: Message) -> None:
        now, wanted = self.clock(), self.flight.steps
        if message.step == wanted and self._next is None:
            self._note_latency(message.step, now)
            self.commanded += 1
            self._last = np.array(message.numbers)
            if self.rules.rate is None:
                self._fly(self._last)
            else:
                self._next = self._last
        elif message.step == wanted:
            self._refuse(Fault.DOUBLED)
        elif message.step > wanted:
            self._refuse(Fault.ORDER)
        elif self.rules.rate is None and message.step == wanted - 1:
            # If the readings were lost, the command is repeated until they arrive.
            self.faults[Fault.DOUBLED] += 1
            self._read_out()
        else:
            self._note_latency(message.step, now)
            self._refuse(Fault.LATE)

    def _note_latency(self, step: int, now: float) -> None:
        if (begun := self._sent.pop(step, None)) is not None:
            self.latencies.append(now - begun)

    def _fly(self, command: Any) -> None:
        if self.flight.steps >= self.rules.steps:
            # The last sample contains the command that comes after the end.
            self.flight.close(command)
            self.end(Ending.FLOWN)
            return
        self._readings = self.flight.step(command)
        if self.flight.diverged:
            self.end(Ending.DIVERGED)
        else:
            self._read_out()

    def _read_out(self) -> None:
        step = self.flight.steps
        self._sent[step] = self.clock()
        self._sent.pop(step - KEPT, None)
        self._tell(Message(Kind.READINGS, step, self.layout.numbers(self.flight, self._readings).tolist()))

    def _refuse(self, fault: Fault) -> None:
        self.faults[fault] += 1
        self._tell(Message(Kind.REFUSED, self.flight.steps, text=fault))

    def _tell(self, message: Message) -> None:
        self.send(line(message) if self._is_text else binary(message))


def status(plant: Plant) -> str:
    """Return one line on a flight in real time: the current step, the latest latencies and the missed periods."""
    latest = plant.latencies[-KEPT:]
    latency = f"{1e3 * np.median(latest):.3g} ms, at most {1e3 * max(latest):.3g} ms" if latest else "none yet"
    late = f"plant late by {1e3 * plant.behind:.3g} ms"
    return f"Step {plant.flight.steps}/{plant.rules.steps}: latency {latency}; missed {plant.missed}; {late}"


def summary(plant: Plant) -> list[str]:
    """Return a summary of a finished flight: its last step, the latencies, and the rejected messages."""
    flight, rules = plant.flight, plant.rules
    unit = getattr(flight.loop.body.module, "TIME_UNIT", "s")
    reason = f"Ended at step {flight.steps} of {rules.steps} ({flight.time:g} {unit}): {plant.ending}."
    lines = [f"{reason} Commands heeded: {plant.commanded}."]
    if plant.latencies:
        quantiles = 1e3 * np.quantile(plant.latencies, [0.0, 0.5, 0.99, 1.0])
        named = zip(("min", "median", "99 %", "max"), quantiles, strict=True)
        shown = ", ".join(f"{name} {value:.3g} ms" for name, value in named)
        lines.append(f"From readings to command, {len(plant.latencies)} times: {shown}.")
    if rules.rate is not None:
        lost = max(0, plant.missed - plant.faults[Fault.LATE])
        lines.append(
            f"Real time at rate {rules.rate:g}: {plant.missed} missed periods ({rules.missing}), {lost} of their commands "
            f"never came; the plant was late by {1e3 * plant.behind:.3g} ms at most."
        )
    if plant.faults:
        counted = ", ".join(f"{count} {fault}" for fault, count in sorted(plant.faults.items()))
        lines.append(f"Messages not heeded: {counted}.")
    return lines
