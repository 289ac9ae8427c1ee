"""Forces that move the orbit: flights stay in the band that claims assume, and its frame errs by no more than is told."""

from dataclasses import replace
from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest

from starhold.algebra.quaternion import NO_TURN, conjugate, multiply
from starhold.certification.assumptions import assumption
from starhold.certification.certificate import ORBIT, Claim, Obligation
from starhold.certification.orbit_band import band_of, strays
from starhold.certification.subject import make_subject
from starhold.certification.unmodelled import named, pushes
from starhold.parts.catalogue import fit
from starhold.parts.environments import oblateness
from starhold.parts.orbit import highest, lowest
from starhold.parts.targets import orbital
from tests.certification.flattened import FLATTENED, MU, flattened, pull
from tests.making import ORBIT as GRAVITY
from tests.making import flown
from tests.tiers import drawn

STARTS = [*product((0.0, 0.02, 0.2), (0.0, 1.1, 1.57, 2.3), (0.0, 1.0, 4.0))]
"""Eccentricities, inclinations (rad), and arguments of perigee (rad)."""


@pytest.mark.parametrize("start", drawn([(start,) for start in STARTS], 6, 6))
def test_an_orbit_stays_in_its_band_and_the_frame_near_that_of_two_body_motion(start):
    """Ten orbits; the frame's motion by differences, against what the target tells."""
    loop = flattened(*start)
    run = flown(loop, 8000)
    r, v = run.arrays["position"], run.arrays["velocity"]
    band = band_of(loop)
    assert 0.001 < band.share < 0.005
    assert not strays(loop, r, v).any()
    rates, told = [], []
    before, h = NO_TURN, 1e-2
    for place, speed in zip(r[::40], v[::40], strict=True):
        frames, numbers = [], []
        for t in (-h, 0.0, h):
            # The path to third order in time, so that differences are exact to 1e-12.
            state = SimpleNamespace(position=tuple(place), velocity=tuple(speed))
            a = pull(loop, place)
            jerk = (pull(loop, place + speed * 1e-3) - pull(loop, place - speed * 1e-3)) / 2e-3
            state.position = tuple(place + speed * t + a * t**2 / 2 + jerk * t**3 / 6)
            state.velocity = tuple(speed + a * t + jerk * t**2 / 2)
            goal = orbital.goal((), state, 0, before)
            before = goal.attitude
            frames.append(goal.attitude)
            numbers.append(goal)
        turned = np.array(multiply(conjugate(frames[0]), frames[2])[1:]) / h
        rates.append(turned - numbers[1].rate)
        told.append((np.array(numbers[2].rate) - numbers[0].rate) / (2 * h) - numbers[1].acceleration)
    off = np.linalg.norm(rates, axis=1).max()
    # What h' does to the told rate is seen so; the bound holds what the rate that is not told changes by, too.
    late = np.linalg.norm(told, axis=1).max()
    assert off < band.rate + 1e-10
    assert late < band.acceleration
    assert start[1] in (0.0, 1.57) or off > 0.1 * band.rate


def test_no_place_has_more_acceleration_or_gradient_than_is_told():
    loop, random, step = flattened(*STARTS[0]), np.random.default_rng(5), 10.0
    for distance in (6.6e6, 4.2e7):
        force, gradient = oblateness.perturbation(FLATTENED.params, loop.craft, distance)
        worst = [0.0, 0.0]
        directions = [*random.normal(size=(300, 3)), np.array([0.0, 0.0, 1.0])]
        for x in directions:
            place = distance * (1.0 + abs(random.normal()) * (x[0] != 0.0)) * x / np.linalg.norm(x)
            pulls = [
                np.array(oblateness.acceleration(SimpleNamespace(position=tuple(p)), FLATTENED.params, loop.craft, ()))
                for p in (place, *(place + step * e for e in np.eye(3)), *(place - step * e for e in np.eye(3)))
            ]
            jacobian = [(pulls[1 + k] - pulls[4 + k]) / (2 * step) for k in range(3)]
            worst = [max(worst[0], np.linalg.norm(pulls[0])), max(worst[1], np.linalg.norm(jacobian, 2))]
        assert worst[0] == pytest.approx(force, rel=1e-9)
        assert worst[1] == pytest.approx(gradient, rel=1e-4)


def claimed(loop):
    """What a proved claim of pointing assumes of a loop."""
    shown = Claim("pointing", {"share": None}, {}, (), (Obligation("", "", "proved"),))
    return named([shown], loop)[0].assumptions


def test_a_claim_takes_the_oblateness_in_with_its_band(monkeypatch):
    loop = flattened(*STARTS[0])
    (kept,) = claimed(loop)
    assert kept.startswith(ORBIT)
    assert float(kept.removeprefix(ORBIT)) == pytest.approx(band_of(loop).share, rel=1e-2)
    monkeypatch.delattr(oblateness, "perturbation")
    assert claimed(loop) == ("without:environment oblateness",)


def test_a_flight_that_leaves_the_band_is_seen_to_leave_the_claim():
    loop = flattened(*STARTS[0])
    run = flown(loop.with_parts(fit("environment", "oblateness", 3e-3)), 3000)
    ((there, text),) = assumption(claimed(loop)[0]).unmet(Seen(loop, run))
    assert there.any()
    assert "further than is assumed" in text


class Seen(dict):
    """A flight as assumptions look at it."""

    def __init__(self, loop, run):
        super().__init__(run.arrays)
        self.loop = loop


def test_bounds_grow_with_the_band():
    """Lower, faster and turned: each number of the loop without oblateness is less than that with it."""
    with_it = flattened(0.02, 1.1, 0.0, fit("environment", "residual-dipole", (0.01, 0.0, 0.02)))
    without = with_it.without("environment").with_parts(*GRAVITY, *with_it.parts[3:])
    known = [make_subject(loop) for loop in (without, with_it)]
    told = [pushes(subject.loop, subject.envelope(False)) for subject in known]
    assert told[0].outside < told[1].outside
    assert told[0].target_rate == 0.0 < told[1].target_rate
    for name in ("target_rate", "target_acceleration", "modelled_norm"):
        assert getattr(known[0], name) < getattr(known[1], name)


def test_an_orbit_that_does_not_come_back_has_no_band():
    loop = flattened(*STARTS[0])
    loop = replace(loop, start=loop.start._replace(velocity=(0.0, 0.0, 1.2e4)))
    assert band_of(loop) == (0.0,) * 5
    assert claimed(loop) == ("without:environment oblateness",)
    assert lowest(loop.start.position, loop.start.velocity, MU) < highest(loop.start.position, loop.start.velocity, MU)
