"""Actuators: limits never exceeded and never overdone, lag and ramp as their equations say."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from starhold.algebra.structure import move
from starhold.algebra.vector import ZERO, add, cross, dot, norm, scale, subtract, unit
from starhold.parts.actuators.limits import limit_axis, limit_none, limit_norm
from tests.algebra.readers import agree, close, positives, same, small_vectors, vectors
from tests.equations import Dynamics, lagging, ramping

LIMITS = (limit_none, limit_axis, limit_norm)
RESPONSES = (lagging, ramping)


@settings(max_examples=30)
@given(vectors, vectors, vectors, positives, positives)
def test_every_reader_gives_the_same(torque, command, begun, limit, time):
    for operation in LIMITS:
        agree(operation, command, limit)
    for operation in RESPONSES:
        agree(operation, torque, command, begun, time, Dynamics(time, limit))


@settings(max_examples=50)
@given(st.tuples(*[st.floats()] * 3), st.tuples(*[st.floats()] * 3), st.tuples(*[st.floats()] * 3), positives)
def test_compiled_equals_floats_for_any_float(torque, command, begun, limit):
    for operation in (limit_none, limit_axis):
        same(operation, command, limit)
    for operation in RESPONSES:
        same(operation, torque, command, begun, 0.1, Dynamics(0.5, limit))
        same(operation, torque, command, begun, 0.1, Dynamics(0.5, math.inf))


@given(vectors, positives)
def test_axis_limit(command, limit):
    torque = limit_axis(command, limit)
    assert max(map(abs, torque)) <= limit
    assert limit_axis(torque, limit) == torque
    for given_torque, wanted in zip(torque, command, strict=True):
        assert given_torque == (wanted if abs(wanted) <= limit else math.copysign(limit, wanted))


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
def test_nothing_is_left_as_nothing(operation):
    for limit in (1e-300, 1.0, 1e300, math.inf):
        assert same(operation, ZERO, limit) == ZERO


@pytest.mark.parametrize("operation", LIMITS)
@given(vectors)
def test_an_infinite_limit_changes_nothing(operation, command):
    assert same(operation, command, math.inf) == command


@pytest.mark.parametrize("operation", LIMITS)
def test_a_lost_command_is_not_hidden(operation):
    assert any(math.isnan(x) for x in same(operation, (0.1, math.nan, 0.2), 1.0))


def run(response, torque, command, dynamics, duration, steps):
    """The torque after Runge-Kutta substeps with the command held, and the largest rate of a component."""
    h, fastest = duration / steps, 0.0
    for _ in range(steps):
        begun = torque

        def slope(u, begun=begun):
            return response(u, command, begun, h, dynamics)

        a = slope(torque)
        b = slope(move(torque, 0.5 * h, a))
        c = slope(move(torque, 0.5 * h, b))
        d = slope(move(torque, h, c))
        fastest = max([fastest] + [max(map(abs, part)) for part in (a, b, c, d) if part is not None])
        torque = move(move(move(move(torque, h / 6, a), h / 3, b), h / 3, c), h / 6, d)
    return torque, fastest


@given(small_vectors, small_vectors, st.floats(0.1, 10.0), st.floats(0.1, 3.0))
def test_lag_is_exponential(start, command, lag, lags):
    duration = lags * lag
    exact = add(command, scale(math.exp(-lags), subtract(start, command)))
    dynamics = Dynamics(lag, math.inf)
    assert close(run(lagging, start, command, dynamics, duration, 80)[0], exact, 1e-7)


def test_lag_converges_with_the_fourth_power_of_the_step():
    errors = []
    for steps in (5, 10, 20):
        found, _ = run(lagging, ZERO, (1.0, -2.0, 0.5), Dynamics(2.0, math.inf), 4.0, steps)
        errors.append(abs(found[0] - (1.0 - math.exp(-2.0))))
    assert 14.0 < errors[0] / errors[1] < 20.0
    assert 14.0 < errors[1] / errors[2] < 20.0


@given(small_vectors, small_vectors, st.floats(0.1, 5.0), st.floats(0.01, 2.0))
def test_lag_within_the_rate_limit(start, command, lag, rate_limit):
    end, fastest = run(lagging, start, command, Dynamics(lag, rate_limit), 3.0, 30)
    assert fastest <= rate_limit
    for before, after, goal in zip(start, end, command, strict=True):
        assert abs(after - before) <= 3.0 * rate_limit * (1.0 + 1e-12)
        # Nearer to the command, never beyond it.
        assert abs(goal - after) <= abs(goal - before)
        assert (goal - after) * (goal - before) >= 0.0


@given(small_vectors, small_vectors, st.floats(0.01, 5.0), st.floats(0.1, 5.0), st.integers(1, 20))
def test_ramp_goes_straight_to_the_command_at_the_rate_limit(start, command, rate_limit, duration, steps):
    end, fastest = run(ramping, start, command, Dynamics(0.0, rate_limit), duration, steps)
    assert fastest <= rate_limit
    reach = rate_limit * duration
    for before, after, goal in zip(start, end, command, strict=True):
        # A substep that can reach the command does so at its end.
        wanted = goal if abs(goal - before) <= reach else before + math.copysign(reach, goal - before)
        assert after == pytest.approx(wanted, abs=1e-13)


@given(small_vectors, small_vectors, st.floats(0.01, 5.0))
def test_ramp_without_a_limit_arrives_after_one_substep(start, command, duration):
    assert close(run(ramping, start, command, Dynamics(0.0, math.inf), duration, 1)[0], command, 1e-15)
