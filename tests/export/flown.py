"""Laws as C, compiled here, and what calls them."""

import ctypes
import shutil
import subprocess
import tempfile
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from starhold.export.code import Code, make_code
from starhold.export.shells import shell_files
from starhold.export.source import texts
from starhold.export.vectors import kept_inputs
from starhold.parts.catalogue import find, fit, telling
from starhold.parts.estimators import mekf
from starhold.parts.part import Fitted
from starhold.scenario.building import build
from starhold.scenario.reading import load
from tests.simulation.loops import choices

STRICT = ("-std=c99", "-Wall", "-Wextra", "-pedantic", "-Wshadow", "-Wconversion", "-Werror", "-ffp-contract=off")
LAWS = {
    "lyapunov": ("three-laws", "lyapunov"),
    "sliding": ("three-laws", "sliding"),
    "mpc": ("three-laws", "mpc"),
    "wheel": ("wheels-orbital", "wheel"),
    "modal": ("landing", "fit"),
    "pd": ("geostationary", "pd"),
    "l2": ("l2-circle", "smooth"),
    "l2_nonlinear": ("l2-nonlinear", "full model"),
    "b_dot": ("cubesat-detumble", "b-dot"),
    "mission": ("cubesat-mission", "mission"),
}
"""Names in C: built-in scenario and law."""
CLOCKED: dict[str, tuple[Any, ...]] = {
    "sun": (),
    "yaw-steering": (),
    "ground-strip": (0.1, 0.0, 0.3, -0.1, 20.0, 100.0),
    "scan": (0.2, 60.0, 1),
}
"""Targets that depend on the time."""


class Flown(NamedTuple):
    """A law in C that was compiled: its code and the library."""

    code: Code
    library: Any

    def many(self, states: Any, inputs: Any) -> tuple[Any, Any]:
        """The commands and the states after a step of each of many, all as rows of the numbers that C has."""
        states, inputs = np.ascontiguousarray(states), np.ascontiguousarray(inputs)
        commands, after = np.empty((len(inputs), 3)), states.copy()
        self.library.many(ctypes.c_long(len(inputs)), *(ctypes.c_void_p(x.ctypes.data) for x in (after, inputs, commands)))
        return commands, after

    def first(self) -> Any:
        """The numbers of the state at the start."""
        found = np.empty(int(self.library.state_size()))
        self.library.begin(ctypes.c_void_p(found.ctypes.data))
        return found


_DRIVER = """
#include "NAME.h"
#include <string.h>
long state_size(void);
void begin(double *state);
void many(long count, double *states, const double *inputs, double *commands);
long state_size(void) { return (long)(sizeof(NAME_state_t) / sizeof(double)); }
void begin(double *state)
{
    NAME_state_t now;
    NAME_init(&now);
    memcpy(state, &now, sizeof now);
}
void many(long count, double *states, const double *inputs, double *commands)
{
    for (long k = 0; k < count; k++) {
        NAME_state_t state;
        NAME_input_t input;
        NAME_command_t command;
        memcpy(&state, (char *)states + (unsigned long)k * sizeof state, sizeof state);
        memcpy(&input, (const char *)inputs + (unsigned long)k * sizeof input, sizeof input);
        NAME_step(&state, &input, &command);
        memcpy((char *)states + (unsigned long)k * sizeof state, &state, sizeof state);
        memcpy((char *)commands + (unsigned long)k * sizeof command, &command, sizeof command);
    }
}
"""


def need(*programs: str) -> None:
    """Skip the test where one of these is not installed."""
    for program in programs:
        if shutil.which(program) is None:
            pytest.skip(f"{program} is not installed")


@cache
def loop_of(name: str) -> Any:
    """The loop of a law: of a built-in scenario, or one of those that differ in one choice."""
    if name == "estimator on [sensor]":
        noisy = fit("sensor", "gaussian", 1e-4, 1e-5)
        return choices()["target from a table"].with_parts(noisy, fit("estimator", "complementary-filter", 0.1, 0.01))
    if name in ("estimator", "two trackers", "directions"):
        loop = choices()["target from a table"].without("sensor")
        tracker, gyro = (
            fit("sensor", "star-tracker", 1e-4, 5e-4, (0.0, 0.6, 0.8), 1.0),
            fit("sensor", "gyro", 1e-5, (1e-4, -1e-4, 2e-4)),
        )
        loop = loop.with_parts(tracker, gyro, fit("estimator", "complementary-filter", 0.1, 0.01))
        if name == "directions":
            filtered = Fitted(find("estimator", "mekf"), mekf.examples()[2])
            # The place is one input, and the law's is the true one.
            sensors = telling(sorted({*filtered.needs} - {"attitude", "rate", "position"}))
            return loop.without("estimator").with_parts(fit("sensor", "gnss"), *sensors, filtered)
        second = fit("sensor", "star-tracker", 2e-4, 3e-4, called="second")
        return replace(loop, parts=(*loop.parts, second)) if name == "two trackers" else loop
    if name in CLOCKED:
        return choices()["orbital target"].without("target").with_parts(fit("target", name, *CLOCKED[name]))
    if name not in LAWS:
        return choices()[name]
    scenario = load(LAWS[name][0])
    return build(scenario, scenario.pick(LAWS[name][1]))


@cache
def code_of(name: str) -> Code:
    """The code of a law."""
    return make_code(loop_of(name), name if name in LAWS else "law")


@cache
def compiled(name: str, compiler: str = "gcc", *flags: str) -> Flown:
    """A law, compiled."""
    need(compiler)
    code = code_of(name)
    with tempfile.TemporaryDirectory() as folder:
        put(folder, code)
        Path(folder, "driver.c").write_text(_DRIVER.replace("NAME", code.name))
        build_in(folder, compiler, *STRICT, *flags, "-shared", "-fPIC", "-o", "law.so", f"{code.name}.c", "driver.c", "-lm")
        library = ctypes.CDLL(str(Path(folder, "law.so")))
    library.state_size.restype = ctypes.c_long
    return Flown(code, library)


def put(folder: Any, code: Code, *shells: str) -> None:
    """Write a law and shells over it into a folder."""
    text = texts(code, "test", code.name)
    made = {f"{code.name}.h": text.header, f"{code.name}.c": text.source, **shell_files(code, shells)}
    for place, content in made.items():
        Path(folder, place).parent.mkdir(parents=True, exist_ok=True)
        Path(folder, place).write_bytes(content if isinstance(content, bytes) else content.encode())


def build_in(folder: Any, *command: Any) -> None:
    """Run a compiler in a folder."""
    done = subprocess.run([*map(str, command)], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, (command, done.stderr[:2000])


def built(folder: Any, code: Code, *flags: str, compiler: str = "gcc") -> str:
    """A law as a program that commands, compiled."""
    need(compiler)
    put(folder, code, "process")
    build_in(folder, compiler, *STRICT, *flags, "-o", "flight", f"{code.name}.c", f"{code.name}_process.c", "-lm")
    return str(Path(folder, "flight"))


def read(code: Code, inputs: Any) -> Any:
    """The numbers that C has of rows of all numbers of the inputs."""
    return np.asarray(inputs)[..., kept_inputs(code)]


def same(found: Any, expected: Any) -> None:
    """Assert equal bits; any NaN equals any NaN."""
    a, b = (np.where(np.isnan(x), np.nan, x).view(np.uint64) for x in (np.asarray(found), np.asarray(expected)))
    assert np.array_equal(a, b), np.argwhere(a != b)[:5]
