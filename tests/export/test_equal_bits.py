"""Each step of a law in C gives the bits that the simulation gives, whatever compiles it, from ordinary states and at the
edges of numbers."""

import subprocess
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from starhold.algebra.structure import leaves
from starhold.export.folder import make_files
from starhold.export.law import numbers
from starhold.export.vectors import Stepper, fresh, random_columns, with_numbers
from starhold.trace.calling import Compiled
from tests.export.flown import LAWS, STRICT, build_in, code_of, compiled, need, read, same
from tests.tiers import WHOLE, leading, seeds

FEW, MANY, BLOCK = 20_000, 200_000, 50_000
BUILDS = [("gcc", "-O3"), ("clang", "-O0")]
OTHERS = [("gcc", "-O0"), ("clang", "-O3", "-march=native")]
STATELESS = [name for name in LAWS if name != "mpc"]
MADE = [
    "estimator",
    "two trackers",
    "lqr, example 0, noise",
    "target from a table",
    "hysteresis, axis",
    "orbital target",
    "every function, the time",
    "a law that reads validity",
    "pid, example 0, noise",
    "super-twisting, example 0, noise",
    "modes that watch",
    "directions",
]
"""Loops with a memory, or with an input of their own."""


@cache
def lanes(name: str) -> tuple[Any, Any]:
    """The equations of a law's step in machine code for lanes, and the numbers of its parameters."""
    flight = code_of(name).flight
    like = (flight.parameters, flight.start, flight.inputs)
    return Compiled(flight.equation(), *like), [x for x in leaves(flight.parameters) if isinstance(x, float)]


def states(name: str, count: int, seed: int) -> tuple[Any, Any, Any]:
    """States and inputs, random, a part of them special, as rows; and what the simulation makes of them."""
    flight, rng = code_of(name).flight, np.random.default_rng(seed)
    edges = 0.02 if seed % 2 else 0.0
    begun = random_columns(rng, flight.start, count, edges)
    inputs = random_columns(rng, flight.inputs, count, edges)
    equations, parameters = lanes(name)
    fixed = np.repeat(np.array(parameters)[:, None], count, axis=1)
    return begun.T, inputs.T, equations.over(np.vstack([fixed, begun, inputs])).T


def check(name: str, count: int, seed: int, *builds: tuple[str, ...]) -> None:
    code = code_of(name)
    for k, done in enumerate(range(0, count, BLOCK)):
        part = min(BLOCK, count - done)
        begun, inputs, expected = states(name, part, seed + k)
        # C has no empty structs.
        held = begun if begun.shape[1] else np.zeros((part, 1))
        for build in builds:
            command, after = compiled(name, *build).many(held, read(code, inputs))
            same(command, expected[:, :3])
            same(after if begun.shape[1] else after[:, :0], expected[:, 3:])


@pytest.mark.parametrize("name", leading([*STATELESS, *MADE], len(STATELESS) + 6))
def test_random_and_special_states(name):
    check(name, FEW, 1, *BUILDS[: len(BUILDS) if WHOLE or name in ("wheel", "estimator") else 1])


@pytest.mark.slow
@pytest.mark.parametrize("compiler", ["gcc", "clang"])
@pytest.mark.parametrize("name", [*STATELESS, *MADE])
def test_states_of_the_day(name, compiler):
    check(name, MANY, seeds(1)[0], *(build for build in (*BUILDS, *OTHERS) if build[0] == compiler))


def test_commands_differ_from_state_to_state():
    # What is compared is not a constant.
    expected = states("wheel", 1000, 0)[2]
    assert len(np.unique(expected[:, 0])) > 900


@pytest.mark.parametrize(
    ("count", "build"),
    [(100, ("gcc", "-O1")), *(pytest.param(20_000, build, marks=pytest.mark.slow) for build in (*BUILDS, *OTHERS))],
)
def test_predictive_law(count, build):
    """The predictive law remembers its plan: from step to step, and begun anew, also with special numbers."""
    flown, rng = compiled("mpc", *build), np.random.default_rng(3)
    code = flown.code
    step, held = Stepper(code), flown.first()[None]
    state = fresh(code.flight.start)
    same(held[0], numbers(state))
    for k in range(count):
        if k % 25 == 0:
            state, held = fresh(code.flight.start), flown.first()[None]
        inputs = with_numbers(
            code.flight.inputs, random_columns(rng, code.flight.inputs, 1, 0.02 if k // 25 % 2 else 0.0)[:, 0]
        )
        command, state = step(state, inputs)
        found, held = flown.many(held, read(code, numbers(inputs))[None])
        same(found[0], numbers(command))
        same(held[0], numbers(state))


_FUZZ = """
#include "NAME.h"
#include <stdint.h>
#include <string.h>
static uint64_t next(void)
{
    static uint64_t x = UINT64_C(88172645463325252);
    x ^= x << 13;
    x ^= x >> 7;
    x ^= x << 17;
    return x;
}
int main(void)
{
    NAME_state_t state;
    NAME_input_t input;
    NAME_command_t command;
    NAME_init(&state);
    for (int k = 0; k < COUNT; k++) {
        uint64_t bits[sizeof input / 8];
        for (unsigned i = 0; i < sizeof input / 8; i++) {
            bits[i] = next();
        }
        memcpy(&input, bits, sizeof input);
        NAME_step(&state, &input, &command);
    }
    return 0;
}
"""


@pytest.mark.parametrize(
    ("name", "count", "compiler"),
    leading(
        [
            (name, count, one)
            for one in ("clang", "gcc")
            for name, count in (("estimator", 100_000), ("wheel", 100_000), ("mpc", 50))
        ]
    ),
)
def test_sanitizers_find_nothing(name, count, compiler, tmp_path):
    """Neither in the self-test nor for doubles of any bits."""
    need(compiler)
    code = code_of(name)
    for file, text in make_files(code, "test", name).files.items():
        Path(tmp_path, file).write_text(text)
    Path(tmp_path, "fuzz.c").write_text(_FUZZ.replace("NAME", code.name).replace("COUNT", str(count)))
    sanitize = ("-g", "-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
    for program in (f"{code.name}_selftest", "fuzz"):
        build_in(tmp_path, compiler, *STRICT[:4], *sanitize, "-o", program, f"{program}.c", f"{code.name}.c", "-lm")
        # Leaks are looked for by tracing, which not every machine allows; nothing is allocated.
        done = subprocess.run(
            [str(tmp_path / program)], capture_output=True, text=True, env={"ASAN_OPTIONS": "detect_leaks=0"}
        )
        assert done.returncode == 0, done.stdout + done.stderr
        assert program == "fuzz" or "steps give the bits" in done.stdout
