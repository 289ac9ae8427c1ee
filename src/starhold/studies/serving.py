"""A scenario's plant is served to flight software, and what it flew is kept."""

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from starhold.errors import InputError
from starhold.link.plant import Ending, Missing, Plant, Rules, summary
from starhold.link.server import serve
from starhold.scenario.building import build
from starhold.scenario.reading import Scenario
from starhold.simulation.lane import Recording
from starhold.simulation.stepper import Stepper
from starhold.studies.compare import commanded_by, name_samples


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
        return summary(self.plant)

    @cached_property
    def recording(self) -> Recording:
        """The flight since the last reset, as `simulate` records it, but for the program of the law, which nobody knows."""
        flight, every = self.plant.flight, self.scenario.table.simulation.record_every
        return commanded_by("a peer", name_samples(self.scenario, flight.loop, *flight.samples(every)))


def serve_plant(
    scenario: Scenario,
    law: str | None,
    host: str,
    port: int,
    udp: bool,
    rate: float | None,
    missing: str,
    announce: Callable[[str], None] | None,
) -> Served:
    """Serve a scenario's plant until its flight ends. InputError for arguments that cannot be."""
    entry = scenario.pick(law)
    if not 0 <= port < 65536:
        raise InputError("serve", "--port", str(port), "0 to 65535")
    if missing not in list(Missing):
        raise InputError("serve", "--missing", missing, f"one of {', '.join(Missing)}")
    if rate is not None and not 0.0 < rate < float("inf"):
        raise InputError("serve", "--rate", f"{rate:g}", "a finite number above 0: how many times faster than the clock")
    loop = build(scenario, entry)
    unit = getattr(loop.body.module, "TIME_UNIT", "s")
    if rate is not None and unit != "s":
        raise InputError(
            "serve", "--rate", f"a scenario whose time is in {unit}", "one in seconds, or lockstep without --rate"
        )
    about: dict[str, Any] = {"scenario": scenario.name, "law": entry.name}
    about["digest"] = hashlib.sha256(scenario.text.encode()).hexdigest()
    plant = Plant(Stepper(loop), about, Rules(scenario.table.simulation.steps, rate, Missing(missing)))
    return Served(scenario, plant, serve(plant, host, port, udp, announce))
