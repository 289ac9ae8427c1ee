"""Serves a scenario's plant to flight software and keeps the flight."""

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
    """A flight commanded by flight software: its plant, with all counts, and the signal that ended it (0 for none)."""

    scenario: Scenario
    plant: Plant
    signal: int

    @property
    def ending(self) -> Ending:
        """The reason why the flight ended."""
        assert self.plant.ending is not None
        return self.plant.ending

    @property
    def lines(self) -> list[str]:
        """Sentences that describe the flight."""
        from starhold.link.plant import summary

        return summary(self.plant)

    @property
    def timing(self) -> dict[str, Any] | None:
        """The timing in real time, in seconds of the clock: the period, the latency of each command from the readings, the
        delay with which the plant began each period, and the number of periods without a command; None in lockstep."""
        plant, rate = self.plant, self.plant.rules.rate
        if rate is None:
            return None
        counts = {"periods": len(plant.lateness), "missed": plant.missed, "commands": plant.commanded}
        measured = {"latencies": plant.latencies, "lateness": plant.lateness}
        return {"rate": rate, "period": plant.flight.loop.period / rate} | counts | measured

    @cached_property
    def recording(self) -> Recording:
        """The flight since the last reset, as `simulate` records it, except the law's program, which is unknown. For
        real time an attribute states the command in periods without one."""
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
    ends: see docs/in-the-loop.md for the messages. `recording` of the result is the flight, `lines` describe it.

    law: the law whose measurement the readings contain, by default the first; port: 0 for any free one; zmq: needs the extra
    `zmq`; serial: a device such as "/dev/ttyUSB0", needs the extra `serial`; baud: its rate; rate: speed relative to the
    clock, None for lockstep; missing: "hold", "zero" or "stop", for a period of real time without a command; announce:
    called with the address; watch: called with the plant at most once per second of real time. InputError for impossible
    arguments."""
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
