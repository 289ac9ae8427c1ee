"""Actuators: limits are projections that are never exceeded, and slopes are those of their equations in NumPy."""

import math

import numpy as np
import pytest
from hypothesis import given

from starhold.algebra.vector import ZERO, cross, dot, norm, subtract, unit
from starhold.parts.actuators import lag, rate_limit
from starhold.parts.actuators.limits import limit_axis, limit_none, limit_norm
from tests.algebra.readers import close, positives, same, vectors

LIMITS = (limit_none, limit_axis, limit_norm)


@given(vectors, positives)
def test_axis_limit(command, limit):
    assert limit_axis(command, limit) == tuple(np.clip(command, -limit, limit))


@given(vectors, positives)
def test_norm_limit(command, limit):
    torque = limit_norm(command, limit)
    assert norm(torque) <= limit * (1.0 + 4e-16)
    assert close(limit_norm(torque, limit), torque, 4e-16 * limit)
    if norm(command) <= limit:
        assert torque == command
    else:
        assert norm(torque) >= limit * (1.0 - 4e-16)
        assert close(cross(unit(torque), unit(command)), ZERO, 4e-16)
        assert dot(torque, command) > 0.0


@given(vectors, vectors, positives)
def test_limits_are_projections(a, b, limit):
    # Onto a convex set: two commands never get farther apart, and no allowed torque is nearer to the command.
    for operation in (limit_axis, limit_norm):
        p, q = operation(a, limit), operation(b, limit)
        room = 1e-15 * (norm(a) + norm(b))
        assert norm(subtract(p, q)) <= norm(subtract(a, b)) + room
        assert norm(subtract(p, a)) <= norm(subtract(q, a)) + room


@pytest.mark.parametrize("operation", LIMITS)
def test_nothing_stays_nothing_an_infinite_limit_changes_nothing_and_a_lost_command_is_not_hidden(operation):
    for limit in (1e-300, 1.0, 1e300, math.inf):
        assert same(operation, ZERO, limit) == ZERO
    for command in ((1e6, -0.1, 1e-6), (-3.0, 4.0, 0.0)):
        assert same(operation, command, math.inf) == command
    assert any(math.isnan(x) for x in same(operation, (0.1, math.nan, 0.2), 1.0))


@given(vectors, vectors, vectors, positives, positives)
def test_slopes_are_clipped_gaps_over_the_time(torque, command, begun, time, limit):
    for found, start in (
        (lag.rates(torque, command, begun, 0.1, lag.Params(time, limit)), torque),
        (rate_limit.rates(torque, command, begun, time, rate_limit.Params(limit)), begun),
    ):
        assert found == pytest.approx(np.clip(np.subtract(command, start) / time, -limit, limit), rel=1e-12)
