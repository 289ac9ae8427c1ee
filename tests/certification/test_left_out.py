"""Every claim leaves out by name what its loop has and its theorem does not take in."""

from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from starhold.certification.assumptions import ASSUMPTIONS
from starhold.certification.certificate import ORBIT, write
from starhold.certification.certify import Wanted, certify
from starhold.certification.station import certify_station
from starhold.certification.unmodelled import DETUMBLING, Pushes, envelope_of, named, pushes
from starhold.certification.wording import sentence
from starhold.checker import check_file, passed
from starhold.laws import modal, wheel
from starhold.parts.catalogue import PACKAGES, fit, parts
from starhold.parts.contract import Noise, NoParams, Push
from starhold.parts.part import Fitted, Part
from starhold.scenario.building import build
from starhold.scenario.reading import builtin_text, parse
from tests.certification.attack import flown
from tests.certification.loops import certified, is_pointing, loop_of, rotors, says, textbook
from tests.certification.own_spacecraft import OWN
from tests.kernel import stations
from tests.making import built, on_wheels
from tests.parts.files import ACTUATOR, JETS, part
from tests.tiers import leading

NO, PUSH, SHAKEN = (lambda *_: None), (lambda *_: Push(1e-6)), (lambda *_: Noise(torque=1e-6))
LAWS = ("pd-0", "sliding-0", "wheel-0", "lyapunov-0", "lqr-I", "lqr-II", "lqr-III", "matrix-pd-inertial", "modal")
TAKEN = {"two-body", "gravity-gradient", "linear-gravity", "three-body-gravity", "wheels", "history"}
"""The parts that the theorems in docs/certificates.md take in, beside targets that say their motion."""


def others(body):
    """Every installed part for a body that no theorem takes in, with its first example."""
    found = [part for role in set(PACKAGES) - {"body"} for part in parts(role).values() if part.body in ("", body)]
    said = [part for part in found if part.name not in TAKEN and (part.role, bool(part.hook("motion"))) != ("target", True)]
    return [Fitted(part, part.examples()[0]) for part in said]


@cache
def made(name):
    """A loop of a law and its certificate."""
    if name == "modal":
        loop = loop_of("modal", modal.examples()[0])
        return loop, certify(loop, name)
    return textbook()[name], certified(name, disturbance=1e-4)


@pytest.mark.parametrize("name", leading(LAWS))
def test_every_part_is_named_in_every_claim_that_does_not_take_it_in(name):
    loop, certificate = made(name)
    assert any(claim.outcome == "proved" for claim in certificate.claims)
    found = others("rigid-body")
    assert {"lag", "rate-limit", "gaussian", "random-torque", "constant-torque", "torque-table"} <= {
        f.part.name for f in found
    }
    for fitted in found:
        composed = loop.with_parts(fitted)
        enters = says(fitted)
        assert enters or pushes(composed, envelope_of(composed, 1.0, noisy=False)).steady == Pushes(0.0), fitted.called
        claims = named(list(certificate.claims), composed, 1.0)
        for claim, plain in zip(claims, certificate.claims, strict=True):
            told = f"without:{fitted.part.role} {fitted.called}"
            assert (told in claim.assumptions) != (enters and is_pointing(claim)), (claim.kind, fitted.called)
            kept = [text for text in claim.assumptions if text != told and not text.startswith(ORBIT)]
            assert kept == list(plain.assumptions)


@pytest.mark.parametrize("name", ["pd-0", "sliding-1"])
def test_a_loop_of_all_parts_at_once_passes_the_checker(name, tmp_path):
    loop = textbook()[name].without("target")
    every = [f for f in others("rigid-body") if f.part.role != "target"]
    certificate = certify(loop.with_parts(*every), name)
    path = tmp_path / "certificate.json"
    write([certificate], name, path)
    assert passed(check_file(path)), [f for f in check_file(path) if f.verdict == "fails"]
    for claim in certificate.claims:
        named = [f for f in every if not (is_pointing(claim) and says(f))]
        assert len([text for text in claim.assumptions if text.startswith("without:")]) >= len(named) - 4


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("torque_limit", 'actuator_lag = "20 s"\ntorque_limit', "without the actuator lag, the linear loop is stable"),
        ("[simulation]", "[sensor]\nrate_noise = 1e-5\n[simulation]", "without the sensor gaussian, the linear loop"),
        ("gravity_gradient", "torque_noise = 1e-5\ngravity_gradient", "without the environment random-torque, the linear"),
    ],
)
def test_a_margin_of_sampling_says_what_it_does_without(old, new, told):
    base = builtin_text("three-laws").split("[[law]]")[0].replace(old, new, 1)
    certificate = certify(built(parse(base + '[[law]]\ntype = "lyapunov"\nk_rate = 0.09\nk_attitude = 0.009\n', "here")))
    assert sentence(certificate.claim("sampling"), certificate.subject).startswith(told)


@pytest.mark.parametrize("loop", [stations.loop_of(), stations.loop_of(stations.REST, 4.0, "axis")])
def test_parts_of_a_loop_near_a_libration_point_are_named_too(loop):
    found = others("libration-point")
    assert "lag" in {f.part.name for f in found}
    certificate = certify_station(loop.with_parts(*found))
    assert certificate.outcome == "proved"
    for claim in certificate.claims:
        assert {f"without:{f.part.role} {f.called}" for f in found} < set(claim.assumptions)


@pytest.mark.parametrize(
    "loop",
    [
        stations.loop_of(limit=4.0),
        stations.loop_of(stations.BEST._replace(model=1), model="nonlinear"),
        stations.loop_of(stations.REST, 4.0, "axis"),
        stations.loop_of(stations.REST._replace(model=1), model="nonlinear"),
    ],
)
def test_every_assumption_near_a_libration_point_is_told(loop):
    assert {name for claim in certify_station(loop).claims for name in claim.assumptions} <= set(ASSUMPTIONS)


# --- how far a bound reaches ------------------------------------------------------------------------------------------


def pushed(loop, momentum=1.0):
    """What the parts of a loop do together."""
    return pushes(loop, envelope_of(loop, momentum, noisy=False))


def test_bounds_are_those_of_the_whole_orbit():
    """A residual dipole is pushed as the strongest field of the orbit does, whose perigee is at half the distance."""
    loop = textbook()["pd-0"].with_parts(fit("environment", "residual-dipole", (0.01, 0.0, 0.02)))
    gravity = loop.craft.gravity
    torques = [
        pushed(replace(loop, start=loop.start._replace(position=(2.4e7, 0.0, 0.0), velocity=(0.0, speed, 0.0)))).outside
        for speed in ((gravity / 2.4e7) ** 0.5, (2.0 * gravity * (1.0 / 2.4e7 - 1.0 / 3.6e7)) ** 0.5)
    ]
    assert 8.0 < torques[1] / torques[0] < 9.5


def test_an_error_without_a_bound_is_refused_and_not_left_out():
    """Of wheels that no limit keeps slow: no claim leaves wheels out by name."""
    free = rotors("wheel", wheel.examples()[0])
    rubbed = on_wheels(free, momentum_limit=(float("inf"),) * 4, viscous=(1e-6,) * 4)
    assert pushed(rubbed).command == float("inf")
    assert pushed(on_wheels(free, viscous=(1e-6,) * 4)).command < 1e-2
    assert certify(rubbed, "", Wanted(pointing=True, disturbance=1e-9)).claim("pointing").outcome == "undecided"


def half_told(role, **equations):
    """A part of one's own with some of the hooks of another."""
    names = {"CARD": None, "ROLE": role, "Params": NoParams, "examples": lambda: [NoParams()]}
    return Fitted(Part("of-ones-own", SimpleNamespace(**names, **equations), Path("own.py")), NoParams())


@pytest.mark.parametrize(
    ("own", "enters"),
    [
        (half_told("effector", ACTS=True, reaction=NO, error=PUSH), False),
        (half_told("effector", ACTS=True, reaction=NO, error=PUSH, bound=PUSH), True),
        (half_told("effector", ACTS=True, reaction=NO, bound=PUSH), False),
        (half_told("effector", reaction=NO, bound=PUSH), True),
        (half_told("environment", torque=NO, bound=PUSH), True),
        (half_told("environment", torque=NO, bound=PUSH, acceleration=NO), False),
        # Of a momentum without wheels nothing is known.
        (half_told("environment", torque=NO, bound=lambda _, envelope: Push(1e-3 * envelope.momentum)), False),
        (half_told("environment", torque=NO, bound=PUSH, MODELLED=True), False),
    ],
)
def test_a_part_that_tells_half_of_what_it_does_is_left_out(own, enters):
    """An effector's reaction without its bound, a force that moves the orbit, a torque that the law is told."""
    claim = certified("pd-0", disturbance=1e-4).claim("pointing")
    (told,) = named([claim], textbook()["pd-0"].with_parts(own), 1.0)
    assert (f"without:{own.part.role} of-ones-own" in told.assumptions) != enters


@pytest.mark.parametrize(
    ("own", "enters", "detumbles"),
    [
        (half_told("environment", torque=NO, noise=SHAKEN), True, False),
        (half_told("environment", torque=NO, noise=SHAKEN, bound=PUSH), True, False),
        (half_told("environment", torque=NO, noise=SHAKEN, bound=lambda *_: Push(float("inf"))), False, False),
        (half_told("environment", torque=NO, noise=SHAKEN, acceleration=NO), False, False),
        (half_told("environment", torque=NO, noise=lambda *_: Noise(), bound=PUSH), True, True),
    ],
)
def test_noise_does_not_stand_for_what_else_an_environment_does(own, enters, detumbles):
    """A torque without a bound beside noise, a force that moves the orbit, and noise in a claim that has none."""
    claim = certified("pd-0", disturbance=1e-4).claim("pointing")
    most = replace(claim, numbers={**claim.numbers, "share": 0.9973})
    told = named([most, replace(claim, kind=DETUMBLING)], textbook()["pd-0"].with_parts(own), 1.0)
    assert ["without:environment of-ones-own" not in one.assumptions for one in told] == [enters, detumbles]


@pytest.mark.parametrize(
    ("most", "limit", "wide", "enters"),
    [(1e-4, None, 0.0, False), (2e-3, 2e-3, 0.0, True), (2e-3, 3e-3, 0.0, False), (2e-3, 2e-3, 1e-6, False)],
)
def test_an_effector_that_may_not_give_what_is_asked_of_it_is_left_out(most, limit, wide, enters, tmp_path):
    """A torque without a limit, or with a larger one, or one that an actuator changes; the first flies far outside."""
    said = "\n\ndef error(params, envelope):\n    return Push(2.0 * params.width)\n"
    (tmp_path / "jets.py").write_text(JETS)
    (tmp_path / "dead_zone.py").write_text(ACTUATOR.replace("import Card,", "import Push, Card,") + said)
    text = (
        OWN if limit is None else OWN.replace("[initial]", f"torque_limit = {limit}\n[initial]").replace("20 deg", "2 deg")
    )
    text += part(f'file = "jets.py"\nmost = {most}\n') + part(f'file = "dead_zone.py"\nwidth = {wide}\n') * (wide > 0.0)
    scenario = parse(text, "own.toml", tmp_path)
    loop = build(scenario, scenario.laws[0])
    claim = certify(loop, "own", Wanted(pointing=True, disturbance=1e-5, alone=True)).claim("pointing")
    assert claim.outcome == "proved"
    assert ("without:effector jets" not in claim.assumptions) == enters
    if limit is None or enters:
        assert (flown(loop, claim, np.random.default_rng(1), 8) < 1.0) == enters
