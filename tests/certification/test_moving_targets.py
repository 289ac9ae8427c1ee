"""Claims about targets that move by themselves: what they assume of the target, and which flights leave it."""

from dataclasses import replace

import numpy as np
import pytest

from starhold.analysis.departure import Span
from starhold.certification.assumptions import assumption
from starhold.certification.certificate import STEADY, UNTIL, Claim, Obligation
from starhold.certification.certify import Wanted, certify
from starhold.certification.unmodelled import named
from starhold.certification.wording import sentence
from starhold.parts.catalogue import find
from starhold.parts.epoch import DAY
from starhold.parts.part import Fitted
from tests.certification.attack import Attack
from tests.certification.pointing_hunt import hunted
from tests.making import ORBIT, flown, hub

PLACE, SPEED = (7.0e6, 0.0, 0.0), (0.0, 1.0e3, 7.4e3)
SEEN = (2026.0, 1.0, 1.0, 17.0, 16.0, 0.0)
"""Where a station on the equator is near the start of the orbit."""


def following(name, **params):
    """A loop on an orbit that follows a target."""
    target = Fitted(part := find("target", name), part.params(**params))
    loop = hub(*ORBIT, target, rate=(0.0, 0.0, 0.0), period=1.0)
    return replace(loop, start=loop.start._replace(position=PLACE, velocity=SPEED))


def assumed(loop, kind="pointing"):
    """What a proved claim assumes of a loop beside its own assumptions."""
    return named([Claim(kind, {"share": None}, {}, (), (Obligation("", "", "proved"),))], loop)[0]


def station(**params):
    return following("ground-station", latitude=0.0, longitude=0.0, epoch=SEEN, **params)


def test_a_claim_about_a_target_that_jumps_is_about_motions_between_its_jumps():
    claim = assumed(station())
    assert claim.assumptions == assumed(station(), "convergence").assumptions == (STEADY,)
    assert claim.limited_to(1.0) == "the target does not jump"
    assert assumed(following("scan", amplitude=0.2, swing=100.0)).assumptions == ()


def test_a_flight_leaves_it_where_the_target_jumps():
    loop = station(elevation=0.5)
    run = flown(loop, 400)
    ((jumps, said),) = assumption(STEADY).unmet(Span(loop, run))
    (place,) = np.flatnonzero(jumps)
    # By its own formulas: the station sinks below the elevation between these instants.
    error = run.arrays["attitude_error"]
    assert np.abs(np.diff(error, axis=0)).max(axis=1).argmax() == place - 1
    assert said == "the target jumps"
    calm = following("scan", amplitude=0.2, swing=100.0, shape=1)
    ((jumps, _),) = assumption(STEADY).unmet(Span(calm, flown(calm, 400)))
    assert not jumps.any()


def test_a_claim_about_yaw_steering_is_about_a_day():
    loop = following("yaw-steering", epoch=(2026.0, 6.0, 21.0, 0.0, 0.0, 0.0))
    claim = assumed(loop)
    assert claim.assumptions == (f"{UNTIL}{DAY:g}",)
    assert (claim.limited_to(DAY), claim.limited_to(DAY + 1.0)) == ("", "the flight lasts 86400 s at most")
    run = flown(loop, 3)
    ((late, _),) = assumption(claim.assumptions[0]).unmet(Span(loop, run))
    run.arrays["time"] = run.arrays["time"] + DAY
    ((then, _),) = assumption(claim.assumptions[0]).unmet(Span(loop, run))
    assert (late.any(), then.tolist()) == (False, [False, *[True] * (len(then) - 1)])


def test_a_motion_without_a_bound_is_left_out():
    # The Sun comes into the plane of the orbit, and the place lies where the line to it may come along the strip's normal.
    noon = following("yaw-steering", epoch=(2026.0, 3.0, 20.0, 0.0, 0.0, 0.0))
    ends = {"latitude": 0.0, "longitude": 0.1, "to_latitude": 0.0, "to_longitude": 0.9}
    across = following("ground-strip", begin=0.0, duration=60.0, **ends)
    for loop in (noon, across):
        assert assumed(loop).assumptions == (f"without:target {loop.target.called}",)


def test_no_flight_breaks_the_claim_of_a_loop_that_scans(tmp_path):
    loop = following("scan", amplitude=0.2, swing=600.0)
    loop = replace(loop, period=0.5, gains=loop.law.gains(3.0, 0.6), substeps=2)
    certificate = certify(loop, "scans", Wanted(alone=True, disturbance=1e-4))
    claim = certificate.claim("pointing")
    assert (claim.outcome, claim.left_out) == ("proved", [])
    found, shares = Attack({"programs": dict(claim.proof.programs)}, claim.proof.claim, 1, 16).worst()
    assert found == ""
    assert max(shares) > 0.2


PROVED = [104, 100, 105, 106, 107, 109, 202, 203]
"""Seeds of loops that follow slews, scans, stations and the Sun, and of which a bound is proved."""


@pytest.mark.slow
@pytest.mark.parametrize("seed", PROVED)
def test_no_flight_breaks_the_claim_of_a_loop_that_follows_a_target(seed, tmp_path):
    _, why, found, more = hunted(seed, tmp_path, kind="targets")
    assert (why, found) == ("", "")
    claim, shares = more
    assert claim.left_out == []
    assert max(shares) > 0.1
    if STEADY in claim.assumptions:
        assert sentence(claim, {}).startswith("between jumps of its target")
