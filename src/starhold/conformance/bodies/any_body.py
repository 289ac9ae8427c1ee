"""The checks for laws of a body that is known only by the declarations of its part."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from starhold.algebra.structure import flatten, unflatten
from starhold.algebra.vector import ZERO
from starhold.analysis.any_body import measure
from starhold.conformance.verdicts import STEPS, NotApplicableError, agree, declares_itself, require, round_trips
from starhold.laws.catalogue import Law, catalogue
from starhold.loop.closed_loop import ClosedLoop
from starhold.loop.kernels import make_step
from starhold.parts.part import Fitted, Part
from starhold.scenario.building import build
from starhold.scenario.reading import parse
from starhold.scenario.writing import scenario_with
from starhold.simulation.lane import fly, label


def _loop(law: Law, gains: Any) -> ClosedLoop:
    scenario = parse(scenario_with(law, gains), law.name)
    return build(scenario, scenario.laws[0])


def loop_with(part: Part, params: Any) -> ClosedLoop:
    """Return a loop with a part, and a law installed for its body."""
    law = next(iter(catalogue(part.body).values()), None)
    if law is None:
        raise NotApplicableError(f"no law for the body {part.body} is installed")
    return _loop(law, law.examples()[0]).with_parts(Fitted(part, params))


def _measurements(loop: ClosedLoop, count: int) -> Iterator[Any]:
    """Return the measurements at the start, of zeros, and of random states of all sizes that the body counts as sound."""
    random = np.random.default_rng(1)
    body, step, carry, setup = loop.body.module, make_step(loop.composition()), loop.carry(), loop.setup()
    size = len(flatten(loop.start))
    rows = [np.array(flatten(loop.start)), np.zeros(size)]
    rows += [random.normal(size=size) * 10.0 ** random.uniform(-9.0, 1.0) for _ in range(count)]
    for row in rows:
        state = body.renormalised(unflatten(row, loop.start)._replace(**{body.COMMAND: ZERO}))
        if body.is_sound(state, setup):
            yield step.measure(carry._replace(state=state), 0, (loop.seed, 0), loop.craft, setup)


def _call(loop: ClosedLoop, measurement: Any) -> Any:
    memory = loop.law.remember(loop.gains, loop.craft, loop.period)
    return loop.law.command(measurement, loop.gains, loop.craft, memory)[0]


def is_pure(law: Law) -> None:
    """The command depends on nothing but its arguments."""
    for gains in law.examples():
        loop = _loop(law, gains)
        for measurement in _measurements(loop, 10):
            require(_call(loop, measurement) == _call(loop, measurement), f"two calls differ at {measurement}")


def stays_finite(law: Law) -> None:
    """The command is finite at sound states, near and far."""
    for gains in law.examples():
        loop = _loop(law, gains)
        for measurement in _measurements(loop, 200):
            require(bool(np.isfinite(_call(loop, measurement)).all()), f"not finite at {measurement}")


def reads_alike(law: Law) -> None:
    """Plain Python, one lane and every lane of a batch agree bit for bit."""
    for gains in law.examples():
        loop = _loop(law, gains)
        agree(loop, [loop.start] * 3, range(3))


def survives_toml(law: Law) -> None:
    """Gains written to a scenario file and read back are the same; unknown keys are refused."""
    round_trips(law, scenario_with, parse)


def flies_a_scenario(law: Law) -> None:
    """It flies from a scenario file and is measured; the motion does not diverge."""
    for gains in law.examples():
        loop = _loop(law, gains)
        lost = measure(label(loop, *fly(loop, STEPS), 1))["diverged_at"]
        require(lost is None, f"the motion is lost at {lost}")


CHECKS = (declares_itself, is_pure, stays_finite, reads_alike, survives_toml, flies_a_scenario)
