"""Closed loops of every make: built-in scenarios, and one for each choice that a loop has."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from starhold.conformance.bench import random_quaternions, sample_loop
from starhold.laws.catalogue import catalogue
from starhold.laws.catalogue import catalogue
from starhold.loop.kernels import Numbers, form
from starhold.loop.station import StationLoop
from starhold.parts.actuators.dynamics import Dynamics
from starhold.parts.bodies.libration_point import PRIMARIES, PointState
from starhold.parts.sensors.gaussian import Noise
from starhold.parts.targets.target import tabulate
from starhold.scenario.building import build
from starhold.scenario.opening import open_scenario
from starhold.scenario.reading import builtin_names, builtin_text, parse
from starhold.studies.kinds import kind_of

NOISE = Noise(1e-4, 1e-3, 1e-4)
FAULT = """
[[fault]]
time = 30
wheel = 2
lost = true
inertia = [[7.0, 0.2, -0.1], [0.2, 8.5, 0.3], [-0.1, 0.3, 5.5]]
delay = 10
"""
"""A lost wheel, and an inertia that the law knows of ten seconds later."""


def builtin() -> dict[str, Any]:
    """The loops of the built-in scenarios, one for each kernel that they need."""
    found: dict[Any, tuple[str, Any]] = {}
    for name in builtin_names():
        scenario = open_scenario(name)
        for entry in scenario.laws:
            loop = kind_of(scenario).build(scenario, entry)
            found.setdefault(kernel_of(loop), (f"{name}: {entry.name}", loop))
    return dict(found.values())


def kernel_of(loop: Any) -> Any:
    """Equal for loops that one kernel flies."""
    phase = loop.phases(1)[0]
    return loop.parts(), form(loop.carry()), form(Numbers(phase.gains, phase.known, phase.craft, phase.setup)), loop.substeps


def choices() -> dict[str, Any]:
    """Loops that differ from one another in one choice or the other."""
    laws = catalogue()
    plain = sample_loop(laws["lyapunov"], laws["lyapunov"].examples()[0])
    found: dict[str, Any] = {
        f"{name}, example {place}, noise": replace(sample_loop(law, gains), noise=NOISE)
        for name, law in laws.items()
        for place, gains in enumerate(law.examples())
    }
    found |= {
        f"{cover}, {kind}": replace(plain, sign_policy=cover, limit=kind)
        for cover, kind in zip(SIGN_POLICIES, KINDS, strict=True)
    }
    found["orbital target"] = replace(plain, target="orbital")
    times = np.arange(12) * 10.0
    table = tabulate(times, np.array(random_quaternions(12)), np.arange(1101) * plain.period)
    found["target from a table"] = replace(plain, target=table, noise=NOISE)
    found["lag"] = replace(plain, dynamics=Dynamics(0.3, np.inf), substeps=2)
    found["rate limit"] = replace(plain, dynamics=Dynamics(0.0, 0.02), substeps=2, seed=-5)
    found["free space"] = replace(plain, orbit=False, gravity_gradient=False)
    scenario = parse(builtin_text("wheels-orbital") + FAULT, "here")
    wheeled = build(scenario, scenario.laws[0])
    for allocation in ("least-squares", "least-peak"):
        found[f"wheels with a fault, {allocation}"] = replace(wheeled, allocation=allocation)
    point = PRIMARIES["sun-earth"].point()
    for name, law in catalogue("libration-point").items():
        for model in ("linear", "nonlinear"):
            begin = PointState((0.1, 1.0, 0.2), (0.0, 0.1, -1.0), (0.0, 0.0, 0.0))
            lag = 0.0086 if model == "linear" else 0.0
            found[f"{name}, {model}"] = StationLoop(point, law, law.examples()[0], begin, 1e-3, 1, model, 4.0, lag=lag)
    return found


SIGN_POLICIES, KINDS = ("as_published", "shortest", "hysteresis"), ("none", "norm", "axis")
