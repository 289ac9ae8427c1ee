"""Claims for a share of orbits: the parts whose noise they take in, what they are not about, flights that leave them."""

import json
import math
import re
from collections import Counter
from dataclasses import replace
from fractions import Fraction
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from starhold.analysis.departure import departures
from starhold.certification.certificate import Certificate, write
from starhold.certification.certify import Wanted, certify
from starhold.certification.comparison import _numbers as numbers_apart
from starhold.certification.comparison import differences
from starhold.certification.evidence.attitude import Loop
from starhold.certification.evidence.finding import certificate as found
from starhold.certification.measured import _rate as goal_rate
from starhold.certification.proofs import checked
from starhold.certification.subject import described, make_subject
from starhold.certification.unmodelled import change_of_modelled, driven_errors, envelope_of, gaussian_vectors, named, pushes
from starhold.certification.wording import sentence
from starhold.checker import check_file, passed
from starhold.kernel.check import check
from starhold.kernel.held import CHANGE
from starhold.parts.catalogue import find
from starhold.parts.estimators import mekf
from starhold.parts.part import Fitted
from tests.certification.loops import certified
from tests.kernel.certificates import flying, radii_of
from tests.making import built
from tests.tiers import leading

SENSORS = {"sensor gyro", "sensor star-tracker", "estimator mekf"}


@cache
def nadir():
    return built("cubesat-nadir", "wheel")


def left_out(loop, share):
    """The sensors and estimators that a claim of how near to its target a loop comes leaves out."""
    claim = certified("pd-0", disturbance=1e-4).claim("pointing")
    (told,) = named([replace(claim, numbers=claim.numbers | {"share": share}, assumptions=())], loop)
    names = {text.removeprefix("without:") for text in told.assumptions}
    return {name for name in names if name.startswith(("sensor", "estimator"))}


def changed(loop, name, **params):
    fitted = loop.find(name)
    return loop.with_parts(replace(fitted, params=fitted.params._replace(**params)))


@pytest.mark.slow
def test_a_claim_for_a_share_takes_in_the_parts_that_say_their_noise():
    assert left_out(nadir(), 0.9973) == set()
    assert left_out(nadir(), None) == SENSORS


@pytest.mark.parametrize(
    ("name", "params"),
    leading(
        [
            ("gyro", {"scale_error": 0.01}),
            ("gyro", {"limit": 1.0}),
            ("star-tracker", {"delay": 0.5}),
            ("star-tracker", {"outage": (10.0, 20.0)}),
        ]
    ),
)
def test_what_is_not_noise_is_left_out(name, params):
    assert left_out(changed(nadir(), name, **params), 0.9973) == SENSORS


def test_an_error_that_the_estimator_leaves_in_is_not_taken_for_removed():
    """A filter takes a tracker that is mounted askew for straight: the body points as far aside, or further as it swings."""
    askew = changed(nadir(), "star-tracker", mounting_error=(0.02, 0.0, 0.0))
    assert left_out(askew, 0.9973) == left_out(changed(nadir(), "gyro", resolution=1e-5), 0.9973) == set()
    told = pushes(askew, envelope_of(askew, 0.0, noisy=True))
    assert 0.02 < told.attitude < 0.04
    assert 0.0 < told.rate < 0.005
    alone = changed(askew.without("mekf"), "gyro", bias_walk=0.0)
    alone = changed(alone, "star-tracker", interval=0.0)
    assert left_out(alone, 0.9973) == set()
    assert 0.02 <= pushes(alone, envelope_of(alone, 0.0, noisy=True)).attitude <= 0.02 * (1.0 + 1e-9)


def with_two(interval, rows=((2e-5, 9e-5, 1.0, 0.0, 0.0),)):
    """The loop with another star tracker, at this interval (s), of which the filter knows by these rows."""
    loop = changed(nadir(), "mekf", more_trackers=rows)
    first = loop.find("star-tracker")
    params = first.params._replace(cross=3e-5, roll=1e-4, boresight=(1.0, 0.0, 0.0), interval=interval)
    return replace(loop, parts=(*loop.parts, replace(first, params=params, name="second")))


def test_two_trackers_are_taken_in_or_left_out_by_name():
    assert left_out(with_two(1.0), 0.9973) == set()
    assert left_out(with_two(2.0), 0.9973) == SENSORS | {"sensor second"}
    assert left_out(with_two(1.0, ()), 0.9973) == SENSORS | {"sensor second"}
    alone = with_two(1.0).without("estimator")
    assert driven_errors(alone) is None
    assert differences(noise_claim(with_two(1.0)), nadir())


def test_noise_of_two_trackers_drives_errors_as_in_the_filter_that_flies():
    loop, period, random = with_two(1.0), nadir().period, np.random.default_rng(3)
    recursion = driven_errors(loop).recursion
    params, gyro = loop.find("mekf").prepared(period), loop.find("gyro")
    roots = [
        f.part.module.noise(f.params, period).attitude
        for f in loop.used("sensor")
        if "attitude" in f.part.module.Reading._fields
    ]
    reading = gyro.part.module.noise(gyro.params, period).rate
    rate = np.array(goal_rate(loop))
    true, onward = Rotation.identity(), Rotation.from_rotvec(rate * period)
    memory, errors = mekf.remember(params, None), ((0.0,) * 3,) * recursion.size
    for step in range(2400):
        noisy, new = step >= 2000, step % recursion.every == 0
        drawn = random.normal(size=(recursion.noises, 3)) * noisy
        drawn[1] = 0.0
        seen = [true * Rotation.from_rotvec(np.array(root) @ own) for root, own in zip(roots, drawn[2:], strict=True)]
        every = [SimpleNamespace(attitude=tuple(q.as_quat(scalar_first=True)), attitude_is_new=float(new)) for q in seen]
        told = SimpleNamespace(rate=tuple(rate + reading * drawn[0]), every=every)
        estimate, memory = mekf.estimate(told, memory, params, loop.known, period)
        noise = tuple(map(tuple, drawn))
        errors, attitude, off = (recursion.corrected if new else recursion.carried)(errors, noise)
        if noisy:
            found = (true.inv() * Rotation.from_quat(estimate.attitude, scalar_first=True)).as_rotvec()
            assert np.abs(found - attitude).max() < 1e-8
            assert np.abs(estimate.rate - rate - off).max() < 1e-8
        true = true * onward
    assert np.abs(attitude).max() > 1e-6


def test_what_is_read_by_what_has_no_bound_is_left_out():
    """The attitude by Sun and field hangs on the magnetometer; unloading alone has a bound, whatever is measured."""
    triad = find("estimator", "triad")
    sun = Fitted(find("sensor", "sun-sensor"), find("sensor", "sun-sensor").examples()[0])
    loop = nadir().without("mekf", "star-tracker").with_parts(sun, Fitted(triad, triad.examples()[0]))
    assert {"sensor magnetometer", "sensor sun-sensor", "estimator triad"} <= left_out(loop, 0.9973)
    assert "sensor magnetometer" not in left_out(nadir().without("magnetic-unloading"), 0.9973)


def test_an_estimator_that_reads_more_than_its_recursion_is_told_of_is_left_out(monkeypatch):
    """A file of one's own that adds the field to the rate came to 34 times the angle that was proved of it."""
    assert "estimator mekf" not in left_out(nadir(), 0.9973)
    monkeypatch.delattr(find("estimator", "mekf").module, "needs")
    monkeypatch.setattr(find("estimator", "mekf").module, "NEEDS", ("attitude", "rate", "magnetic_field"))
    assert "estimator mekf" in left_out(nadir(), 0.9973)


def test_a_bias_that_the_estimator_takes_out_is_no_error():
    loop = nadir()
    bias = np.linalg.norm(loop.find("gyro").params.bias)
    alone = changed(loop.without("mekf", "star-tracker"), "gyro", bias_walk=0.0)
    assert pushes(loop, envelope_of(loop, 0.0, noisy=True)).rate == 0.0
    assert bias <= pushes(alone, envelope_of(alone, 0.0, noisy=True)).rate <= bias * (1.0 + 1e-9)
    assert "sensor gyro" not in left_out(alone, 0.9973)


def noise_claim(loop):
    found = Loop(make_subject(loop))
    numbers, _ = radii_of(found)
    return found.claim("points", found.words, None, **numbers)


@pytest.mark.parametrize(
    ("name", "params", "told"),
    [
        ("gyro", {"noise": 3e-5}, "the program of the errors carried differs"),
        ("star-tracker", {"cross": 6e-5}, "the program of the errors corrected differs"),
        ("mekf", {"roll": 3e-4}, "the program of the errors corrected differs"),
        ("star-tracker", {"interval": 2.0}, "the every differs"),
    ],
)
def test_a_claim_is_about_the_noise_of_its_loop(name, params, told):
    claim = noise_claim(nadir())
    names = ("momentum", "target.rate", "target.acceleration", "error.target.rate", "error.target.acceleration", "outside")
    claim["numbers"] |= dict.fromkeys(names, "1")
    claim["numbers"] |= {f"outside.{k}": "1" for k in range(3)}
    assert differences(claim, nadir()) == []
    assert told in differences(claim, changed(nadir(), name, **params))
    claim["numbers"]["samples"] = "22000"
    assert differences(claim, nadir()) == ["the samples differs"]


@pytest.mark.slow
def test_a_share_is_told_and_a_flight_before_the_filter_settles_leaves_it():
    (claim,) = checked(flying("noisy"))
    assert claim.numbers["share"] == pytest.approx(0.9973)
    assert {"gaussian-noise", "linear-estimate", "settled-estimate"} <= set(claim.assumptions)
    loop = flying("noisy").loop
    subject = described(make_subject(loop))
    text = sentence(claim, subject)
    assert "in at least 99.73 % of spans of 3600" in text
    assert "errors of the attitude of up to 0.02" in text
    assert "of orbits" in sentence(claim, subject | {"orbit": {"position": [1.0]}})
    length = 400
    time = np.arange(length) * loop.period
    still = {"attitude": np.tile([1.0, 0.0, 0.0, 0.0], (length, 1)), "rate": np.zeros((length, 3))}
    shown = {f"mekf_{name}": values.copy() for name, values in still.items()}
    run = {
        "time": time,
        **still,
        **shown,
        "attitude_error": still["attitude"],
        "rate_error": still["rate"],
        "command": still["rate"],
    }
    flown = SimpleNamespace(arrays=run, attrs={"record_every": 1})
    certificate = Certificate("here", subject, (claim,))
    assert departures(certificate, loop, flown) == {"pointing": ()}
    run["mekf_rate"][100] = [3e-4, 0.0, 0.0]
    (left,) = departures(certificate, loop, flown)["pointing"]
    assert (left.time, left.how) == (time[100], "the estimation error exceeds the stated bound")
    run["mekf_attitude"][40] = [1.0, 3e-4, 0.0, 0.0]
    assert departures(certificate, loop, flown)["pointing"][0].time == time[40]


@pytest.mark.slow
def test_against_more_noise_than_can_be_shown_the_claim_leaves_it_out():
    loop = built("three-laws-noise", "lyapunov")
    claim = certify(loop, "here", Wanted(pointing=True)).claim("pointing")
    assert claim.outcome == "proved"
    assert claim.numbers["share"] is None
    assert "without:sensor gaussian" in claim.assumptions


def test_a_claim_with_its_loops_own_pushes_is_about_that_loop():
    own = Loop(make_subject(nadir()))
    claim = noise_claim(nadir())
    against = pushes(own.loop, own.known.envelope(noisy=True))
    claim["numbers"] |= {name: str(Fraction(x)) for name, x in (against.numbers | own.bounds(own.words)).items()}
    assert list(numbers_apart(claim, own)) == []
    less = str(Fraction(against.outside) * Fraction(999, 1000))
    claim["numbers"]["outside"] = less
    assert list(numbers_apart(claim, own)) == ["outside is exceeded"]


def test_the_noise_of_each_magnetometer_is_counted():
    """A claim that counts one vector a sample is not about a loop with two."""
    loop = nadir()
    one, two = (Loop(make_subject(each)) for each in (loop, loop.with_parts(*loop.parts, loop.find("magnetometer"))))
    assert (gaussian_vectors(one.loop), gaussian_vectors(two.loop)) == (1, 2)
    claim = noise_claim(loop)
    assert "noise.beside" in claim["numbers"]
    differs = "the noise.beside.vectors differs"
    assert differs not in list(numbers_apart(claim, one))
    assert differs in list(numbers_apart(claim, two))
    claim["numbers"]["noise.beside.vectors"] = "2"
    assert differs in list(numbers_apart(claim, one))
    assert differs not in list(numbers_apart(claim, two))


def test_a_torque_that_is_told_changes_as_fast_as_it_does_in_the_loop_of_the_claim():
    """Without a number it may turn over at once, and one number alone says that the other is zero."""
    own = Loop(make_subject(nadir()))
    claim = noise_claim(nadir())
    pushed = pushes(own.loop, own.known.envelope(noisy=True))
    claim["numbers"] |= {name: str(Fraction(x)) for name, x in (pushed.numbers | own.bounds(own.words)).items()}
    change = change_of_modelled(own.loop, own.known.envelope(noisy=True))
    assert min(change) > 0.0
    numbers = {name: str(Fraction(x)) for name, x in zip(CHANGE, change, strict=True)}
    assert list(numbers_apart(claim | {"numbers": claim["numbers"] | numbers}, own)) == []
    for name in CHANGE:
        less = numbers | {name: str(Fraction(numbers[name]) * Fraction(999, 1000))}
        assert list(numbers_apart(claim | {"numbers": claim["numbers"] | less}, own)) == [f"{name} is exceeded"]
        del less[name]
        assert f"{name} is exceeded" in numbers_apart(claim | {"numbers": claim["numbers"] | less}, own)


def test_a_torque_may_turn_over_at_once_if_its_position_is_told_or_its_part_does_not_say(monkeypatch):
    loop = nadir()
    envelope = envelope_of(loop, 0.0, noisy=True)
    receiver = find("sensor", "gnss")
    assert max(change_of_modelled(loop, envelope)) < 1e-6
    assert min(change_of_modelled(loop.with_parts(Fitted(receiver, receiver.examples()[0])), envelope)) == math.inf
    monkeypatch.delattr(find("environment", "gravity-gradient").module, "torque_change")
    assert min(change_of_modelled(loop, envelope)) == math.inf


@pytest.mark.slow
@pytest.mark.parametrize("law", ["lyapunov", "wheel"])
def test_what_is_proved_of_a_cubesat_as_it_flies_is_checked(law, tmp_path, monkeypatch):
    certificate = certify(built("cubesat-nadir", law), law, Wanted(pointing=True))
    assert certificate.outcome == "proved"
    stated = certificate.claim("pointing").numbers
    assert math.degrees(stated["angle"]) < 0.20
    larger = re.match(r"from (\d+) deg at ([\d.]+) deg/s: the torque exceeds its limit", certificate.no_larger_start)
    more = math.radians(float(larger[1])) / stated["slew_angle"], math.radians(float(larger[2])) / stated["rate_start"]
    assert 1.0 - 1e-9 < min(more) < 1.0 + 1e-9 < max(more) < 3.0
    path = tmp_path / "certificate.json"
    write([certificate], "cubesat-nadir", path)
    assert passed(check_file(path))
    # A check of less than half a second, by its operations with fractions: some 40 000 (what corners of an ellipsoid have in
    # common was 12 000 more).
    proof = certificate.claim("pointing").proof
    done = counted(monkeypatch)
    assert check(json.dumps(found([*proof.programs.values()], [proof.claim])))
    assert sum(done.values()) < 45_000


def counted(monkeypatch):
    """How often fractions are added, subtracted, multiplied and divided from now on."""
    done = Counter()

    def counting(name, kept):
        def operation(*pair):
            done[name] += 1
            return kept(*pair)

        return operation

    for name in ("__add__", "__radd__", "__sub__", "__rsub__", "__mul__", "__rmul__", "__truediv__"):
        monkeypatch.setattr(Fraction, name, counting(name, getattr(Fraction, name)))
    return done
