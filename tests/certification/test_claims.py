"""What is proved of each law, against numbers computed otherwise."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from starhold.algebra.vector import ZERO
from starhold.analysis.trial import fly_claims
from starhold.certification.certificate import write
from starhold.certification.certify import certify
from starhold.certification.comparison import differences
from starhold.certification.matrices import number
from starhold.certification.subject import make_subject
from starhold.checker import check, check_file, passed
from starhold.laws.interface import Measurement, NoMemory
from starhold.parts.craft import make_craft
from tests.certification.loops import FULL, certified, loop_of, tensor, textbook
from tests.making import ORBITAL, aimed
from tests.tiers import WHOLE, drawn, leading

LOOPS = textbook()
FULL_OF_PRODUCTS = [[2.0, 0.1, 0.0], [0.1, 3.0, -0.25], [0.0, -0.25, 4.0]]
FIRST = [("pd-0", "shortest"), ("lyapunov-0", "hysteresis")]
EACH = ("pd-0", "lyapunov-0", "lqr-I", "matrix-pd-diagonal", "sliding-0", "wheel-0")
"""Every law once."""
CONVERGENT = sorted(name for name in LOOPS if not name.startswith(("sliding", "wheel")))
SIGNED = dict.fromkeys([*FIRST, *((name, policy) for name in CONVERGENT for policy in ("shortest", "hysteresis"))])


# --- what holds -------------------------------------------------------------------------------------------------------


def accepted(content):
    """Assert that the checker finds what is proved in a file to hold, and nothing else."""
    found = check(content)
    assert passed(found), [f for f in found if f.verdict == "fails"]
    for claim in content["certificates"][0]["claims"]:
        held = [f.obligation for f in found if f.claim == claim["kind"] and f.verdict == "holds"]
        assert bool(held) == (claim["outcome"] == "proved"), claim["kind"]


@pytest.mark.parametrize("name", leading(dict.fromkeys([*EACH, *sorted(LOOPS)]), len(EACH)))
def test_every_law_is_certified_under_its_textbook_assumptions(made, name):
    certificate = certified(name)
    undecided = {c.kind for c in certificate.claims if c.outcome != "proved"}
    # Nothing is shown of the held torque of a law that switches at rest on target.
    assert undecided == ({"sampling"} if name == "sliding-0" else set())
    main = certificate.claim("sliding" if name.startswith("sliding") else "convergence")
    assert main.numbers["everything"]
    assert all(o.how for c in certificate.claims for o in c.obligations)
    accepted(made(name))


@pytest.mark.parametrize(("name", "sign_policy"), drawn(SIGNED, 5, len(FIRST)))
def test_the_quaternion_sign_is_in_the_claim(made, name, sign_policy):
    main = certified(name, sign_policy).claim("convergence")
    assert main.outcome == "proved"
    if sign_policy == "hysteresis":
        assert "a jump lowers V" in [o.name for o in main.obligations]
    else:
        # The switch at half a turn is outside the set, and all that is less than half a turn at rest is inside.
        assert math.radians(179.5) < main.numbers["slew_angle"] < math.pi
    accepted(made(name, sign_policy))


TARGETS = [(ORBITAL, "axis"), (ORBITAL, "norm"), (aimed((1.0, 0.0, 0.0, 0.0)), "norm")]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("target", "limit", "sign_policy"),
    drawn([(*given, policy) for policy in ("as_published", "hysteresis", "shortest") for given in TARGETS], 2),
)
def test_moving_targets_and_limits_of_the_norm(tmp_path, sign_policy, target, limit):
    # One clipped, one with a gyroscopic torque, one that slides: each other law has one of these terms or none.
    chosen = [LOOPS[name] for name in ("pd-2", "sliding-1", *(["lqr-I"] if WHOLE else []))]
    loops = [loop_of(o.law.name, o.gains, o.craft, sign_policy=sign_policy, target=target, limit=limit) for o in chosen]
    write([certify(loop) for loop in loops], "made", tmp_path / "c.json")
    found = check_file(tmp_path / "c.json")
    assert passed(found), [f for f in found if f.verdict == "fails"]
    assert {f.claim for f in found if f.verdict == "holds"} >= {"convergence", "sliding", "sampling"}


# --- another loop -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["pd-0", "lqr-I", "sliding-1", "wheel-0"])
def test_other_gains_or_another_inertia_are_another_loop(made, name):
    loop, claims = LOOPS[name], made(name)["claims"]
    assert claims
    assert not any(differences(claim, loop) for claim in claims)
    heavier = replace(loop, craft=make_craft((1.05 * tensor(loop.craft.inertia)).tolist(), torque_limit=0.05))
    assert any(differences(claim, heavier) for claim in claims)
    for gain, value in loop.gains._asdict().items():
        if isinstance(value, float) and value:
            changed = replace(loop, gains=loop.gains._replace(**{gain: 1.05 * value}))
            assert any(differences(claim, changed) for claim in claims), gain


def test_a_limit_is_compared_with_what_the_orbit_has():
    loop = loop_of("pd", LOOPS["pd-0"].gains, FULL, target=ORBITAL)
    limited = certify(loop).claim("torque-limit").proof.claim
    assert not differences(limited, loop)
    lower = loop.start._replace(position=tuple(0.9 * x for x in loop.start.position))
    assert {text for text in differences(limited, replace(loop, start=lower)) if text.endswith("is exceeded")}


def test_the_bounds_over_the_orbit_hold_on_it():
    """Along an eccentric orbit, by Kepler's equation, no torque and no rate exceeds what is claimed of it, nor is that much
    more than there is."""
    mu, a, e = 3.986e14, 9e6, 0.2
    inertia = np.array(FULL_OF_PRODUCTS)
    perigee = a * (1.0 - e)
    h = math.sqrt(mu * a * (1.0 - e * e))
    anomalies = np.linspace(0.0, 2.0 * math.pi, 721)
    r = a * (1.0 - e * e) / (1.0 + e * np.cos(anomalies))
    n = np.random.default_rng(1).normal(size=(20_000, 3))
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    torque = 3.0 * mu / perigee**3 * np.cross(n, n @ inertia)
    loop = loop_of("pd", LOOPS["pd-0"].gains, make_craft(FULL_OF_PRODUCTS)._replace(gravity=mu), target=ORBITAL)
    begun = loop.start._replace(position=(perigee, 0.0, 0.0), velocity=(0.0, h / perigee, 0.0))
    subject = make_subject(replace(loop, start=begun))
    for bound, found in (
        (subject.target_rate, h / r**2),
        (subject.target_acceleration, np.abs(2.0 * mu * e * np.sin(anomalies) / r**3)),
        (subject.modelled_norm, np.linalg.norm(torque, axis=1)),
        *zip(subject.modelled, np.abs(torque).T, strict=True),
    ):
        assert found.max() <= number(bound) <= 2.0 * found.max()


# --- against numbers computed otherwise ----------------------------------------------------------------------------------


def test_pd_alone_is_never_within_its_limit_everywhere():
    assert not certified("pd-0").claim("torque-limit").numbers["everything"]


def by_differences(loop, turned):
    """Minus the slopes of the torque by the rate, or by the attitude, at rest on target."""

    def torque(axis):
        rate, turn = (ZERO, axis) if turned else (axis, ZERO)
        measurement = Measurement((1.0, *turn), tuple(rate), tuple(rate), *[ZERO] * 4, 0.1, ZERO)
        return np.array(loop.law.command(measurement, loop.gains, loop.craft, NoMemory())[0])

    return np.array([torque(-axis) - torque(axis) for axis in 1e-5 * np.eye(3)]).T / 2e-5


@pytest.mark.parametrize("name", leading(["pd-0", "sliding-1", "lqr-I", "lqr-III", "matrix-pd-diagonal"], 2))
def test_longest_period_is_where_the_sampled_loop_loses_stability(name):
    loop = LOOPS[name]
    claim = certified(name).claim("sampling")
    rate, attitude = (by_differences(loop, turned) for turned in (False, True))
    J = tensor(loop.craft.inertia)

    def radius(h):
        """Spectral radius through the matrix exponential, as a control engineer discretises."""
        a = np.zeros((9, 9))
        a[3:6, :3], a[:3, 6:] = 0.5 * np.eye(3), np.linalg.inv(J)
        step = expm(a * h)[:6]
        return np.abs(np.linalg.eigvals(step[:, :6] - step[:, 6:] @ np.hstack([rate, attitude]))).max()

    n = claim.numbers
    least = radius(n["period"])
    assert least <= n["radius"] <= least + 1.1e-4 * (1.0 - least)
    assert radius(n["longest"]) < 1.0
    assert radius(n["longest"] * 1.001) > 1.0
    if n["every_shorter"]:
        assert all(radius(h) < 1.0 for h in np.linspace(1e-3, 1.0, 200) * n["longest"])
    assert np.abs([complex(*z) for z in n["eigenvalues"]]).max() == pytest.approx(least, rel=1e-9)


def test_flights_try_every_kind_of_set():
    for name in ("pd-0", "lqr-III", "sliding-0", "sliding-1"):
        trial = fly_claims(LOOPS[name], certified(name), flights=512)
        assert trial.flights == 512
        assert trial.highest_share <= 1.0 + 1e-6


def test_a_claim_whose_check_takes_too_much_work_is_not_made(monkeypatch):
    monkeypatch.setattr("starhold.kernel.numbers.WORK", 8_000)
    made = certify(LOOPS["pd-0"], "here")
    assert {claim.outcome for claim in made.claims} == {"undecided"}
    assert all("the check takes too much work" in str(claim.obligations) for claim in made.claims)
