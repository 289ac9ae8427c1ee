"""Certifier, checker and flights say the same, also where numbers or scenarios are odd."""

import json
import math

import numpy as np
import pytest
from flint import arb

from starhold.analysis.trial import draw, fly_claims
from starhold.certification.certify import Wanted, certify
from starhold.certification.evidence.attitude import LEAST_TURN
from starhold.checker import passed
from starhold.laws import pd, wheel
from starhold.laws.catalogue import catalogue
from starhold.parts.craft import make_craft
from tests.certification.edits import checked
from tests.certification.hunt import contradicted, fault_in, random_scenario
from tests.certification.loops import energy, free, loop_of, rotors
from tests.tiers import drawn, leading, seeds

FOUND = (12, 15, 30, 90, 58, 66, 91, 98, 118, 2489, 3239, 22, 71, 111, 196, 2102)
"""Seeds of scenarios that certifier, checker or flights once did not agree on, last those that take long."""


@pytest.mark.parametrize("seed", leading(FOUND, 2))
def test_hunted_scenarios(seed, tmp_path):
    text = random_scenario(np.random.default_rng(seed), tmp_path)
    assert fault_in(text, tmp_path) == ""


@pytest.mark.slow
def test_many_random_scenarios(tmp_path):
    for seed in seeds(15):
        text = random_scenario(np.random.default_rng(seed), tmp_path)
        assert fault_in(text, tmp_path) == "", seed


def test_a_law_that_clips_its_torque_is_certified(tmp_path):
    text = random_scenario(np.random.default_rng(1104), tmp_path)
    assert 'limit = "axis"' in text.split("[[law]]")[1]
    assert fault_in(text, tmp_path) == ""


@pytest.mark.slow
def test_no_flight_contradicts_what_is_proved_of_flights_like_it(tmp_path):
    for seed in seeds(20):
        random = np.random.default_rng(seed)
        text = random_scenario(random, tmp_path)
        assert contradicted(text, random, tmp_path) == "", seed


# --- what is asked of laws without V --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("law", "wheels"), leading([("sliding", True), ("modal", False), ("sliding", False), ("modal", True)])
)
def test_what_cannot_be_shown_is_undecided_for_the_checker_too(law, wheels, tmp_path):
    wanted = Wanted(rate=math.inf, slew_angle=1.0, inertia_tolerance=0.1)
    gains = catalogue()[law].examples()[0]
    certificate = certify(rotors(law, gains) if wheels else free(loop_of(law, gains)), law, wanted)
    # The first example of `sliding` switches at rest on target, where nothing is shown of held torque.
    undecided = {claim.kind for claim in certificate.claims if claim.outcome == "undecided"}
    assert len(undecided) == 3 + ("sampling" in undecided)
    assert ("sampling" in undecided) == (law == "sliding")
    found = checked(certificate, tmp_path)
    assert passed(found)
    assert {f.claim for f in found if f.verdict == "not claimed"} == undecided
    assert not any(f.verdict == "holds" for f in found if f.claim in undecided)


@pytest.mark.parametrize(
    ("compensation", "wheels"), leading([(0.3, True), (0.0, False), (0.3, False), (1.0, False), (0.0, True), (1.0, True)])
)
def test_a_law_may_cancel_a_part_of_the_modelled_torque(compensation, wheels, tmp_path):
    gains = wheel.Gains(0.09, (0.0045, 0.0045, 0.0045), compensation)
    certificate = certify(rotors("wheel", gains), "wheel") if wheels else certify(loop_of("wheel", gains), "wheel")
    assert certificate.claim("convergence").outcome == "proved"
    assert passed(checked(certificate, tmp_path))


# --- numbers at the edge --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("law", "slew_angle"),
    drawn([(law, angle) for angle in (1e-100, 1e-12, 1e-8, 1e-4, 0.02, 1.0) for law in ("pd", "wheel")], 5),
)
def test_the_set_of_a_turn_holds_it(law, slew_angle, tmp_path):
    gains = {"pd": pd.Gains(0.09, 0.009), "wheel": wheel.Gains(0.09, (0.0045,) * 3)}[law]
    certificate = certify(free(loop_of(law, gains)), law, Wanted(slew_angle=slew_angle))
    claim = certificate.claim("torque-limit")
    assert claim.outcome == "proved"
    size = 0.018 * 2 * (arb(slew_angle) / 4).sin() ** 2 if law == "pd" else 0.018 * (arb(slew_angle) / 2).sin() ** 2
    assert arb(claim.numbers["start"]) >= size * (1 - arb(2) ** -45)
    assert claim.numbers["slew_angle"] <= max(slew_angle, LEAST_TURN)
    assert passed(checked(certificate, tmp_path))


THIN = ([1e-14, 1.0, 1.0], [1e-20, 1.0, 1.0], [1e-14, 1e-14, 1e-14], [1e3, 1e3, 1e-12])


def thin():
    """Laws with their gains and bodies: two that say most, then every other."""
    laws = ("lqr", "modal", "wheel", "sliding", "pd", "lyapunov")
    of = {law: range(1 if law == "modal" else len(catalogue()[law].examples())) for law in laws}
    every = [(law, number, moments) for law in laws for number in of[law] for moments in THIN]
    first = [("wheel", 0, THIN[2]), ("sliding", 0, THIN[3])]
    return drawn([*first, *(one for one in every if one not in first)], 12, len(first))


@pytest.mark.parametrize(("law", "number", "moments"), thin())
def test_thin_bodies_have_certificates(law, number, moments, tmp_path):
    gains = catalogue()[law].examples()[number]
    certificate = certify(free(loop_of(law, gains, make_craft(moments, torque_limit=0.05))), law, Wanted(disturbance=1e-6))
    json.dumps([claim.numbers for claim in certificate.claims], allow_nan=False)
    for claim in certificate.claims:
        assert claim.outcome != "proved" or (claim.witness.get("rate_bound") or 1.0) > 0.0
    assert passed(checked(certificate, tmp_path))


def test_flights_do_not_hold_the_torque_for_a_period_that_is_too_long():
    loop = free(loop_of("pd", pd.Gains(0.09, 0.009), period=45.0))
    certificate = certify(loop, "pd")
    assert certificate.claim("sampling").outcome == "refuted"
    assert certificate.claim("convergence").outcome == "proved"
    assert fly_claims(loop, certificate, flights=200).highest_share <= 1.0 + 1e-6


def test_states_are_drawn_from_the_set_however_small_it_is():
    random = np.random.default_rng(1)
    even = np.diag([0.01, 0.02, 0.03])

    def cosines(states):
        return np.sum(states[4:7] ** 2, axis=0) + np.einsum("ik,ij,jk->k", states[1:4], even, states[1:4])

    for height in (energy(2.0 * np.eye(3), 0.02), cosines):
        for level in (1e-25, 1e-12, 1e-3):
            values = height(states := draw(2000, height, level, random))
            assert values.max() <= level * (1.0 + 1e-9)
            assert values.max() >= level * (1.0 - 1e-6)
            states[4:7] = 0.0
            assert height(states).max() >= 0.9 * level
