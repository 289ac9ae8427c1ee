"""How much a proof costs: what the documentation compares claims with, computed in other ways too."""

import json

import control
import numpy as np
import pytest
from scipy import linalg

from generators import proved, sharpness
from starhold.certification.evidence.chains import ALIKE
from starhold.studies.budget import TOGETHER
from tests.making import spun
from tests.tiers import drawn

NAMES = [" ".join(pair) for pair in sharpness.LOOPS]


@pytest.fixture(scope="module")
def entries():
    """The loops of the table with what is stored of them, by name."""
    return {name: (loop, stored) for name, loop, stored in sharpness.entries()}


@pytest.mark.parametrize("name", NAMES)
def test_what_is_proved_lies_between_the_exact_sum_and_the_star_norm(name, entries):
    loop, stored = entries[name]
    exact, free, ellipsoid = sharpness.summed(loop, False), sharpness.summed(loop, True), sharpness.star(loop)
    claimed = stored["angle"] / 2.0 / stored["torque"]
    assert exact <= free * (1.0 + 1e-9)
    assert free <= claimed
    assert exact < ellipsoid < 1.2 * exact
    # By its response a claim is nearer than any ellipsoid is; what is not linear and an earlier time cost a little.
    assert claimed < 1.02 * ALIKE * (free if stored["by_response"] else ellipsoid)
    assert claimed < ellipsoid or not stored["by_response"]


@pytest.mark.parametrize("name", ["three-laws lyapunov", "cubesat-nadir wheel"])
def test_sums_are_those_of_python_control_about_each_axis(name, entries):
    """A torque about an axis of inertia turns the body about it alone."""
    loop, _ = entries[name]
    A, B = loop.held()
    sums: list[float] = []
    for k in range(3):
        part = [k, 3 + k]
        axis = control.ss(A[np.ix_(part, part)], B[part, k : k + 1], [[0.0, 1.0]], 0.0, loop.h)
        steps = np.arange(40_000) * loop.h
        # python-control takes the impulse to have the area one.
        sums.append(float(np.abs(control.impulse_response(axis, steps).outputs).sum() * loop.h))
    # A direction between two axes may be a little worse.
    assert max(sums) * (1.0 - 1e-9) <= sharpness.summed(loop, False) <= 1.01 * max(sums)


@pytest.mark.parametrize("name", NAMES)
def test_the_longest_period_is_that_of_the_quadratic(name, entries):
    """J z'' by the bilinear transform: both J - hC/2 and C - hK/4 are positive before it, one is not after it."""
    loop, stored = entries[name]
    exact = min(2.0 * linalg.eigvalsh(loop.J, loop.C)[0], 4.0 * linalg.eigvalsh(loop.C, loop.K)[0])
    assert sharpness.border(loop) == pytest.approx(exact, rel=1e-6)
    assert stored["longest"] == pytest.approx(exact, rel=1e-6)
    assert stored["longest"] < exact


def test_an_extremal_torque_takes_the_nonlinear_loop_as_far(entries):
    """It turns over as the impulse response does, and each period is integrated by SciPy."""
    loop, stored = entries["cubesat-nadir wheel"]
    A, B = loop.held()
    k = int(np.argmax(np.diag(loop.J)))
    rows = [np.eye(6)[3 + k]]
    while np.abs(rows[-1] @ B[:, k]) > 1e-7 or len(rows) < 99:
        rows.append(rows[-1] @ A)
    turns = np.sign([row @ B[:, k] for row in reversed(rows)])
    q, w = np.eye(4)[0], np.zeros(3)
    for sign in turns:
        torque = -loop.C @ w - loop.K @ q[1:] + sign * stored["torque"] * np.eye(3)[k]
        q, w = (found[-1] for found in spun(lambda t, q, held=torque: held, (0.0, loop.h), q, w, loop.J))
    far = 2.0 * np.arcsin(np.linalg.norm(q[1:]))
    assert far == pytest.approx(2.0 * stored["torque"] * sharpness.summed(loop, False), rel=1e-2)
    assert 0.95 * stored["angle"] < far <= stored["angle"]


@pytest.mark.slow
@pytest.mark.parametrize("pair", sharpness.LOOPS)
def test_the_stored_claims_are_those_that_are_proved(pair):
    stored = json.loads(sharpness.STORED.read_text(encoding="utf-8"))[" ".join(pair)]
    assert sharpness.prove(*pair) == pytest.approx(stored, rel=1e-6)


@pytest.mark.parametrize("name", proved.stored())
def test_nothing_measured_or_flown_is_beyond_what_is_proved(name):
    entry = proved.stored()[name]
    assert 0.0 < entry["flown"] <= 1.0
    if "measured" in entry:
        assert 0.0 < entry["measured"][TOGETHER] <= entry["angle"]
        assert all(0.0 <= share < entry["angle"] for share in entry["shares"].values() if share is not None)


@pytest.mark.slow
@pytest.mark.parametrize("pair", sorted({tuple(name.split(":")[0].split()[:2]) for name in proved.stored()}))
def test_the_stored_bounds_are_those_that_are_proved(pair):
    now, before = proved.claims(*pair), proved.stored()
    assert {*now} == {name for name in before if name.split(":")[0].split()[:2] == [*pair]}
    for name, (claim, parts) in now.items():
        for key, value in proved.told(claim, parts).items():
            assert before[name][key] == (pytest.approx(value, rel=1e-3) if value and key != "left_out" else value), key


SHARES = [(name, source) for name, entry in proved.stored().items() for source in entry.get("shares", ())]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "source"), drawn(SHARES, 15, 0))
def test_the_stored_shares_are_those_that_are_proved(name, source):
    """A proof for each source, of which those of the day differ."""
    now, then = proved.costs(*name.split(), [source]).shares[source], proved.stored()[name]
    share = then["shares"][source]
    assert now == (share if share is None else pytest.approx(share, rel=1e-2, abs=1e-3 * then["angle"]))
