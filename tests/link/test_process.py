"""A law in a child process flies the bits of the simulation, and one that misbehaves ends the flight in a line."""

import sys

import pytest

from starhold.errors import InputError
from starhold.link import process
from starhold.link.process import fly_by_process
from starhold.loop.kernels import numbers_of
from starhold.simulation.lane import fly
from tests.export.flown import built, code_of, loop_of, same
from tests.tiers import drawn, fewer, leading

STEPS = 400
LOOPS = ["lyapunov", "estimator", "wheel", "sun", "l2", "sliding", "yaw-steering", "target from a table", "directions",
         "estimator on [sensor]", "mission", "b_dot", "mpc", "ground-strip", "scan", "modes that watch", "modal", "pd",
         "hysteresis, axis", "pid, example 0, noise", "orbital target", "lqr, example 1, noise",
         "a law that reads validity"]  # fmt: skip


@pytest.mark.parametrize("name", drawn(LOOPS, 6, 5))
def test_exported_laws_fly_the_bits_of_the_simulation(name, tmp_path):
    steps = fewer(STEPS, 2) if name != "mpc" else 12
    samples, carry = fly_by_process(built(tmp_path, code_of(name), "-O2"), loop_of(name), steps)
    expected, at_end = fly(loop_of(name), steps)
    same(samples, expected)
    same(numbers_of((carry.state, carry.effectors)), numbers_of((at_end.state, at_end.effectors)))
    assert samples.shape[1] == steps + 1


def test_samples_are_those_of_a_run_that_records_some(tmp_path):
    flight = built(tmp_path, code_of("lyapunov"))
    for steps, every in ((30, 7), (28, 7)):
        same(fly_by_process(flight, loop_of("lyapunov"), steps, every)[0], fly(loop_of("lyapunov"), steps, every)[0])


def program(folder, text):
    """A script that says hello, and then what the text does."""
    lines = ["import os, sys, time", f"sys.path[:0] = {sys.path!r}", "from starhold.link.protocol import *"]
    lines += ["tell = lambda *about: os.write(1, binary(Message(*about)))", "tell(Kind.HELLO)", text]
    path = folder / "law.py"
    path.write_text("\n".join(lines))
    return f"{sys.executable} {path}"


@pytest.mark.parametrize(
    ("text", "found"),
    leading(
        [
            ("sys.exit(3)", "at step 0, a process that ended with 3; allowed: a command for every step"),
            ("tell(Kind.COMMAND, 0, (0.0, 0.0, float('nan'))); time.sleep(60)", "at step 0, a message that is not finite"),
            (
                "tell(Kind.COMMAND, 0, (0.0, 0.0, 0.0)); tell(Kind.COMMAND, 5, (0.0,) * 3); time.sleep(60)",
                "at step 1, a message that is out of order",
            ),
            ("os.write(1, b'hello'); time.sleep(60)", "at step 0, a message that is malformed"),
            ("tell(Kind.STOP); time.sleep(60)", "a process that stops the flight"),
            ("os.close(1); time.sleep(1)", "a process that ended with 0"),
            ("time.sleep(60)", "nothing for 2 s"),
        ],
        5,
    ),
)
def test_what_misbehaves_is_told_in_a_line(text, found, tmp_path, monkeypatch):
    monkeypatch.setattr(process, "PATIENCE", 2.0 if "nothing" in found else 60.0)
    with pytest.raises(InputError, match=r"^run: --law-process: found ") as caught:
        fly_by_process(program(tmp_path, text), loop_of("lyapunov"), 10)
    assert found in str(caught.value)


@pytest.mark.parametrize("command", ["", "'", "/nowhere/flight"])
def test_what_does_not_start_is_told_in_a_line(command):
    with pytest.raises(InputError, match="--law-process"):
        fly_by_process(command, loop_of("lyapunov"), 10)


def test_a_law_for_another_plant_says_so(tmp_path, capfd):
    flight = built(tmp_path, code_of("lyapunov"))
    with pytest.raises(InputError, match="a process that ended with 1"):
        fly_by_process(flight, loop_of("wheel"), 10)
    assert "the plant is of another scenario" in capfd.readouterr().err
