"""Reaction wheels: allocation against linear algebra and linear programs, motion against the conservation laws."""

import itertools
import math

import numpy as np
import pytest
from flint import fmpq
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from starhold.algebra.polynomial import Polynomial, constants, pieces
from starhold.algebra.quaternion import derivative, renormalise, to_reference
from starhold.algebra.structure import flatten, leaves, move, unflatten
from starhold.algebra.structured import Buffer, repeat
from starhold.algebra.vector import add, apply, dot, gyroscopic_torque, inverse, scale, subtract
from starhold.parts.craft import bare_inertia, matrix
from starhold.parts.effectors.layouts import nasa_standard, pyramid, three_orthogonal
from starhold.parts.effectors.wheel_units import WHEEL_UNITS
from starhold.parts.effectors.wheels import (
    BAND,
    CREEP,
    allocate,
    allocate_peak,
    available,
    axial_inertia,
    lose,
    make_wheels,
    motor,
    on_body,
    wheel_momentum,
    with_facets,
)
from starhold.trace.calling import Compiled
from starhold.trace.machine import load
from starhold.trace.recording import Recorder
from tests.algebra.readers import agree, same

finite = st.floats(-1.0, 1.0)
torques = st.tuples(finite, finite, finite)
HEXAGON = tuple((math.cos(a), math.sin(a), 0.7) for a in np.arange(6) * math.pi / 3.0)
DEGENERATE = {
    "four in a plane": (*three_orthogonal(), (1.0, 1.0, 0.0), (1.0, -2.0, 0.0)),
    "two planes": (*three_orthogonal(), (1.0, 1.0, 0.0), (0.0, 1.0, 1.0), (1.0, 2.0, 1.0)),
    "doubled": three_orthogonal() * 2,
    "opposed": (*three_orthogonal(), (-1.0, 0.0, 0.0), (0.0, 0.0, 2.0)),
    "doubled in a plane": (*three_orthogonal(), (1.0, 1.0, 0.0), (1.0, 0.0, 0.0), (-1.0, -1.0, 0.0)),
    "nearly parallel": (*three_orthogonal(), (1.0, 1e-5, 0.0), (1.0, 1.0, 1e-6)),
}
LAYOUTS = {"orthogonal": three_orthogonal(), "pyramid": pyramid(), "nasa": nasa_standard(), "hexagon": HEXAGON, **DEGENERATE}


def simple(axes, **more):
    return with_facets(make_wheels(axes, **{"inertia": 0.01, "torque_limit": 0.1, "momentum_limit": 5.0} | more))


def random_axes(seed, count):
    return np.random.default_rng(seed).normal(size=(count, 3))


def random_wheels(seed, count):
    try:
        return simple(random_axes(seed, count))
    except ValueError:
        assume(False)
        raise


def least_peak(axes, torque):
    """The optimum of: minimise t, -sum a_i tau_i = torque, |tau_i| <= t."""
    n = len(axes)
    sides = np.vstack([np.hstack([np.eye(n), -np.ones((n, 1))]), np.hstack([-np.eye(n), -np.ones((n, 1))])])
    given_torque = np.hstack([-np.array(axes).T, np.zeros((3, 1))])
    found = linprog([0.0] * n + [1.0], sides, np.zeros(2 * n), given_torque, torque, (None, None), method="highs")
    assert found.success
    return found.fun


def total(taus, wheels):
    return -np.array(taus) @ np.array(wheels.axes)


@settings(max_examples=60)
@given(st.integers(0, 10**6), st.integers(3, 6), torques)
def test_least_squares_is_the_pseudoinverse(seed, count, torque):
    wheels = random_wheels(seed, count)
    taus = allocate(torque, wheels)
    matrix_ = np.array(wheels.axes).T
    room = 1e-14 * np.linalg.cond(matrix_) ** 2
    np.testing.assert_allclose(total(taus, wheels), torque, rtol=0.0, atol=room)
    np.testing.assert_allclose(taus, -np.linalg.pinv(matrix_) @ np.array(torque), rtol=0.0, atol=room)


@settings(max_examples=120)
@given(st.integers(0, 10**6), st.integers(3, 7), torques)
def test_least_peak_is_the_optimum_of_the_linear_program(seed, count, torque):
    assume(max(map(abs, torque)) > 1e-3)
    wheels = random_wheels(seed, count)
    taus = allocate_peak(torque, wheels)
    condition = np.linalg.cond(np.array(wheels.axes))
    np.testing.assert_allclose(total(taus, wheels), torque, rtol=0.0, atol=1e-13 * condition**2)
    assert max(map(abs, taus)) == pytest.approx(least_peak(wheels.axes, torque), rel=1e-7, abs=1e-9)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_least_peak_of_special_layouts(layout):
    wheels = simple(LAYOUTS[layout])
    signs = [np.array(s, dtype=float) for s in itertools.product((-1, 0, 1), repeat=3) if any(s)]
    some = [*signs, *random_axes(1, 60), *np.array(wheels.axes)]
    for torque in some:
        taus = allocate_peak(tuple(torque.tolist()), wheels)
        np.testing.assert_allclose(total(taus, wheels), torque, rtol=0.0, atol=1e-9 if "nearly" in layout else 1e-13)
        assert max(map(abs, taus)) == pytest.approx(least_peak(wheels.axes, torque), rel=1e-8)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_least_peak_is_odd_and_continuous(layout):
    wheels = simple(LAYOUTS[layout])
    steepest = 1e6 if "nearly" in layout else 20.0
    ends = random_axes(2, 12)
    for a, b in itertools.pairwise(ends):
        way = [tuple((a + (b - a) * s).tolist()) for s in np.linspace(0.0, 1.0, 400)]
        taus = np.array([allocate_peak(torque, wheels) for torque in way])
        assert np.abs(np.diff(taus, axis=0)).max() <= steepest * np.linalg.norm(b - a) / 400
        np.testing.assert_allclose(allocate_peak(tuple(-x for x in way[7]), wheels), -taus[7], rtol=0.0, atol=1e-12)


def test_where_the_peak_leaves_a_choice_the_next_largest_is_least_too():
    """A torque mostly along z, whose one wheel sets the peak: the four in the xy plane share the rest with a peak of
    their own."""
    axes = (*three_orthogonal(), (1.0, 1.0, 0.0), (1.0, -2.0, 0.0))
    wheels = simple(axes)
    taus = allocate_peak((0.3, 0.1, 5.0), wheels)
    assert abs(taus[2]) == pytest.approx(5.0)
    flat = [0, 1, 3, 4]
    inner = linprog_in_plane(np.array(wheels.axes)[flat, :2], (0.3, 0.1))
    assert max(abs(taus[k]) for k in flat) == pytest.approx(inner, rel=1e-9)


def linprog_in_plane(axes, torque):
    lifted = np.vstack([np.hstack([axes, np.zeros((len(axes), 1))]), [[0.0, 0.0, 1.0]]])
    return least_peak(lifted, (*torque, 0.0))


def test_parallel_wheels_share_alike():
    taus = allocate_peak((0.4, 0.0, 0.2), simple(DEGENERATE["doubled"]))
    assert taus == pytest.approx((-0.2, 0.0, -0.1, -0.2, 0.0, -0.1))
    taus = allocate_peak((0.4, 0.1, 0.2), simple(DEGENERATE["opposed"]))
    assert taus == pytest.approx((-0.2, -0.1, -0.1, 0.2, -0.1))


def test_layouts():
    axes = np.array(pyramid())
    np.testing.assert_allclose(axes.T @ axes, np.eye(3) * 4.0 / 3.0, atol=1e-15)
    for layout in (three_orthogonal(), pyramid(), pyramid(0.3), nasa_standard()):
        np.testing.assert_allclose(np.linalg.norm(layout, axis=1), 1.0, rtol=1e-15)
    skewed = np.array(nasa_standard())
    np.testing.assert_allclose(skewed[:3] @ skewed[3], np.sqrt(1.0 / 3.0))
    assert np.array(pyramid(0.3))[:, 2] == pytest.approx(math.sin(0.3))
    # The pyramid serves the body axes alike: half of the wheels' strength more than three orthogonal ones.
    wheels = simple(pyramid())
    for axis in np.eye(3).tolist():
        assert max(map(abs, allocate_peak(tuple(axis), wheels))) == pytest.approx(math.sqrt(3.0) / 4.0)
    for elevation in (0.0, -0.1, 2.0, math.nan):
        with pytest.raises(ValueError, match="elevation"):
            pyramid(elevation)


# What compiled code and the other readers make of the equations.


def everything(torque, momentum, rate, wheels):
    first = allocate(torque, wheels)
    h_rate = motor(first, momentum, rate, wheels)
    peak = allocate_peak(torque, wheels)
    return first, peak, h_rate, motor(peak, momentum, rate, wheels), on_body(h_rate, momentum, rate, wheels)


@pytest.mark.parametrize("layout", ["orthogonal", "pyramid", "four in a plane"])
def test_compiled_code_gives_the_same_bits(layout):
    wheels = simple(LAYOUTS[layout], viscous=1e-4, coulomb=2e-3, momentum_limit=1.0)
    count = len(wheels.axes)

    @settings(max_examples=30)
    @given(torques, st.tuples(*[finite] * count), torques)
    def check(torque, momentum, rate):
        same(everything, torque, momentum, rate, wheels)

    check()


def test_compiled_lanes_give_the_same_bits():
    wheels = simple(pyramid(), viscous=1e-4, coulomb=2e-3)
    states = np.random.default_rng(3).normal(size=(10, 130))
    like = ((0.0,) * 3, (0.0,) * 4, (0.0,) * 3)

    def shared(torque, momentum, rate, facets):
        h_rate = motor(allocate_peak(torque, wheels._replace(facets=facets)), momentum, rate, wheels)
        return on_body(h_rate, momentum, rate, wheels), h_rate

    tables = np.repeat(np.array(wheels.facets.cells)[:, None], 130, axis=1)
    found = Compiled(shared, *like, wheels.facets).over(np.vstack([states, tables]))
    for k in range(130):
        assert tuple(found[:, k]) == tuple(leaves(shared(*unflatten(states[:, k], like), wheels.facets)))


@settings(max_examples=10)
@given(torques, st.tuples(finite, finite, finite, finite), torques)
def test_every_reader_agrees(torque, momentum, rate):
    wheels = make_wheels(pyramid(), 0.01, 0.1, 5.0, viscous=1e-4, coulomb=2e-3)
    agree(allocate, torque, wheels)
    agree(on_body, momentum, momentum, rate, wheels)
    agree(wheel_momentum, momentum, wheels)
    agree(motor, momentum, momentum, rate, wheels)
    agree(available, momentum, momentum, wheels)
    same(allocate_peak, torque, with_facets(wheels))


def test_polynomials_read_motor_and_allocation():
    wheels = constants(simple(three_orthogonal(), viscous=1e-4, coulomb=2e-3)._replace(facets=()))
    names = ("u", "h", "w")
    values = {"u": fmpq(1, 20), "h": fmpq(2), "w": fmpq(1, 3)}
    u, h, w = (Polynomial.variable(name) for name in names)
    zero = constants(0.0)
    found = motor((u, zero, zero), (h, zero, zero), (w, zero, zero), wheels)[0]
    holding = [p for p in pieces(found) if all((c.positive.at(values) > 0) == truth for c, truth in p.truths)]
    assert len(holding) == 1
    assert float(holding[0].value.at(values)) == pytest.approx(0.05 - 1e-4 * (200.0 - 1.0 / 3.0) - 2e-3)
    assert float(allocate((u, zero, zero), wheels)[0].at(values)) == pytest.approx(-0.05)


# Motors and friction.


def alone(command, momentum, rate=(0.0, 0.0, 0.0), **more):
    wheels = simple(three_orthogonal(), **more)
    return motor((command, 0.0, 0.0), (momentum, 0.0, 0.0), rate, wheels)[0]


def test_motor_within_its_limits():
    assert alone(0.05, 0.0) == 0.05
    assert alone(0.3, 0.0) == 0.1
    assert alone(-0.3, 2.0) == -0.1
    assert alone(0.3, 5.0) == 0.0
    assert alone(-0.3, -5.0) == 0.0
    assert alone(0.3, -5.0) == 0.1
    assert alone(0.3, 6.0) == 0.0
    assert alone(0.3, 5.0 * (1.0 - 0.5 * BAND)) == pytest.approx(0.05)
    assert alone(7.0, 1e9, torque_limit=math.inf, momentum_limit=math.inf) == 7.0
    assert math.isnan(alone(math.nan, 0.0))


def test_friction():
    friction = {"viscous": 1e-4, "coulomb": 2e-3}
    assert alone(0.0, 1.0, **friction) == pytest.approx(-(1e-2 + 2e-3))
    assert alone(0.0, -1.0, **friction) == pytest.approx(1e-2 + 2e-3)
    assert alone(0.0, 0.0, **friction) == 0.0
    assert alone(0.0, 0.01 * 0.5 * CREEP, **friction) == pytest.approx(-(0.5e-4 + 1e-3))
    # It is the speed relative to the body that rubs: here the rotor is at rest in the body.
    assert alone(0.0, 0.02, rate=(2.0, 0.0, 0.0), **friction) == 0.0
    assert alone(0.0, 0.0, rate=(2.0, 0.0, 0.0), **friction) == pytest.approx(2e-4 + 2e-3)
    assert alone(0.3, 5.0, **friction) == pytest.approx(-(5e-2 + 2e-3))


# Flights: body and wheels with no torque from outside.

TOTAL = ((12.0, 0.5, -0.3), (0.5, 9.0, 0.2), (-0.3, 0.2, 15.0))


def slope(state, command, inertia, wheels):
    attitude, rate, momentum = state
    h_rate = motor(command, momentum, rate, wheels)
    torque = subtract(on_body(h_rate, momentum, rate, wheels), gyroscopic_torque(inertia, rate))
    return derivative(attitude, rate), apply(inverse(inertia), torque), h_rate


def step(state, h, command, inertia, wheels):
    a = slope(state, command, inertia, wheels)
    b = slope(move(state, 0.5 * h, a), command, inertia, wheels)
    c = slope(move(state, 0.5 * h, b), command, inertia, wheels)
    d = slope(move(state, h, c), command, inertia, wheels)
    end = move(state, h / 6.0, move(move(move(a, 2.0, b), 2.0, c), 1.0, d))
    return renormalise(end[0]), end[1], end[2]


def whole_momentum(state, inertia, wheels):
    return to_reference(state[0], add(apply(inertia, state[1]), wheel_momentum(state[2], wheels)))


def noted(state, inertia, wheels):
    """Momentum of the whole (3), energy of the whole, wheel momenta."""
    _, rate, momentum = state
    energy = 0.5 * dot(apply(inertia, rate), rate)
    for h, rotor in zip(momentum, wheels.inertia, strict=True):
        energy = energy + 0.5 * h * h / rotor
    return (*whole_momentum(state, inertia, wheels), energy, *momentum)


def flight(wheels, commands, held, steps, rate=(0.01, -0.005, 0.008), size=1.0):
    """Hold each row of `commands` for `held` steps; what `noted` gives before each step, and the last state."""
    inertia = matrix(bare_inertia(size * np.array(TOTAL), axial_inertia(wheels)))
    recorder = Recorder()
    with recorder.recording():
        cells, out = (recorder.memory(name, writable=True) for name in ("state", "out"))
        given = Buffer(recorder.memory("commands"), 0, len(commands) * 4)

        def turn(row, k, state):
            for i, number in enumerate(noted(state, inertia, wheels)):
                out[(row * held + k) * 8 + i] = number
            return (step(state, 0.1, given.row(row, 4), inertia, wheels),)

        start = Buffer(cells, 0, 11)
        state = ((start.row(0, 4), start.part(4, 3).row(0, 3), start.part(7, 4).row(0, 4)),)
        end = repeat(steps // held, lambda row, state: repeat(held, lambda k, now: turn(row, k, now), state), *state)
        for i, number in enumerate(flatten(end)):
            cells[i] = number
    x = np.array([1.0, 0.0, 0.0, 0.0, *rate, 0.3, -0.2, 0.1, 0.25])
    rows, table = np.empty((steps, 8)), np.ascontiguousarray(commands, dtype=float)
    load(recorder.program("flight"), 1)(x.ctypes.data, rows.ctypes.data, table.ctypes.data)
    return rows, unflatten(x, ((0.0,) * 4, (0.0,) * 3, (0.0,) * 4))


@pytest.mark.parametrize("layout", ["pyramid", "nasa"])
def test_momentum_of_the_whole_is_conserved(layout):
    """One orbit of random commands, with friction and wheels that run into their momentum limits."""
    wheels = simple(
        LAYOUTS[layout], inertia=0.002, torque_limit=0.02, momentum_limit=0.4, viscous=1e-5, coulomb=[1e-4, 2e-4, 3e-4, 1e-4]
    )
    commands = np.random.default_rng(4).normal(size=(540, 4)) * 0.02
    # So large a body that the fourth-order error of its attitude stays below the bound.
    out, _ = flight(wheels, commands, 100, 54000, rate=(1e-3, -5e-4, 8e-4), size=30.0)
    whole = out[:, :3]
    assert np.abs(out[:, 4:]).max() > 0.4 * (1.0 - BAND)
    assert np.linalg.norm(whole - whole[0], axis=1).max() <= 1e-12 * np.linalg.norm(whole[0])


def test_friction_alone_takes_energy():
    wheels = simple(pyramid(), inertia=0.002, torque_limit=0.02, momentum_limit=0.4, viscous=1e-6, coulomb=1e-4)
    out, last = flight(wheels, [[0.0] * 4], 60000, 60000)
    assert (np.diff(out[:, 3]) <= 1e-13 * out[0, 3]).all()
    assert out[-1, 3] < 0.2 * out[0, 3]
    relative = np.array(last[2]) / 0.002 - np.array(wheels.axes) @ np.array(last[1])
    assert np.abs(relative).max() < 0.01 * CREEP


@pytest.mark.parametrize("coulomb", [0.0, 1e-3])
def test_a_wheel_saturates_at_its_momentum_limit(coulomb):
    wheels = simple(pyramid(), inertia=0.002, torque_limit=0.02, momentum_limit=0.4, coulomb=coulomb)
    out, _ = flight(wheels, [[1.0, 1.0, -1.0, -1.0]], 3000, 3000)
    assert np.abs(out[:, 4:]).max() <= 0.4 * (1.0 + 1e-12)
    assert np.abs(out[-1, 4:]).min() > 0.4 * (1.0 - BAND)


def test_rotors_at_rest_in_the_body_are_part_of_it():
    """J' w + sum a_i h_i of rotors at rest in the body is J w."""
    wheels = simple(pyramid(), inertia=0.2, viscous=1e3)
    rate = (0.3, -0.2, 0.5)
    momentum = tuple(0.2 * float(np.dot(a, rate)) for a in wheels.axes)
    whole = np.array(bare_inertia(TOTAL, axial_inertia(wheels))) @ rate + np.array(wheel_momentum(momentum, wheels))
    np.testing.assert_allclose(whole, np.array(TOTAL) @ rate, rtol=1e-14)


# Loss of a wheel.


def test_a_lost_wheel_takes_no_part():
    wheels = simple(pyramid(), viscous=1e-4)
    rest = lose(wheels, 1)
    assert rest.torque_limit == (0.1, 0.0, 0.1, 0.1)
    assert rest.axes == wheels.axes
    for torque in random_axes(5, 20):
        wanted = tuple(torque.tolist())
        for rule in (allocate, allocate_peak):
            taus = rule(wanted, with_facets(rest))
            assert taus[1] == 0.0
            np.testing.assert_allclose(total(taus, rest), torque, atol=1e-14)
    h_rate = motor((1.0,) * 4, (1.0,) * 4, (0.0,) * 3, rest)
    assert h_rate[1] == pytest.approx(-1e-4 * 1.0 / 0.01)
    assert lose(rest, 1) == rest
    assert make_wheels(pyramid(), 0.01, (0.1, 0.0, 0.1, 0.1), 5.0, 1e-4) == rest


def test_a_loss_that_leaves_a_direction_without_authority():
    with pytest.raises(ValueError, match=r"without wheel 3 the others give no torque about the body direction \(0, 0, 1\)"):
        lose(simple(three_orthogonal()), 2)
    with pytest.raises(ValueError, match=r"without wheel 4 the others give .* \(0, 1, 0\): three"):
        lose(simple(nasa_standard(), torque_limit=(1.0, 0.0, 1.0, 1.0)), 3)
    for index in (-1, 4):
        with pytest.raises(ValueError, match="there is no wheel"):
            lose(simple(pyramid()), index)


# What is refused.

FLAT = ((1.0, 0.0, 1.0), (0.0, 1.0, 0.0), (1.0, 1.0, 1.0), (1.0, -3.0, 1.0))


@pytest.mark.parametrize(
    ("axes", "message"),
    [
        (((1.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)), "axis of wheel 2 .* not 0"),
        (((1.0, 0.0, 0.0), (0.0, math.nan, 0.0), (0.0, 0.0, 1.0)), "axis of wheel 2 .* not nan"),
        (((1.0, 0.0), (0.0, 1.0)), r"shape \(2, 2\)"),
        ((), "shape"),
        (FLAT, r"the wheels give no torque about the body direction \(0.707, 0, -0.707\): three independent"),
        (((0.0, 0.0, 2.0), (1.0, 0.0, 0.0)), r"direction \(0, 1, 0\)"),
        (((1.0, 0.0, 0.0), (-1.0, 0.0, 0.0), (2.0, 0.0, 0.0)), r"direction \(0, [01], [01]\) and \(0, [01], [01]\)"),
        (((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (1.0, 1.0, 1e-3)), r"\(.*, 1\): the condition number of the axes is 2.\d+e\+03"),
    ],
)
def test_axes_that_are_refused(axes, message):
    with pytest.raises(ValueError, match=message):
        simple(axes)


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"inertia": 0.0}, "rotor inertia of wheel 1 must be positive and finite, not 0"),
        ({"inertia": math.inf}, "rotor inertia of wheel 1"),
        ({"torque_limit": (0.1, -0.1, 0.1)}, "torque limit of wheel 2 must be zero or more, not -0.1"),
        ({"torque_limit": math.nan}, "torque limit of wheel 1 .* not nan"),
        ({"torque_limit": 0.0}, "the working wheels give no torque at all"),
        ({"momentum_limit": 0.0}, "momentum limit of wheel 1 must be positive, not 0"),
        ({"viscous": -1.0}, "viscous friction of wheel 1 must be zero or more and finite, not -1"),
        ({"coulomb": (0.0, 0.0, math.inf)}, "Coulomb friction of wheel 3"),
        ({"coulomb": (0.0, 0.0)}, r"Coulomb friction: one number or 3 are needed, not an array of shape \(2,\)"),
    ],
)
def test_numbers_that_are_refused(more, message):
    with pytest.raises(ValueError, match=message):
        simple(three_orthogonal(), **more)


def test_body_inertia():
    wheels = simple(three_orthogonal(), inertia=(0.1, 0.2, 0.3))
    np.testing.assert_allclose(bare_inertia((1.0, 1.1, 1.2), axial_inertia(wheels)), np.diag([0.9, 0.9, 0.9]))
    with pytest.raises(ValueError, match=r"more inertia than the craft: .* -0.1, 0.1, 0.2"):
        bare_inertia((0.3, 0.3, 0.2), axial_inertia(wheels))
    with pytest.raises(ValueError, match="symmetric"):
        bare_inertia(np.array([[1.0, 0.5, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]), axial_inertia(wheels))


def test_catalogue():
    units = list(WHEEL_UNITS.values())
    assert list(WHEEL_UNITS) == [unit.name for unit in units]
    assert [unit.momentum_limit for unit in units] == sorted(unit.momentum_limit for unit in units)
    for unit in units:
        assert unit.maker
        assert unit.source
        assert (unit.inertia is None) == (unit.top_speed is None)
    assert WHEEL_UNITS["HR16-100"].inertia == pytest.approx(100.0 / (100.0 * 2.0 * math.pi))


def test_scaled_torques_need_scaled_wheels():
    wheels = simple(HEXAGON)
    torque = (0.3, -0.1, 0.2)
    once, twice = allocate_peak(torque, wheels), allocate_peak(scale(2.0, torque), wheels)
    assert twice == pytest.approx([2.0 * x for x in once])
