"""Claims about loops near a libration point against flights and random states, and what the checker takes of their files."""

import json
import math

import pytest

from starhold.certification.certificate import write
from starhold.certification.comparison import station_differences
from starhold.certification.station import certify_station
from starhold.checker import check, check_file, passed
from starhold.laws import l2_circle, l2_equilibrium
from starhold.laws.catalogue import catalogue
from starhold.parts.bodies.libration_point import POINTS, PRIMARIES
from tests.certification.edits import outcomes
from tests.kernel.stations import BEST, PLANT, REST, SOFT, loop_of
from tests.making import point_loop
from tests.tiers import leading

PEAK = l2_circle.peak_demand(PLANT, BEST.rate)
STEEP = 1.0 + 2.0 * PLANT.stiffness
BESIDE = l2_equilibrium.design(PLANT, l2_equilibrium.Degree(y=1.0))
RELAY = SOFT._replace(boundary_layer=0.0)
LIMIT = ("certificates", 0, "claims", 1)


def claims_of(*given, **changes):
    return {claim.kind: claim for claim in certify_station(loop_of(*given, **changes)).claims}


# --- round the point --------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_what_the_law_does_not_undo_is_told():
    claim = claims_of(BEST, model="nonlinear")["circle"]
    assert claim.outcome == "undecided"
    assert "full problem" in claim.obligations[0].evidence["reason"]
    assert claims_of(BEST._replace(k_x=8.0))["circle"].outcome == "refuted"
    optimal = catalogue("libration-point")["l2-optimal"]
    assert certify_station(point_loop(PLANT, optimal, optimal.examples()[0], loop_of().start, 1e-3)).outcome == "undecided"


# --- at rest beside the point -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("limit", [1.0, 3.5, 20.0])
def test_the_saturated_axis_is_certified_up_to_the_separatrix(limit):
    """|x + x'/s| < U/p, which is |x + x'| < 1 in the scaled time and twice the linear zone, within 1 %."""
    claim = claims_of(BESIDE._replace(y=0.1), limit, "axis")["saturated-axis"]
    assert claim.outcome == "proved"
    true = limit / STEEP
    assert 0.99 * true < claim.numbers["width"] < true <= claim.numbers["boundary"] < true * (1.0 + 1e-12)
    zone = limit / (BESIDE.k_velocity[0] * math.sqrt(STEEP))
    assert true / zone == pytest.approx(2.0)


OUTCOMES = [
    (BESIDE, math.inf, {}, {"equilibrium": "proved"}),
    (BESIDE, math.inf, {"model": "nonlinear"}, {"equilibrium": "undecided"}),
    (BESIDE._replace(k_x=0.9 * STEEP), math.inf, {}, {"equilibrium": "refuted"}),
    (BESIDE._replace(k_x=0.9 * STEEP), 1.0, {}, {"equilibrium": "refuted"}),
    (BESIDE._replace(model=1), 4.0, {"model": "nonlinear"}, {"equilibrium": "proved"}),
    (BESIDE, 3.0, {}, {"equilibrium": "proved", "saturated-axis": "proved"}),
    (BESIDE, 2.9, {}, {"equilibrium": "proved", "saturated-axis": "undecided"}),
    (BESIDE._replace(y=0.1, k_x=1.2 * BESIDE.k_x), 1.0, {}, {"equilibrium": "proved", "saturated-axis": "undecided"}),
    (BESIDE._replace(y=0.1, k_x=BESIDE.k_x * (1 + 1e-9)), 1.0, {}, {"equilibrium": "proved", "saturated-axis": "proved"}),
]
"""Gains, limit by axis and model. Where the others cannot be held, or feedback is off the separatrix, x is undecided."""


@pytest.mark.parametrize(("gains", "limit", "model", "wanted"), OUTCOMES)
def test_what_is_said_of_rest_and_of_the_limited_axis(gains, limit, model, wanted):
    assert {kind: claim.outcome for kind, claim in claims_of(gains, limit, "axis", **model).items()} == wanted


# --- files ------------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """What the certifier writes, of which the checker finds nothing false."""
    path = tmp_path_factory.mktemp("stations") / "certificate.json"

    def make(*given, **changes):
        write([certify_station(loop_of(*given, **changes))], "made", path)
        assert [f for f in check_file(path) if f.verdict == "fails"] == []
        return json.loads(path.read_text(encoding="utf-8"))

    return make


@pytest.mark.parametrize(
    ("gains", "limit", "kind"),
    leading(
        [
            (BEST, 1.001 * PEAK, "norm"),
            (BEST, 1.05 * 2.95, "axis"),
            (SOFT._replace(boundary_layer=1e-3, k=0.05), 1.02 * PEAK, "norm"),
            (SOFT._replace(boundary_layer=5.0), 1.3 * PEAK, "norm"),
            (BEST._replace(rate=-2.0, radius=5.0), 26.1, "norm"),
            (BEST._replace(radius=1e-4), 1.2e-4 * PEAK, "norm"),
            (BEST._replace(radius=1e3, alpha=1e-6), 1.2e3 * PEAK, "norm"),
        ],
        3,
    ),
)
def test_limits_of_circles_of_any_size_are_checked(made, gains, limit, kind):
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


@pytest.mark.parametrize("gains", [BEST, SOFT, REST])
def test_the_full_problem_is_proved_with_its_feed_forward(made, gains):
    content = made(gains._replace(model=1), model="nonlinear")
    assert set(outcomes(content).values()) == {"proved"}
    told = certify_station(loop_of(gains._replace(model=1), model="nonlinear")).claims[0].assumptions
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
    told = certify_station(loop_of(gains, limit, kind)).claims
    assert [o.name for claim in told for o in claim.obligations if o.outcome == "refuted"] == [name]
    assert [f.verdict for f in check(content) if f.reason.startswith("refuted by the kernel: ")] == ["not claimed"]
    assert passed(check(content))
    for claim in content["certificates"][0]["claims"]:
        claim.pop("proof")
    assert not passed(check(content))


def test_the_claims_are_about_this_loop(made):
    content, other = made(BEST, 1.2 * PEAK), PRIMARIES["sun-earth"].point("L1")
    found = lambda loop: {text for claim in content["claims"] for text in station_differences(claim, loop)}  # noqa: E731
    assert found(loop_of(BEST, 1.2 * PEAK)) == set()
    for loop, told in (
        (loop_of(BEST._replace(radius=1.1), 1.2 * PEAK), "gains.radius is another number"),
        (loop_of(BEST._replace(feedback=1), 1.2 * PEAK), "the program of the law differs"),
        (loop_of(BEST._replace(model=1), 1.2 * PEAK, model="nonlinear"), "the program of the field differs"),
        (loop_of(REST, 1.2 * PEAK), "the program of the law differs"),
        (loop_of(BEST, 1.2 * PEAK, "axis"), "the limit differs"),
        (loop_of(BEST), "the limit differs"),
        (loop_of(BEST, 1.1 * PEAK), "the limit differs"),
        (loop_of(BEST, 1.2 * PEAK, plant=other), "plant.stiffness is another number"),
    ):
        assert told in found(loop), (told, found(loop))


def test_other_laws_claim_nothing():
    for law in catalogue("libration-point").values():
        for gains in law.examples():
            loop = point_loop(PLANT, law, gains, loop_of().start, 1e-3)
            declares = law.hook("rest") or (law.hook("errors") and law.lyapunov)
            assert bool(certify_station(loop).claims) == bool(declares)


@pytest.mark.parametrize(
    ("gains", "change"),
    [(RELAY, {"k": 3e-51}), (RELAY, {"radius": 1e-150, "k": 3e199}), (BEST, {"radius": 1e200}), (SOFT, {"k": 1e-300})],
)
def test_gains_of_any_size_end_in_what_the_checker_takes(made, gains, change):
    made(gains._replace(**change), 1.0)
