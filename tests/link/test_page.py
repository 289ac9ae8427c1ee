"""The page about flights in the loop says what the code does, and its clients fly."""

import re
import subprocess
from pathlib import Path

import numpy as np

import starhold as sh
from starhold.link.plant import Ending
from starhold.link.protocol import MAGIC, RULES, VERSION, Fault
from tests.export.flown import STRICT, build_in, need
from tests.link.clients import PATIENCE, served
from tests.running import starhold

SCENARIO = "three-laws-noise"
PAGE = (Path(__file__).parents[2] / "docs" / "in-the-loop.md").read_text(encoding="utf-8")


def block(language, place):
    return re.findall(rf"```{language}\n(.*?)```", PAGE, flags=re.DOTALL)[place]


def test_the_page_lists_every_kind_of_message_and_fault():
    rows = [
        f"| {kind.value} | `{kind.name.lower()}` | {rule.software or '-'} | {rule.plant or '-'} | {rule.numbers} |"
        for kind, rule in RULES.items()
    ]
    assert "\n".join(rows) in PAGE
    assert f"| 4 | `{MAGIC.decode()}` |\n| 1 | version, {VERSION} |" in PAGE
    assert [fault for fault in Fault if fault not in " ".join(PAGE.split())] == []


def flown_in_process(scenario, steps):
    """The truth after so many steps under the damping that the clients of the page command."""
    flight = sh.stepper(scenario)
    readings = flight.reset()
    for _ in range(steps):
        readings = flight.step([-0.01 * w for w in readings.measurement.rate])
    return flight.truth


def check_client(fly):
    steps = 40
    whole = sh.load(SCENARIO)
    scenario = whole.with_({"simulation.duration": steps * whole.table.simulation.control_period})
    with served(scenario) as (address, results):
        fly(address.rsplit(":", 1)[1])
    result = results.get()
    assert result.ending is Ending.FLOWN
    assert not result.plant.faults
    assert np.array_equal(result.plant.flight.truth, flown_in_process(scenario, steps))


def test_the_client_in_python_flies():
    check_client(lambda port: exec(block("python", 1).replace("5750", port), {}))


def test_the_client_in_c_flies(tmp_path):
    need("gcc")
    starhold("export", "link", SCENARIO, "-o", "starhold_link.h", cwd=tmp_path, code=0)
    (tmp_path / "client.c").write_text(block("c", 0))
    strict = [flag for flag in STRICT if flag != "-std=c99"]
    # Sockets are POSIX.
    build_in(tmp_path, "gcc", "-std=c99", "-D_POSIX_C_SOURCE=200809L", *strict, "-o", "client", "client.c")
    check_client(lambda port: subprocess.run([tmp_path / "client", port], check=True, timeout=PATIENCE))
