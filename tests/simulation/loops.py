"""Closed loops of every make: built-in scenarios, and one for each choice that a loop has."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from starhold.conformance.bench import random_quaternions, sample_loop
from starhold.laws.catalogue import catalogue
from starhold.loop.kernels import Numbers, form
from starhold.parts.bodies.libration_point import PRIMARIES, PointState
from starhold.parts.catalogue import fit
from starhold.parts.effectors.wheels import ALLOCATIONS
from starhold.parts.targets.history import tabulate
from starhold.scenario.building import build
from starhold.scenario.reading import builtin_names, builtin_text, load, parse
from tests.making import ORBITAL, aimed, built, noise, on_wheels, point_loop
from tests.missions import WATCHED, WATCHFUL
from tests.texts import toml

FUNCTIONS, CAUTIOUS = (str(Path(__file__).parent / f"{name}.toml") for name in ("every_function", "cautious"))
"""Scenarios of a law that uses every elementary function and the time, and whose inertia changes; of one that reads whether
its estimate is valid, and whose tracker is lost for a while."""
NOISE = noise(1e-4, 1e-3, 1e-4)
FAULT = toml("""
[[fault]] time = 30; wheel = 2; lost = true; inertia = [[7.0, 0.2, -0.1], [0.2, 8.5, 0.3], [-0.1, 0.3, 5.5]]; delay = 10
""")
"""A lost wheel, and an inertia that the law knows of ten seconds later."""


def builtin() -> dict[str, Any]:
    """The loops of the built-in scenarios, one for each kernel that they need."""
    found: dict[Any, tuple[str, Any]] = {}
    for name in builtin_names():
        scenario = load(name)
        for entry in scenario.laws:
            loop = build(scenario, entry)
            found.setdefault(kernel_of(loop), (f"{name}: {entry.name}", loop))
    return dict(found.values())


def kernel_of(loop: Any) -> Any:
    """Equal for loops that one kernel flies."""
    phase = loop.phases(1)[0]
    return loop.composition(), form(loop.carry()), form(Numbers.of(phase)), loop.substeps


def choices() -> dict[str, Any]:
    """Loops that differ from one another in one choice or the other."""
    laws = catalogue()
    plain = sample_loop(laws["lyapunov"], laws["lyapunov"].examples()[0])
    found: dict[str, Any] = {
        f"{name}, example {place}, noise": sample_loop(law, gains).with_parts(*NOISE)
        for name, law in laws.items()
        for place, gains in enumerate(law.examples())
    }
    found |= {
        f"{cover}, {kind}": replace(plain, sign_policy=cover, limit=kind)
        for cover, kind in zip(SIGN_POLICIES, KINDS, strict=True)
    }
    for name, path in (("every function, the time", FUNCTIONS), ("a law that reads validity", CAUTIOUS)):
        found[name] = built(path)
    found["orbital target"] = plain.without("target").with_parts(ORBITAL)
    times = np.arange(12) * 10.0
    table = tabulate(times, np.array(random_quaternions(12)), np.arange(1101) * plain.period)
    found["target from a table"] = plain.without("target").with_parts(aimed(table), *NOISE)
    found["lag"] = replace(plain.with_parts(fit("actuator", "lag", 0.3)), substeps=2)
    found["rate limit"] = replace(plain.with_parts(fit("actuator", "rate-limit", 0.02)), substeps=2, seed=-5)
    found["modes that watch"] = built(parse(WATCHFUL, "here"))
    found["estimators that watch"] = built(parse(WATCHED, "here"))
    found["free space"] = plain.without("environment")
    wheeled = built(parse(builtin_text("wheels-orbital") + FAULT, "here"))
    for allocation in ("least-squares", "least-peak"):
        place = ALLOCATIONS.index(allocation)
        events = tuple(event._replace(parts=tuple(_shared(f, place) for f in event.parts)) for event in wheeled.events)
        found[f"wheels with a fault, {allocation}"] = replace(on_wheels(wheeled, allocation=place), events=events)
    point = PRIMARIES["sun-earth"].point()
    for name, law in catalogue("libration-point").items():
        for model in ("linear", "nonlinear"):
            begin = PointState((0.1, 1.0, 0.2), (0.0, 0.1, -1.0), (0.0, 0.0, 0.0))
            lag = 0.0086 if model == "linear" else 0.0
            found[f"{name}, {model}"] = point_loop(point, law, law.examples()[0], begin, 1e-3, model, 4.0, lag=lag)
    return found


def _shared(fitted: Any, place: int) -> Any:
    """A part, of wheels with another allocation."""
    wheels = fitted.part.name == "wheels"
    return replace(fitted, params=fitted.params._replace(allocation=place)) if wheels else fitted


SIGN_POLICIES, KINDS = ("as_published", "shortest", "hysteresis"), ("none", "norm", "axis")
