"""Torque that lags or has a limit of its rate: claims with it, false ones, flights, and what each of its terms is for."""

import json
from dataclasses import replace
from fractions import Fraction
from types import SimpleNamespace

import numpy as np
import pytest

import starhold as sh
from starhold.analysis.departure import first_off, start_inside
from starhold.certification.assumptions import assumption
from starhold.certification.evidence.claims import floats
from starhold.certification.evidence.finding import certificate, read
from starhold.certification.proofs import pointed
from starhold.certification.subject import make_subject
from starhold.certification.unmodelled import late_torque, named
from starhold.conformance.parts import examine_part, find_part
from starhold.kernel.check import check
from starhold.kernel.follower import FIRST, REST
from starhold.kernel.held import Held
from starhold.kernel.loops import AttitudeLoop
from starhold.kernel.numbers import WORK, Account, RefusedError
from starhold.kernel.theorems.pointing import forgotten, on_level
from starhold.parts.catalogue import fit
from starhold.scenario.building import build
from starhold.scenario.reading import parse
from starhold.simulation.lane import fly, label
from starhold.studies.compare import record
from tests.certification.attack import Attack, flown
from tests.kernel.flights import Around, along
from tests.kernel.lagging import flying
from tests.making import built
from tests.parts.files import BODY, FILES, PD, part
from tests.tiers import leading

INERTIA = np.array([2.0, 3.0, 4.0])
LATE = [(("lag", 0.05),), (("rate-limit", 0.1),), (("lag", 0.5),)]


def edited(claim, part="numbers", **changes):
    """The certificate of a claim with other entries."""
    one = claim.proof.claim | {part: claim.proof.claim[part] | changes}
    return json.dumps(certificate(list(claim.proof.programs.values()), [one]))


@pytest.mark.parametrize("late", leading(LATE))
def test_an_actuator_that_lags_is_in_the_claim_and_no_flight_breaks_it(late):
    loop, claim, _ = flying(*late)
    assert claim.numbers["late_torque"] > 0.0
    (whole,) = named([claim], loop, 0.0)
    assert not [name for name in whole.assumptions if name.startswith("without:actuator")]
    assert any(name.startswith("late:") for name in whole.assumptions)
    found, shares = Attack({"programs": dict(claim.proof.programs)}, claim.proof.claim, 3).worst()
    assert found == ""
    assert max(shares) > 0.1


def test_a_check_with_a_lag_takes_little_of_the_work_that_it_may():
    _, claim, _ = flying("lag", 0.05)
    assert check(edited(claim))
    assert WORK - Account.left < WORK / 5


@pytest.mark.slow
def test_one_file_with_an_actuator_that_says_how_late_it_is_is_in_the_claim_checked_and_flown(tmp_path):
    (tmp_path / "drive.py").write_text(FILES["drive.py"])
    text = BODY + "substeps = 8\n" + part('file = "drive.py"\nbandwidth = "2 Hz"\n') + PD
    loop = built(parse(text, "own", tmp_path))
    claim, _ = pointed(make_subject(loop))
    assert claim.numbers["late_torque"] > 0.0
    (whole,) = named([claim], loop, 0.0)
    assert not [name for name in whole.assumptions if name.startswith("without:drive")]
    assert "late-alike" in whole.assumptions
    assert 0.0 < flown(loop, claim, np.random.default_rng(1), 16) <= 1.0
    wrong = tmp_path / "faster.py"
    wrong.write_text(FILES["drive.py"].replace("x = fastest", "x = 1.1 * fastest"))
    for path, passed in ((tmp_path / "drive.py", True), (wrong, False)):
        assert passed == all(v.outcome != "failed" for v in examine_part(find_part(str(path))))


def test_a_lag_that_makes_the_loop_unstable_is_left_out_by_name():
    loop, claim, why = flying("lag", 20.0)
    assert "late_torque" not in claim.numbers
    assert "with what is late" in why
    (whole,) = named([claim], loop, 0.0)
    assert "without:actuator lag" in whole.assumptions


@pytest.mark.parametrize(
    ("name", "factor"), [("rest", 0.5), ("weight", 0.1), ("weight", 10.0), ("begun", 30.0), ("kept", 7.0), ("mean", 2.3)]
)
def test_the_kernel_refuses_other_numbers_with_the_evidence(name, factor):
    _, claim, _ = flying("lag", 0.05)
    key = f"late.torque.{name}"
    with pytest.raises(RefusedError):
        check(edited(claim, **{key: str(Fraction(claim.proof.claim["numbers"][key]) * Fraction(factor))}))


@pytest.mark.slow
def test_the_kernel_refuses_a_lag_that_nothing_limits_or_that_is_told_in_part():
    _, claim, _ = flying("rate-limit", 0.1)
    assert check(edited(claim))
    for name in ("kept", "mean", "weight", "begun", "rest"):
        numbers = {k: x for k, x in claim.proof.claim["numbers"].items() if k != f"late.torque.{name}"}
        one = claim.proof.claim | {"numbers": numbers}
        with pytest.raises(RefusedError):
            check(json.dumps(certificate(list(claim.proof.programs.values()), [one])))
    with pytest.raises(RefusedError):
        check(edited(claim, **{"late.torque.most": "1/100000"}))


def test_the_claim_of_another_lag_is_not_that_of_the_loop():
    """The kernel believes how late a torque is; the comparison with the scenario does not."""
    loop, claim, _ = flying("lag", 0.05)
    given = sh.load("three-laws")
    slower = build(given, given.pick("lyapunov")).with_parts(fit("actuator", "lag", 0.06))
    plain = build(given, given.pick("lyapunov"))
    for other, same in ((loop, True), (slower, False), (plain, False)):
        told = late_torque(other)
        numbers = claim.proof.claim["numbers"]
        kept = told and Fraction(numbers["late.torque.kept"]) >= Fraction(told.kept)
        assert bool(kept) == same


def test_a_flight_that_begins_with_another_torque_leaves_the_claim():
    class Span(dict):
        pass

    unmet = assumption("late:0.002").unmet
    assert unmet is not None
    for off, where in ((0.001, False), (0.003, True)):
        span = Span(torque=np.zeros((3, 3)), command=np.array([[off, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]))
        ((seen, _),) = unmet(span)
        assert bool(np.any(seen)) == where


def test_a_loop_that_starts_with_a_torque_further_from_its_command_does_not_start_inside():
    loop, claim, _ = flying("lag", 0.05)
    off = first_off(loop)
    run = record(sh.load("three-laws").with_({"spacecraft.actuator_lag": 0.05, "simulation.duration": 1.0}), loop)
    assert np.isclose(off, np.linalg.norm(run["torque"][0] - run["command"][0]), rtol=1e-12)
    for most, inside in ((1.001 * off, True), (0.999 * off, False)):
        told = replace(claim, numbers=claim.numbers | {"late_torque": most, "start": 0.03})
        assert start_inside(SimpleNamespace(claims=[told]), loop) == {"pointing": inside}


def period(held, attack, x, e, unit, parts=8):
    """The state (w, q) a period after one of these, while the torque is off by e at first, and by how much what is asked for
    has changed: with all errors the one way and then the other."""
    n, law, h = attack.numbers, attack.fleet().law, float(held.h)
    around = Around(attack.fleet().around, attack.J, np.linalg.inv(attack.J), np.random.default_rng(5), x.shape[1])
    q, w = np.concatenate([[np.sqrt(1.0 - (x[3:] ** 2).sum(0))], x[3:]]), x[:3]
    kept, ends = float(held.late.kept), np.arange(parts + 1) / parts
    shares = np.diff((1.0 - kept**ends) / -np.log(kept) if kept else ends - ends**2 / 2.0)
    shares *= float(held.late.mean) / shares.sum() * parts
    asked = around.command(law, q, w, 0.0, unit) + n["error"] * unit
    for k, share in enumerate(shares):
        outside = n["outside"] * unit + around.loaded(unit, 0.0 * w[0], h / parts)
        q, w = around.after(q, w, (k + 0.5) * h / parts, asked + share * e, outside, h / parts)
    return np.concatenate([w, q[1:]]), around.command(law, q, w, h, -unit) - n["error"] * unit - asked


@pytest.mark.parametrize("late", leading([(("lag", 0.05),), (("lag", 0.5),), (("rate-limit", 0.1),)], 1))
def test_no_period_exceeds_the_bounds_of_what_is_late_and_some_come_near_them(late):
    """So nothing that counts near the target may be left out of them."""
    Account.left = 10**12
    _, claim, _ = flying(*late)
    held = Held(AttitudeLoop(read(claim.proof.claim, dict(claim.proof.programs)), remembers=True))
    attack, rng = Attack({"programs": dict(claim.proof.programs)}, claim.proof.claim, 1), np.random.default_rng(2)
    (tube, _), lanes = on_level(held, Fraction(claim.proof.claim["evidence"]["levels"][-1]["end"])), 4000
    held.nears(tube)
    first, _ = forgotten(held, tube)
    unit, way = (along(rng.normal(size=(3, lanes))) for _ in range(2))
    x = np.linalg.cholesky(floats(tube.region.X)) @ along(rng.normal(size=(6, lanes))) * 10.0 ** rng.integers(-4, 1, lanes)
    kept, full = float(held.late.kept), rng.choice([0.0, 1.0], lanes)

    def share(e, bound):
        after, asked = period(held, attack, x, e, unit)
        return after, float((np.linalg.norm(kept * e - asked, axis=0) / bound(np.linalg.norm(e, axis=0))).max())

    change = held.change_in(tube)
    moved = np.linalg.norm(floats(change.M) @ x, axis=0) + float(change.rest)
    assert 0.95 < share(float(tube.late.most) * way * full, lambda e: moved + float(change.kept) * e)[1] <= 1.0
    # Near the target: by how much it changes, and where the state is from the linear motion.
    linear, rest = map(float, held.lateness(first))
    errors = 2.0 * float(held.mistaken(first)) * bool(held.inexact)
    late = [float(first.region.sizes[name]) * v * full for name, v in ((FIRST, unit), (REST, way))]
    after, worst = share(sum(late), lambda e: kept * e + (1.0 - kept) * (linear + rest - errors) + errors)
    assert 0.3 < worst <= 1.0
    ways = np.vstack([np.eye(6), rng.normal(size=(300, 6))])
    most = sum(np.linalg.norm(ways @ floats(B)[:6], axis=1) * float(b) for B, b in held.linear(first))
    state = np.vstack([x, floats(held.near.torque) @ x + late[0]])[: len(held.near.A)]
    assert 0.7 < float((np.abs(ways @ (after - floats(held.near.A)[:6] @ state)) / most[:, None]).max()) <= 1.0


@pytest.mark.parametrize(("lag", "substeps"), [(0.05, 4), (0.2, 1), (0.3, 1), (1.0, 1), (0.02, 10)])
def test_what_is_late_in_a_flight_is_within_its_bounds(lag, substeps):
    """With substeps of half a time constant, which are allowed, it is by much more than rounding from what it is exactly."""
    craft = {
        "name": "late",
        "spacecraft": {"inertia": INERTIA.tolist(), "torque_limit": 1.0, "actuator_lag": lag},
        "initial": {"angles": ["1 deg", "-2 deg", "1 deg"]},
        "simulation": {"duration": "10 s", "control_period": 0.1, "substeps": substeps},
        "law": [{"type": "pd", "k_rate": 0.5, "k_attitude": 0.05}],
    }
    loop = built(sh.scenario(craft))
    late = late_torque(loop)
    run = label(loop, *fly(loop, 1), 1).arrays
    before, after = (run["command"][0] - run["torque"][k] for k in (0, 1))
    # From rest, so that no other torque acts.
    mean = run["command"][0] - INERTIA * (run["rate"][1] - run["rate"][0]) / loop.period
    for size, most, least in zip((after, mean), (late.kept, late.mean), late.least[:2], strict=True):
        assert least <= (size / before).min() <= (size / before).max() <= most
