"""A closed loop with the compiled C inside flies as the simulated one, bit for bit."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from starhold.export.law import numbers
from starhold.loop.kernels import make_step, numbers_of
from starhold.loop.step import make_equations
from starhold.simulation.lane import fly
from tests.export.flown import code_of, compiled, loop_of, read, same
from tests.tiers import fewer, leading

STEPS, COSTLY = 200, 12


def flown_with(name: str, steps: int) -> Any:
    """The carry at the end of a flight in plain Python whose commands come from C."""
    loop, flown = loop_of(name), compiled(name, "gcc", "-O1")
    code, held = flown.code, flown.first()[None]
    step, carry, setup = make_step(loop.composition()), loop.carry(), loop.setup()
    # Sensors, environments and random numbers are the simulation's; the law is not called: its command is written over.
    parts = loop.composition()
    law = replace(loop.law, module=_Seen(loop.law.module, torque=_nothing, control=_nothing))
    sensors = tuple(replace(part, module=_Seen(part.module, RECORDED=True)) for part in parts.sensors)
    silent = make_equations(parts._replace(law=law, sensors=sensors))
    given = code.flight.inputs._fields
    for k in range(steps):
        checked = step.check(carry, k, setup)
        told = silent.update(checked, k, (loop.seed, loop.run), loop.gains, loop.craft, setup)
        inputs = {name: getattr(checked.state, name) for name in given if name in checked.state._fields}
        if loop.used("sensor"):
            for reading in told.memories.readings:
                inputs.update({name: x for name, x in reading._asdict().items() if name in given})
        if "target" in given:
            inputs["target"] = loop.target.part.module.goal(setup.target, checked.state, k, None)
        if "wheels" in given:
            inputs["wheels"] = checked.effectors[0]
        command, held = flown.many(held, read(code, numbers(tuple(inputs[name] for name in given)))[None])
        now = tuple(command[0].tolist())
        body = loop.body.module
        carry = told._replace(command=now, state=told.state._replace(**{body.COMMAND: now}))
        for _ in range(loop.substeps):
            carry = step.propagate(carry, loop.craft, setup)
    return step.check(carry, steps, setup)


class _Seen:
    """A module with some names that mean something else."""

    def __init__(self, module: Any, **names: Any) -> None:
        self._module, self._names = module, names

    def __getattr__(self, name: str) -> Any:
        return self._names[name] if name == "RECORDED" else self._names.get(name, getattr(self._module, name))


def _nothing(measurement: Any, gains: Any, craft: Any, memory: Any) -> Any:
    return (0.0, 0.0, 0.0), memory


LOOPS = ["sliding", "wheel", "l2", "estimator", "mpc", "directions", "hysteresis, axis", "target from a table",
         "pid, example 0, noise", "lyapunov", "modal", "pd", "estimator on [sensor]", "orbital target",
         "lqr, example 1, noise", "a law that reads validity"]  # fmt: skip


@pytest.mark.parametrize("name", leading(LOOPS, 4))
def test_equals_the_simulation(name):
    steps = fewer(COSTLY if name == "mpc" else STEPS, 3)
    found, expected = flown_with(name, steps), fly(loop_of(name), steps)[1]
    same(numbers_of((found.state, found.effectors)), numbers_of((expected.state, expected.effectors)))
    assert np.isfinite(found.state.position).all()
    assert code_of(name).flight.loop is loop_of(name)
