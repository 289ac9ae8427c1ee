"""What `check --scenario` says of scenarios that differ in one key, or in one part, from the one of a certificate: that they
are others, or what is left open of them, or nothing, and then flights keep the claim."""

import tomllib
from collections import Counter

import numpy as np
import pytest

import starhold as sh
from starhold.analysis.departure import start_inside
from starhold.certification.certificate import write
from starhold.scenario.building import build
from starhold.scenario.reading import builtin_text
from starhold.studies.body import study_of
from starhold.studies.certificates import compare_programs, left_open
from tests.certification.differential import judged, others
from tests.tiers import fewer

PUSHED = {
    "name": "pushed",
    "spacecraft": {"inertia": [[20.0, 1.0, 0.0], [1.0, 30.0, -2.0], [0.0, -2.0, 25.0]], "torque_limit": 0.5},
    "orbit": {"altitude": "500 km", "inclination": "60 deg"},
    "initial": {"angles": ["6 deg", "-3 deg", "4 deg"]},
    "target": {"mode": "inertial", "attitude": [1, 0, 0, 0]},
    "environment": {"gravity_gradient": True},
    "simulation": {"duration": "20 min", "control_period": 0.2},
    "part": [{"type": "constant-torque", "torque": [1e-4, -2e-4, 1e-4]}, {"type": "gyro", "bias": [1e-5, 0.0, -1e-5]}],
    "law": [{"type": "pd", "k_rate": 8.0, "k_attitude": 3.0, "quaternion_sign": "shortest"}],
}

NEAR = {"relative_to": "target", "angles": ["2 deg", "-1 deg", "1 deg"]}
"""A start within every claim."""


def proved_of(certificate):
    """The claim about the loop as it flies, if it is proved of all parts: flights with others are not covered."""
    claim = certificate.claim("pointing")
    return claim if claim is not None and claim.outcome == "proved" and not claim.left_out else None


def run_through(tables, folder, count=None):
    """Judge every change, or so many of them, and return how often each verdict was given."""
    scenario, tally, wrong = sh.scenario(tables), Counter(), list[str]()
    issued = [one for e in scenario.laws for one in study_of(scenario.body).certify(scenario, e, build(scenario, e), True)]
    write([one.certificate for one in issued], scenario.name, path := folder / "certificate.json")
    assert compare_programs(path, scenario) == []
    said = left_open(path, scenario)
    every = list(others(tables))
    chosen = every if count is None else [every[k] for k in np.random.default_rng(7).permutation(len(every))[:count]]
    laws = [(one.certificate.name, one.certificate, proved_of(one.certificate), one.loop) for one in issued]
    # Flights that begin elsewhere would contradict nothing.
    assert all(claim is None or start_inside(one, loop)["pointing"] for _, one, claim, loop in laws)
    for changed, other in chosen:
        for name, fault, verdict in judged(path, laws, said, changed, other):
            tally[verdict] += 1
            wrong += [f"{name}: {fault}"] * bool(fault)
    assert wrong == []
    return tally


def test_a_scenario_that_differs_in_one_key_is_another_or_keeps_the_claim(tmp_path):
    tally = run_through(PUSHED, tmp_path, fewer(24, 2))
    assert min(tally[verdict] for verdict in ("another", "said", "silent")) > 0


@pytest.mark.slow
@pytest.mark.parametrize("name", ["", "three-laws", "three-laws-noise", "cubesat-slew", "geostationary", "wheels-orbital"])
def test_every_key_and_every_part_of_a_scenario_makes_it_another_or_keeps_the_claim(name, tmp_path):
    tables = tomllib.loads(builtin_text(name)) | {"initial": NEAR} if name else PUSHED
    tally = run_through(tables, tmp_path)
    assert tally["another"] > 10
