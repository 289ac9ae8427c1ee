"""Parts without noise, and readings of the rate alone: nothing random is read into them."""

import math

import pytest

from starhold.algebra.vector import ZERO
from starhold.certification.unmodelled import driven_errors, envelope_of, pushes
from starhold.parts.catalogue import fit
from tests.certification.loops import textbook


def read_by(*gyro):
    return textbook()["pd-0"].with_parts(fit("sensor", "gyro", *gyro))


def test_the_bias_of_a_gyro_without_noise_counts():
    loop = read_by(0.0, (3e-4, 0.0, 4e-4))
    assert driven_errors(loop) is None
    assert pushes(loop, envelope_of(loop, 0.0, False)).rate == pytest.approx(5e-4, rel=1e-6)


def test_noise_of_the_rate_leaves_the_attitude_exact():
    loop = read_by(1e-4)
    kept, attitude, rate = driven_errors(loop).recursion.corrected((ZERO, ZERO), ((1.0, -1.0, 2.0),) * 3)
    assert (kept[0], attitude) == (ZERO, ZERO)
    assert rate == pytest.approx([x * 1e-4 / math.sqrt(loop.period) for x in (1.0, -1.0, 2.0)], rel=1e-12)
