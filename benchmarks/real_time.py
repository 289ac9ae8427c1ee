"""A plant in real time, 10 Hz for a minute: how late it begins its periods, how long commands take, and whether it drifts.

The plant is served by another process over the loopback address; this one answers all readings at once, and looks at its own
clock as they come. A schedule that is made from the last period, and not from the first, would end later by the sum of
all latenesses.

Run: python benchmarks/real_time.py
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from common import header, show
from starhold.link.protocol import Decoder, Kind, Message, binary
from stepper import connected, served

SECONDS, RATE = 60, 1.0
"""How long is flown, and how many times faster than the clock; the scenario has a control period of 0.1 s."""


def main() -> None:
    """Print the table."""
    print(header())
    with tempfile.TemporaryDirectory() as made:
        file, out = Path(made, "minute.toml"), Path(made, "out")
        text = subprocess.run([sys.executable, "-m", "starhold", "scenarios", "three-laws"], capture_output=True, text=True)
        file.write_text("".join(f"{line}\n" if not line.startswith("duration") else f"duration = {SECONDS}\n"
                                for line in text.stdout.splitlines()))  # fmt: skip
        came: list[float] = []
        with served("--rate", f"{RATE:g}", "-o", str(out), scenario=str(file)) as address:
            link, decoder, flying = connected(address), Decoder(by_plant=True), True
            link.sendall(binary(Message(Kind.HELLO)))
            while flying and (data := link.recv(2**16)):
                now = time.perf_counter()
                for message in decoder.feed(data):
                    assert isinstance(message, Message)
                    flying = message.kind is not Kind.STOP
                    if message.kind is Kind.READINGS:
                        came.append(now)
                        link.sendall(binary(Message(Kind.COMMAND, message.step, (0.0, 0.0, 0.0))))
            link.close()
            while not (out / "timing.png").exists():
                # Written last; who leaves earlier ends the plant.
                time.sleep(0.1)
        timing = json.loads((out / "timing.json").read_text())
    seen = np.array(came) - came[0] - timing["period"] * np.arange(len(came))
    parts = {
        "the plant begins a period late by": timing["lateness"],
        "from readings to command, at the plant": timing["latencies"],
        "readings come after their time, here": seen,
    }
    quantiles = (0.0, 0.5, 0.9, 0.99, 1.0)
    rows = [[name, *(f"{1e3 * x:.3f}" for x in np.quantile(seconds, quantiles))] for name, seconds in parts.items()]
    show(["ms", "least", "median", "90 %", "99 %", "most"], rows)
    slope = np.polyfit(timing["period"] * np.arange(len(seen)), seen, 1)[0]
    print(f"{timing['periods']} periods, {timing['missed']} missed. Drift: {1e6 * slope:.2f} us a second.")


if __name__ == "__main__":
    main()
