"""A step of a loop that Python asks for one by one: starhold's stepper beside Basilisk, on the problem of common.py.

Both are asked for one control period under a constant torque; with `state` the true state is read after each. A step of
starhold's gives the readings too, and one with `measurement` has them as the law's. The processor's time is counted,
the fastest of several rounds; the ratios are of one run. Then the same plant is served by another process, and stepped over
the loopback address in lockstep: there the clock is read.

Run: python benchmarks/stepper.py    (Basilisk is left out where `bsk` is not installed)
"""

from __future__ import annotations

import importlib.util
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import starhold as sh
from common import STEADY_LOOP, STEADY_TORQUE, header, in_basilisk, interleaved, show, verdict
from starhold.link.protocol import Decoder, Kind, Message, binary, line
from starhold.simulation.stepper import Stepper

STEPS = 2_000
GOAL = 10.0
"""Microseconds that a step may take."""
SERVED, COUNT = "three-laws", 400
"""The scenario that is served, and the steps of a round."""


@contextmanager
def served(*options: str, scenario: str = SERVED) -> Iterator[tuple[str, int]]:
    """The address of a plant that another process serves, which ends when it is left."""
    command = [sys.executable, "-m", "starhold", "serve", scenario, "--port", "0", *options]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        host, _, port = process.stdout.readline().split("//")[1].split(". ")[0].rpartition(":")
        try:
            yield host, int(port)
        finally:
            process.terminate()
            process.stdout.read()


def connected(address: tuple[str, int], udp: bool = False) -> socket.socket:
    """A socket that sends at once."""
    link = socket.socket(type=socket.SOCK_DGRAM if udp else socket.SOCK_STREAM)
    link.connect(address)
    if not udp:
        link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return link


def commanded(address: tuple[str, int], write: Callable[[Message], bytes], udp: bool) -> Callable[[], None]:
    """A round of steps in lockstep, each commanded after the readings of the one before."""
    link, decoder = connected(address, udp), Decoder(by_plant=True)

    def readings(step: int) -> None:
        while True:
            for message in decoder.feed(link.recv(2**16)):
                if isinstance(message, Message) and message.kind is Kind.READINGS and message.step == step:
                    return

    link.sendall(write(Message(Kind.HELLO)))
    readings(0)

    def fly() -> None:
        link.sendall(write(Message(Kind.RESET)))
        readings(0)
        for step in range(COUNT):
            link.sendall(write(Message(Kind.COMMAND, step, STEADY_TORQUE)))
            readings(step + 1)

    return fly


def over_a_network() -> None:
    """Print how many steps a second go over the loopback address, beside those in the process."""
    alone = sh.stepper(SERVED)

    def fly() -> None:
        alone.reset()
        for _ in range(COUNT):
            alone.step(STEADY_TORQUE)

    with served() as stream, served() as lines, served("--udp") as datagrams:
        tasks = {
            "in the process": fly,
            "TCP, frames": commanded(stream, binary, False),
            "TCP, lines of JSON": commanded(lines, line, False),
            "UDP, frames": commanded(datagrams, binary, True),
        }
        spent = interleaved(tasks)
    seconds = {name: spent[name].wall / COUNT for name in tasks}
    rows = [[name, f"{1.0 / x:.0f}", f"{1e6 * x:.1f}"] for name, x in seconds.items()]
    show([f"{SERVED}, a step commanded in lockstep", "steps a second", "us"], rows)


def main() -> None:
    """Print the table."""
    print(header("bsk"))
    single, mission = Stepper(STEADY_LOOP, record=False), sh.stepper("cubesat-mission", record=False)
    lanes = Stepper(STEADY_LOOP, lanes=1024, record=False)
    tasks: dict[str, tuple[int, Callable[[], Any]]] = {
        "starhold, its own law": (STEPS, lambda: [single.step() for _ in range(STEPS)]),
        "starhold, a command": (STEPS, lambda: [single.step(STEADY_TORQUE) for _ in range(STEPS)]),
        "starhold, a command, state": (STEPS, lambda: [(single.step(STEADY_TORQUE), single.state) for _ in range(STEPS)]),
        "starhold, a command, measurement": (STEPS, lambda: [single.step(STEADY_TORQUE).measurement for _ in range(STEPS)]),
        "starhold, cubesat-mission": (STEPS, lambda: [mission.step() for _ in range(STEPS)]),
        "starhold, 1024 lanes, a lane": (1024 * 100, lambda: [lanes.step() for _ in range(100)]),
    }
    if importlib.util.find_spec("Basilisk"):
        fly = in_basilisk("steady")
        tasks["Basilisk, a constant torque, state"] = (STEPS, lambda: [fly(1) for _ in range(STEPS)])
    spent = interleaved({name: task for name, (_, task) in tasks.items()})
    micro = {name: 1e6 * spent[name].work / count for name, (count, _) in tasks.items()}
    peer = micro.get("Basilisk, a constant torque, state")
    rows = [[name, f"{x:.2f}", "" if peer is None else f"{peer / x:.1f}"] for name, x in micro.items()]
    show(["a step asked for from Python", "us", "x Basilisk"], rows)
    over_a_network()
    least = micro["starhold, a command"]
    print(f"Microseconds a step: {least:.2f}, {verdict(least <= GOAL, GOAL)}")


if __name__ == "__main__":
    main()
