"""A scenario's plant is served to flight software, and what it flew is kept."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from starhold.errors import InputError, shortly
from starhold.scenario.building import build
from starhold.scenario.reading import Scenario, open_scenario
from starhold.studies.compare import commanded_by, name_samples

if TYPE_CHECKING:
    from starhold.link.plant import Ending, Plant
    from starhold.simulation.lane import Recording


@dataclass(frozen=True)
class Served:
    """A flight that flight software commanded: its plant, with all counts, and the signal that ended it (0 for none)."""

    scenario: Scenario
    plant: Plant
    signal: int

    @property
    def ending(self) -> Ending:
        """Why it ended."""
        assert self.plant.ending is not None
        return self.plant.ending

    @property
    def lines(self) -> list[str]:
        """Sentences that tell how it went."""
        from starhold.link.plant import summary

        return summary(self.plant)

    @property
    def timing(self) -> dict[str, Any] | None:
        """How well real time was kept, in seconds of the clock: the period, of each command its latency from the readings,
        of each period how late the plant began it, and how many periods had no command; None in lockstep."""
        plant, rate = self.plant, self.plant.rules.rate
        if rate is None:
            return None
        counts = {"periods": len(plant.lateness), "missed": plant.missed, "commands": plant.commanded}
        measured = {"latencies": plant.latencies, "lateness": plant.lateness}
        return {"rate": rate, "period": plant.flight.loop.period / rate} | counts | measured

    @cached_property
    def recording(self) -> Recording:
        """The flight since the last reset, as `simulate` records it, but for the program of the law, which nobody knows. Of
        one in real time an attribute says what flew a period without a command."""
        flight, every, rules = self.plant.flight, self.scenario.table.simulation.record_every, self.plant.rules
        run = commanded_by("a peer", name_samples(self.scenario, flight.loop, *flight.samples(every)))
        return run if rules.rate is None else replace(run, attrs=run.attrs | {"without_command": rules.missing.value})


@shortly
def serve(
    scenario: Scenario | str | Path,
    law: str | None = None,
    *,
    host: str = "127.0.0.1",
    port: int = 5750,
    udp: bool = False,
    zmq: bool = False,
    serial: str | None = None,
    baud: int = 115200,
    rate: float | None = None,
    missing: str = "hold",
    announce: Callable[[str], None] | None = None,
    watch: Callable[[Plant], None] | None = None,
) -> Served:
    """Serve a scenario's plant on TCP, UDP, ZeroMQ or a serial line to flight software that commands it, until its flight
    ends: see docs/in-the-loop.md for the messages. `recording` of the result is the flight, `lines` tell how it went.

    law: whose measurement readings have, the first if None; port: 0 for any that is free; zmq: extra `zmq`; serial: a device
    such as "/dev/ttyUSB0", extra `serial`, with its baud rate; rate: how many times faster than the clock, None for
    lockstep; missing: "hold", "zero" or "stop", for a period of real time without a command; announce: called with the
    address; watch: called with the plant at most once a second of real time. InputError for what cannot be."""
    from starhold.link import server
    from starhold.link.plant import Missing, Plant, Rules
    from starhold.link.serial_line import serial_line
    from starhold.link.zeromq import zeromq
    from starhold.simulation.stepper import Stepper

    opened = open_scenario(scenario)
    entry = opened.pick(law)
    if not 0 <= port < 65536:
        raise InputError("serve", "--port", str(port), "0 to 65535")
    given = [option for option, there in (("--udp", udp), ("--zmq", zmq), ("--serial", serial is not None)) if there]
    if len(given) > 1:
        raise InputError("serve", given[1], f"{given[0]} too", "one of the two")
    if missing not in list(Missing):
        raise InputError("serve", "--missing", missing, f"one of {', '.join(Missing)}")
    if rate is not None and not 0.0 < rate < float("inf"):
        raise InputError("serve", "--rate", f"{rate:g}", "a finite number above 0: how many times faster than the clock")
    loop = build(opened, entry)
    unit = getattr(loop.body.module, "TIME_UNIT", "s")
    if rate is not None and unit != "s":
        raise InputError(
            "serve", "--rate", f"a scenario whose time is in {unit}", "one in seconds, or lockstep without --rate"
        )
    about: dict[str, Any] = {"scenario": opened.name, "law": entry.name}
    about["digest"] = hashlib.sha256(opened.text.encode()).hexdigest()
    plant = Plant(Stepper(loop), about, Rules(opened.table.simulation.steps, rate, Missing(missing)))

    def listen(line: server.Line) -> Any:
        if serial is not None:
            return serial_line(line, serial, baud)
        return (server.udp if udp else zeromq if zmq else server.tcp)(line, host, port)

    return Served(opened, plant, server.serve(plant, listen, announce, watch))
