"""How far a filter is off that takes the mean of two readings of a gyro for the body's rate between them."""

from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from starhold.certification.assumptions import assumption
from starhold.certification.certificate import EVEN
from starhold.certification.mean_rates import SHARE, evenness, misled, strays
from starhold.certification.measured import measured, noise_of, strayed
from starhold.certification.unmodelled import named
from starhold.parts.craft import tensor
from starhold.parts.estimators import mekf
from tests.certification.loops import certified
from tests.making import built, flown

PERIOD = 0.25


@cache
def nadir():
    return built("cubesat-nadir", "lyapunov")


class Span(dict):
    unit = 1.0

    def __init__(self, loop, arrays):
        super().__init__(arrays)
        self.loop = loop


# --- one period -----------------------------------------------------------------------------------------------------------


def turned_beside(loop, rate, torque, stored):
    """The angle of what a body turns beside the mean of its rates at both ends of a period, integrated."""
    J, h = tensor(loop.craft.inertia), loop.period
    inner = stored is not None

    def slope(t, y):
        p, w, momentum = y[:3], y[3:6], J @ y[3:6] + y[6:]
        # The rotation vector's rate, to the third order.
        dp = w + np.cross(p, w) / 2.0 + np.cross(p, np.cross(p, w)) / 12.0
        return np.concatenate([dp, np.linalg.solve(J, torque - np.cross(w, momentum)), -torque * inner])

    begun = np.concatenate([np.zeros(3), rate, stored if inner else np.zeros(3)])
    end = solve_ivp(slope, (0.0, h), begun, rtol=1e-12, atol=1e-16).y[:, -1]
    mean = Rotation.from_rotvec(h * (rate + end[3:6]) / 2.0)
    return (mean.inv() * Rotation.from_rotvec(end[:3])).magnitude()


@pytest.mark.parametrize("wheeled", [True, False])
def test_a_turn_beside_the_mean_rate_is_as_computed(wheeled):
    loop, random = nadir(), np.random.default_rng(2)
    shares = []
    for _ in range(40):
        rate, torque = 0.02 * random.normal(size=3), 4e-4 * random.normal(size=3)
        stored = 1e-3 * random.normal(size=3) if wheeled else None
        found = turned_beside(loop, rate, torque, stored)
        given = None if stored is None else stored[None]
        shares.append(found / strays(loop, rate[None], torque[None], given)[0])
    assert 0.97 < min(shares) < max(shares) < 1.03


@pytest.mark.parametrize("shape", [lambda x: np.ones(len(x)), lambda x: np.exp(-x / 30.0)])
def test_no_motion_between_readings_puts_the_filter_further_off_than_its_responses_say(shape):
    """In each period the body turns by as much as it may beside the readings, towards the side that adds up."""
    loop, small, every = nadir(), 1e-7, 4
    fitted = loop.find("mekf")
    params, noise = fitted.prepared(PERIOD), noise_of(loop.find("star-tracker"), PERIOD)
    recursion = mekf.recursion(fitted.params, noise, PERIOD, (0.0, 0.0, 0.0))
    wide, count = strayed(recursion), 80

    def settled():
        memory = mekf.remember(params, None)
        for k in range(1600):
            told = SimpleNamespace(attitude=(1.0, 0.0, 0.0, 0.0), attitude_is_new=float(k % every == 0), rate=(0.0,) * 3)
            _, memory = mekf.estimate(told, memory, params, None, PERIOD)
        return memory

    begun = settled()

    def fly(turns):
        """The attitude's error at the end, for turns of the body between readings that are zero (n, 3)."""
        memory, true = begun, Rotation.identity()
        for k, turn in enumerate(turns):
            true = true * Rotation.from_rotvec(small * turn)
            seen = tuple(true.as_quat(scalar_first=True))
            told = SimpleNamespace(attitude=seen, attitude_is_new=float(k % every == 0), rate=(0.0,) * 3)
            estimate, memory = mekf.estimate(told, memory, params, None, PERIOD)
        return (true.inv() * Rotation.from_quat(estimate.attitude, scalar_first=True)).as_rotvec() / small

    most = shape(np.arange(count) * PERIOD)[::-1]
    bound = float(wide[:count] @ most[::-1])
    # About the boresight stars tell the least.
    axis = np.array(fitted.params.boresight)
    alone = np.array([axis @ fly(np.eye(count)[k][:, None] * axis) for k in range(count)])
    together = np.linalg.norm(fly((np.sign(alone) * most)[:, None] * axis))
    assert 0.9 < together / bound <= 1.0 + 1e-6


# --- flights --------------------------------------------------------------------------------------------------------------


def test_flights_of_a_cubesat_turn_nearly_as_at_the_mean_of_readings():
    loop = nadir()
    (name,) = evenness(loop, 0.0029)
    run, most = flown(loop, 1600), SHARE * 0.0029
    for every in (1, 8):
        span = Span(loop, {name: x[::every] for name, x in run.arrays.items()})
        told = misled(span)
        assert 0.05 * most < told.max() < 0.4 * most
        assert told[-1] < 0.01 * most
        (pair,) = assumption(name).unmet(span)
        assert not pair[0].any()
    # A body that turns to and fro as fast as none does.
    fast = Span(loop, run.arrays | {"rate": 10.0 * run["rate"], "torque": 10.0 * run["torque"]})
    assert assumption(name).unmet(fast)[0][0].any()


def test_a_claim_with_a_filter_says_so_and_one_without_does_not():
    claim = certified("pd-0", disturbance=1e-4).claim("pointing")
    for loop, known in ((nadir(), True), (nadir().without("mekf"), False)):
        (told,) = named([replace(claim, numbers=claim.numbers | {"share": 0.9973}, assumptions=())], loop)
        assert any(text.startswith(EVEN) for text in told.assumptions) == known
    assert measured(nadir()).recursion.strays
    assert "between two readings" in assumption(f"{EVEN}1e-4").text
