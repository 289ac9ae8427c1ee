"""Files of certificates about loops near a libration point: what the checker takes, and what it refuses."""

import copy
import json
import math

import pytest

from starhold.certification.certificate import write
from starhold.certification.station import certify_station, described_station
from starhold.checker import check, check_file, passed
from starhold.laws import l2_equilibrium
from starhold.laws.catalogue import catalogue
from starhold.parts.bodies.libration_point import POINTS, PRIMARIES
from tests.certification.edits import changed, faults, outcomes, with_kinds
from tests.kernel.stations import BEST, PLANT, REST, SOFT, loop_of
from tests.making import point_loop

PEAK = 3.4295901709068626
CIRCLE, LIMIT = (("certificates", 0, "claims", place) for place in (0, 1))
SUBJECT = ("certificates", 0, "subject")
RELAY = SOFT._replace(boundary_layer=0.0)


@pytest.fixture(scope="session")
def made(tmp_path_factory):
    """What the certifier writes, of which the checker finds nothing false."""
    path = tmp_path_factory.mktemp("stations") / "certificate.json"
    done = {}

    def make(*given, **changes):
        key = (*given, *sorted(changes.items()))
        if key not in done:
            write([certify_station(loop_of(*given, **changes))], "made", path)
            assert [f for f in check_file(path) if f.verdict == "fails"] == []
            done[key] = path.read_text(encoding="utf-8")
        return json.loads(done[key])

    return make


@pytest.mark.parametrize(
    ("gains", "limit", "kind"),
    [
        (BEST, 1.001 * PEAK, "norm"),
        (BEST, 2.0 * PEAK, "norm"),
        (BEST, 1.05 * 2.95, "axis"),
        (SOFT, 1.2 * PEAK, "norm"),
        (SOFT._replace(boundary_layer=1e-3, k=0.05), 1.02 * PEAK, "norm"),
        (SOFT._replace(boundary_layer=5.0), 1.3 * PEAK, "norm"),
        (BEST._replace(alpha=3.0, k=0.2, radius=2.0), 2.1 * PEAK, "norm"),
        (BEST._replace(rate=-2.0, radius=5.0), 26.1, "norm"),
        (BEST._replace(alpha=0.1, k=3.0, radius=0.3), 0.315 * PEAK, "norm"),
        (BEST._replace(radius=1e-4), 1.2e-4 * PEAK, "norm"),
        (BEST._replace(radius=1e3, alpha=1e-6), 1.2e3 * PEAK, "norm"),
    ],
)
def test_the_control_stays_within_its_limit(made, gains, limit, kind):
    content = made(gains, limit, kind)
    assert outcomes(content) == {"circle": "proved", "control-limit": "proved"}
    assert {f.verdict for f in check(content)} == {"holds"}


@pytest.mark.parametrize("name", sorted(PRIMARIES))
def test_x_returns_at_all_points(made, name):
    for point in POINTS:
        plant = PRIMARIES[name].point(point)
        content = made(l2_equilibrium.design(plant, l2_equilibrium.Degree(y=0.3)), 5.0, "axis", plant=plant)
        assert outcomes(content) == {"equilibrium": "proved", "saturated-axis": "proved"}
        assert {f.verdict for f in check(content)} == {"holds"}


@pytest.mark.parametrize(("limit", "kind"), [(math.inf, "axis"), (3.0, "norm"), (3.0, "none")])
def test_without_a_limit_by_axis_rest_alone_is_claimed(made, limit, kind):
    assert outcomes(made(REST, limit, kind)) == {"equilibrium": "proved"}


@pytest.mark.parametrize("gains", [BEST, SOFT, REST])
def test_the_full_problem_is_proved_with_its_feed_forward(made, gains):
    content = made(gains._replace(model=1), model="nonlinear")
    assert set(outcomes(content).values()) == {"proved"}
    told = content["certificates"][0]["claims"][0]["assumptions"]
    assert told[0] == "whole-field"
    assert (told[-1] == "off-the-bodies") == (gains is REST)


@pytest.mark.parametrize(
    ("gains", "limit", "kind", "name"),
    [
        (BEST, 0.95 * PEAK, "norm", "control"),
        (SOFT, 2.7, "axis", "control"),
        (RELAY, math.inf, "norm", "only the circle"),
        (BEST._replace(k_x=8.0), math.inf, "norm", "x returns"),
        (REST._replace(k_x=8.0), math.inf, "axis", "each axis returns"),
    ],
)
def test_what_is_refuted_has_a_proof_too(made, gains, limit, kind, name):
    content = made(gains, limit, kind)
    told = [f for f in check(content) if f.reason.startswith("refuted: ")]
    assert [f.obligation for f in told] == [name]
    assert passed(check(content))
    without = copy.deepcopy(content)
    del without["certificates"][0]["proof"]
    assert not passed(check(without))


def test_what_a_certificate_tells_is_what_was_proved(made):
    content = made(BEST, 1.2 * PEAK)
    for place in (CIRCLE, LIMIT):
        claim = content["certificates"][0]["claims"][place[-1]]
        for key, value in claim["numbers"].items():
            for other in (None, 0.0, "1", *([value * (1.0 + 1e-15)] if isinstance(value, float) else ())):
                assert faults(changed(content, (*place, "numbers", key), other)), key
        for key in ("assumptions", "obligations"):
            assert faults(changed(content, (*place, key), claim[key][:-1])), key
        assert faults(changed(content, (*place, "witness"), {"mu": 1.0}))
        assert faults(changed(content, (*place, "kind"), "equilibrium"))
    one = copy.deepcopy(content)
    one["certificates"][0]["claims"].pop()
    assert faults(with_kinds(one))
    assert faults(changed(content, ("claims", 0, "numbers", "level"), "1"))


@pytest.mark.parametrize(
    ("key", "value", "told"),
    [
        (("gains", "radius"), 1.1, "another number for gains.radius"),
        (("gains", "k"), -1.0, ""),
        (("gains", "feedback"), "relay", "the law of the proof"),
        (("gains", "model"), "nonlinear", "the law of the proof"),
        (("gains", "other"), 1.0, "the gains are not"),
        (("model",), "nonlinear", "the field of the proof"),
        (("law",), "l2-equilibrium", "the gains are not"),
        (("limit",), "axis", "the limit is not the loop's"),
        (("control_limit",), None, "the limit is not the loop's"),
        (("control_limit",), 4.0, "the limit is not the loop's"),
        (("control_limit",), -1.0, "not positive"),
        (("control_period",), 0.0, "not positive"),
        (("lag",), -1.0, "negative"),
        (("plant",), PRIMARIES["sun-earth"].point("L1")._asdict(), "another number for plant.stiffness"),
        (("nominal",), PRIMARIES["sun-earth"].point("L1")._asdict(), "another number for craft.stiffness"),
        *[(("plant", name), 1.01 * getattr(PLANT, name), "") for name in PLANT._fields],
    ],
)
def test_the_claims_are_about_this_loop(made, key, value, told):
    found = faults(changed(made(BEST, 1.2 * PEAK), (*SUBJECT, *key), value))
    assert any(told in text for text in found.values()), found


def test_other_laws_claim_nothing(made):
    for law in catalogue("libration-point").values():
        for gains in law.examples():
            loop = point_loop(PLANT, law, gains, loop_of().start, 1e-3)
            declares = law.hook("rest") or (law.hook("errors") and law.lyapunov)
            assert bool(certify_station(loop).claims) == bool(declares)
            other = changed(made(), SUBJECT, json.loads(json.dumps(described_station(loop))))
            assert law.name == "l2-circle" or faults(other)


@pytest.mark.parametrize(
    ("gains", "change"),
    [
        (RELAY, {"radius": 1000.0}),
        (RELAY, {"k": 3e-51}),
        (RELAY, {"radius": 1e-150, "k": 3e199}),
        (BEST, {"radius": 1e-150}),
        (BEST, {"radius": 1e200}),
        (SOFT, {"k": 1e-300}),
    ],
)
def test_gains_of_any_size_end_in_what_the_checker_takes(made, gains, change):
    made(gains._replace(**change), 1.0)
