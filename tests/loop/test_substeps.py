"""Lags and friction are integrated finely enough, or refused."""

import math
from dataclasses import replace

import pytest

from starhold.errors import InputError
from starhold.laws.catalogue import catalogue
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.bodies.rigid_body import State
from starhold.parts.catalogue import fit
from starhold.parts.craft import make_craft
from starhold.parts.effectors.layouts import pyramid
from starhold.parts.effectors.wheels import fastest, make_wheels
from starhold.scenario.checking import RESOLVED, check_substeps
from starhold.scenario.reading import builtin_text, parse
from starhold.simulation.lane import fly
from tests.making import built, on_wheels

ZERO = (0.0, 0.0, 0.0)


def loop_of(lag: float, substeps: int) -> ClosedLoop:
    start = State((1.0, 0.0, 0.0, 0.0), (0.01, 0.0, 0.0), ZERO, ZERO, ZERO)
    law = catalogue()["pd"]
    craft = make_craft([2.0, 3.0, 4.0])
    return ClosedLoop(
        craft, law, law.gains(0.09, 0.009), start, 0.1, substeps, parts=(fit("actuator", "lag", lag),), limit="none"
    )


@pytest.mark.parametrize("lag", [0.01, 0.036, 0.05, 0.2, 1.0])
def test_the_least_substeps_follow_the_lag(lag):
    """After one control period the torque is what the exact exponential gives."""
    least = math.ceil(0.1 / (RESOLVED * lag))
    loop = loop_of(lag, least)
    check_substeps(loop, "here")
    torque = fly(loop, 1)[1].state.torque[0]
    exact = -0.09 * 0.01 * -math.expm1(-0.1 / lag)
    assert torque == pytest.approx(exact, rel=7e-4)
    if least > 1:
        with pytest.raises(InputError, match=f"at least {least} substeps"):
            check_substeps(replace(loop, substeps=least - 1), "here")


def test_coarser_ones_would_be_wrong():
    """What is refused gives another torque by far, or one that grows."""
    half = fly(loop_of(0.036, 1), 1)[1].state.torque[0]
    assert abs(half / (-0.09 * 0.01 * -math.expm1(-0.1 / 0.036)) - 1.0) > 0.2
    assert abs(fly(loop_of(0.01, 1), 20)[1].state.torque[0]) > 1.0


def test_friction_of_wheels_counts():
    wheels = make_wheels(pyramid(), 1e-4, 0.02, 0.4, viscous=1e-3, coulomb=1e-4)
    assert fastest(wheels) == pytest.approx(11.0)
    text = builtin_text("wheels-orbital")
    loop = built(parse(text, "here"))
    check_substeps(loop, "here")
    sticky = on_wheels(loop, viscous=tuple(100.0 * j for j in loop.wheels.inertia))
    with pytest.raises(InputError, match="at least 20 substeps"):
        check_substeps(sticky, "here")
