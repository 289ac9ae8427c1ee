"""Flights that are steered against pointing claims of random loops; `pointing_hunt` flies more of them by hand."""

import numpy as np
import pytest

from tests.certification.attack import flown
from tests.certification.pointing_hunt import hunted, proved_loop
from tests.tiers import drawn, leading, seeds

PROVED = [2002, 2001, 2000, 2004, 2005, 2007, 2009, 2028, 2029, 2030, 2031]
"""Seeds of loops of which a bound is proved: with and without wheels, noise, orbits, limits."""


@pytest.mark.slow
@pytest.mark.parametrize("seed", leading(PROVED))
def test_no_flight_breaks_the_pointing_claim_of_a_random_loop(seed, tmp_path):
    _, why, found, more = hunted(seed, tmp_path)
    assert (why, found) == ("", "")
    _, shares = more
    # Some come as near as one may ask of 96 flights.
    assert max(shares) > 0.1


@pytest.mark.slow
def test_no_random_loop_is_proved_what_it_does_not_keep(tmp_path):
    assert [seed for seed in seeds(15) if hunted(seed, tmp_path)[2]] == []


@pytest.mark.slow
@pytest.mark.parametrize("kind", drawn(["every", "delayed", "late", "integral", "lost", "shaken", "targets", "plans"], 2, 0))
def test_no_random_loop_of_a_kind_is_proved_what_it_does_not_keep(kind, tmp_path):
    assert [seed for seed in seeds(3) if hunted(seed, tmp_path, kind=kind)[2]] == []


@pytest.mark.slow
@pytest.mark.parametrize("seed", leading([8009, 8000, 8006, 8008, 8012]))
def test_flights_of_the_loop_itself_end_as_near_as_is_proved(seed, tmp_path):
    """With the parts that disturb and measure, and their noise."""
    loop, _, claim = proved_loop(seed, tmp_path)
    assert not [name for name in claim.assumptions if name.startswith("without")]
    assert 0.01 < flown(loop, claim, np.random.default_rng(seed)) <= 1.0


@pytest.mark.slow
@pytest.mark.parametrize("seed", [91004, 91012, 92006, 92008])
def test_no_flight_breaks_the_claim_of_a_random_loop_that_plans(seed, tmp_path):
    """The torque is that of the best plan, which keeps within its limits and near the program."""
    _, why, found, more = hunted(seed, tmp_path, kind="plans")
    assert (why, found) == ("", "")
    _, shares = more
    assert max(shares) > 0.1


@pytest.mark.slow
@pytest.mark.parametrize("seed", leading([10002, 15008, 15037, 20000, 20002, 20014, 20021]))
def test_no_flight_breaks_the_claim_of_a_random_loop_with_parts_of_every_kind(seed, tmp_path):
    """With an integral, a lost wheel, an estimator, a tolerance, random torques and targets that move by themselves."""
    _, why, found, more = hunted(seed, tmp_path, 0.003 if seed % 4 == 0 else None, "every")
    assert (why, found) == ("", "")
    _, shares = more
    assert max(shares) > 0.4
