"""The chain of modes: whether what is proved of a mode as it flies begins where the mode before ends."""

import math
from dataclasses import replace

import numpy as np
import pytest

from starhold.certification.certificate import Certificate, Claim, Obligation
from starhold.certification.hand_over import flown_ends
from starhold.certification.subject import make_subject
from starhold.parts.craft import tensor
from starhold.scenario.building import build
from starhold.scenario.reading import load, parse
from starhold.studies.bodies.rigid_body import STUDY
from starhold.studies.chain import _unending, chains, links_of, sentence, summary
from starhold.studies.modes import fresh_momentum, hand_overs
from tests.certification.attack import Attack
from tests.certification.handed import POINT, bounded
from tests.making import built
from tests.missions import BASE, DETUMBLE

NEXT = POINT.replace('"point"', '"hold"')


def certified(scenario):
    entry = scenario.laws[0]
    loop = build(scenario, entry)
    return loop, {one.certificate.name: one.certificate for one in STUDY.certify(scenario, entry, loop, pointing=True)}


def chained(modes):
    """The loop of a mission, its certificates, and the links of its modes."""
    loop, found = certified(parse(BASE + modes, "mission.toml"))
    return loop, found, links_of(loop, "mission", found)


@pytest.fixture(scope="module")
def missioned():
    """Detumble, then point until it has settled, then hold the same target."""
    point = POINT + 'until = { after = "30 min", angle_below = "1 deg" }\n'
    return chained(bounded("0.5 deg/s", "20 deg") + point + NEXT)


def test_a_mode_takes_over_where_its_claim_begins(missioned):
    _, found, (first, second) = missioned
    assert first.claim.numbers["rate_start"] >= first.rate >= math.radians(0.5)
    assert first.claim.numbers["slew_angle"] >= first.angle >= math.radians(20.0)
    # Nothing is proved of how detumbling ends.
    assert (first.lacks, first.assumed) == ((), ("detumble ends",))
    # What is proved of pointing is stronger than the test of its switch.
    ended = found["mission: point"].claim("pointing").numbers
    assert second.rate == pytest.approx(ended["rate"], rel=1e-9)
    assert second.angle == pytest.approx(ended["angle"], rel=1e-9)
    assert second.angle < math.radians(1.0)
    assert (second.lacks, second.assumed) == ((), ())
    assert summary([first, second]).startswith("as it flies, 2 of 2")


def test_a_claim_that_begins_a_little_nearer_does_not_take_over(missioned):
    loop, found, _ = missioned
    for name, less in (("rate_start", math.radians(0.4999)), ("slew_angle", math.radians(19.999))):
        claims = [
            replace(one, numbers=one.numbers | {name: less}) if one.kind == "pointing" else one
            for one in found["mission: point"].claims
        ]
        less_said = replace(found["mission: point"], claims=tuple(claims))
        first, _ = links_of(loop, "mission", found | {"mission: point": less_said})
        assert len(first.lacks) == 1
        assert first.text.startswith("not taken over: detumble may end")


def test_how_far_a_torque_is_late_as_a_mode_begins_is_assumed(missioned):
    """At the switch the next law may ask for another torque at once."""
    loop, found, _ = missioned
    point = found["mission: point"]
    lagging = tuple(replace(one, numbers=one.numbers | {"late_torque": 0.002}) for one in point.claims)
    first, _ = links_of(loop, "mission", found | {"mission: point": replace(point, claims=lagging)})
    assert first.assumed == ("detumble ends", "point begins with a torque within 0.002 N m of its command")


def test_where_readings_are_off_as_the_body_moves_what_a_switch_tests_is_assumed(missioned):
    """It is told late, of the mode before, and a mode may not end that is settled to just its test."""
    loop, found, _ = missioned
    late = {
        name: tuple(replace(one, numbers=one.numbers | {"told_growth": [0.1] * 6}) for one in found[name].claims)
        for name in ("mission: point", "mission: hold")
    }
    first, second = links_of(loop, "mission", found | {name: replace(found[name], claims=one) for name, one in late.items()})
    told = "begins with no larger errors of what it is told than if the body had moved so before"
    assert first.assumed == ("detumble ends", "point begins at up to 0.5°/s and 20°", f"point {told}")
    # What is proved of pointing is of its true end.
    assert second.assumed == ("point ends", f"hold {told}")


def test_what_nothing_bounds_is_assumed_or_lacks(missioned):
    loop, found, _ = missioned
    first, second = links_of(loop, "mission", {name: one for name, one in found.items() if name != "mission: point"})
    assert first.lacks == ("nothing is proved of point as it flies",)
    assert second.lacks == ("nothing bounds the rate at which point ends",)
    _, _, (first, second) = chained(DETUMBLE + POINT + 'until = { after = "1 s", angle_below = "1 deg" }\n' + NEXT)
    assert first.assumed[0] == "detumble ends"
    assert first.assumed[1].startswith("point begins within ")
    assert second.assumed == (f"point lasts {first.claim.numbers['settling']:.4g} s",)


def test_wheels_that_rest_in_a_mode_keep_what_they_have():
    loop = mission_loop()
    first, second = (one for one in hand_overs(loop, "") if one.key == "until" and one.places[0] < 2 and one.places[1] > 0)
    # Of four rotors the parts along the axis of the pyramid add up.
    assert fresh_momentum(first, 0.0) == pytest.approx(4 * 0.0025 / math.sqrt(3.0), rel=1e-6)
    assert fresh_momentum(first, 0.1) - fresh_momentum(first, 0.0) == pytest.approx(0.065 * 0.1, rel=1e-3)
    assert fresh_momentum(second, 0.0) == math.inf


def stated(name, momentum, angle=0.1, rate=0.02):
    """A certificate of a mode or a switch with a claim of these numbers (mN m s, deg, deg/s), from 25° at 0.6°/s."""
    start = {"slew_angle": math.radians(25.0), "rate_start": math.radians(0.6), "momentum": 1e-3 * momentum}
    end = {"angle": math.radians(angle), "rate": math.radians(rate), "settling": 700.0, "share": 0.9973}
    errors = {"attitude_error": 5e-4, "rate_error": 2e-4, "samples": 1000, "period": 0.5}
    claim = Claim("pointing", start | end | errors, {}, (), (Obligation("level", "", "proved"),))
    return Certificate(f"mission: {name}", {}, (claim,))


def mission_loop():
    return built("cubesat-mission")


def mission_links(*certificates):
    return links_of(mission_loop(), "mission", {one.name: one for one in certificates})


def test_a_rate_is_told_with_the_errors_of_where_the_target_turns():
    """A switch that looks at the rate to a target that turns may be taken at a larger one, as the attitude is off."""
    (switch,) = (one for one in hand_overs(mission_loop(), "") if one.places == (2, 3))
    (claim,) = stated("unload", 3.2).claims
    claim = replace(claim, numbers=claim.numbers | {"attitude_error": 0.1})
    rate, _ = flown_ends({"rate_below": 1e-3}, switch.before, switch.after, None, claim)
    start = switch.before.start
    orbital = float(np.linalg.norm(np.cross(start.position, start.velocity)) / np.dot(start.position, start.position))
    # The attitude is off about an axis across that of the target, and the rate just as its measurement is.
    off = 2.0 * math.sin(0.05) * orbital
    assert rate > 1e-3 + 2e-4 + off > 1e-3 + 2e-4 + 1e-4
    # Nor does a mode surely end which is settled to just that.
    settled = replace(claim, numbers=claim.numbers | {"angle": 1e-4, "rate": 1e-3 - 2e-4 - 0.5 * off})
    last = switch._replace(levels={"rate_below": 1e-3})
    assert _unending(last, "nadir", settled) == ["nadir ends"]
    assert _unending(last, "nadir", replace(settled, numbers=settled.numbers | {"rate": 1e-3 - 2e-4 - 1.1 * off})) == []


def test_a_mode_that_begins_with_more_momentum_is_entered_by_its_wider_claim():
    modes = stated("sun", 6.7), stated("nadir", 3.2), stated("unload", 3.2, 0.4)
    wide = stated("sun to nadir", 6.7, 0.19), stated("nadir to unload", 6.7, 0.5, 0.2)
    links = mission_links(*modes, *wide)
    assert not any(link.lacks for link in links)
    assert [(link.before, link.after, link.wide) for link in links] == [
        ("detumble", "sun", False),
        ("sun", "nadir", True),
        ("nadir", "unload", True),
        ("unload", "nadir", False),
        ("nadir", "unload", False),
        ("unload", "nadir", False),
    ]
    # Nadir ends at 3 mN m s: with more it does not settle first, and later it does.
    assert links[2].angle == math.inf
    assert links[2].assumed == ("unload begins within 25° of its target at up to 0.6°/s",)
    assert links[4].assumed == ("nadir lasts 700 s",)
    # Rotors that rested keep what they have, and the body turns no faster than relative to the Sun and with it.
    sun = hand_overs(mission_loop(), "")[0].after
    turned = float(np.linalg.norm(tensor(sun.craft.inertia), 2)) * (links[0].rate + float(make_subject(sun).target_rate))
    assert links[0].momentum == pytest.approx(0.01 / math.sqrt(3.0) + turned, rel=1e-9)
    # Unload ends at 1 mN m s in the wheels; the body and the turn of the orbit's frame add theirs.
    turn = 2.0 * math.pi / 5677.0
    assert links[3].momentum == pytest.approx(1e-3 + 0.065 * (math.radians(0.2) + turn), rel=1e-3)
    assert links[3].assumed[0] == "unload brings the wheels' momentum below 1 mN m s"
    whole = sentence(links)
    assert whole.startswith(
        "from up to 0.511°/s and within 25° of the target of sun, sun comes within 0.1° after 700 s, then nadir"
    )
    assert "0.19°" in whole
    assert "unload brings the wheels' momentum below 1 mN m s" in whole


def test_without_a_wider_claim_as_wide_as_what_is_handed_over_the_chain_ends():
    modes = stated("sun", 6.7), stated("nadir", 3.2), stated("unload", 3.2, 0.4)
    for wide in ((), (stated("sun to nadir", 6.69),)):
        links = mission_links(*modes, *wide)
        assert [bool(link.lacks) for link in links] == [False, True, False, False]
        assert links[1].heavy
        assert "nadir may begin with 6.7 mN m s of momentum, and is proved with up to 3.2" in links[1].text
        assert "nadir" not in sentence(links)
    # Momentum is not all that lacks: a wider claim would not help.
    links = mission_links(stated("sun", 6.7, rate=0.7), *modes[1:])
    assert not links[1].heavy
    assert len(links[1].lacks) == 2


def test_a_mode_whose_test_its_claim_does_not_meet_is_assumed_to_end():
    # It ends within 1°, measured with an error of 5e-4.
    for angle, assumed in ((0.97, ()), (0.98, ("sun ends",))):
        links = mission_links(stated("sun", 3.0, angle), stated("nadir", 3.2), stated("unload", 3.2))
        assert [text for text in links[1].assumed if text.endswith(" ends")] == [*assumed]


def sun_of(found):
    return found["mission: sun"].claim("pointing")


@pytest.mark.slow
def test_the_mission_turns_to_the_sun_from_what_detumbling_leaves_and_no_flight_contradicts_it():
    scenario = load("cubesat-mission")
    _, found = certified(scenario)
    (links,) = chains(scenario, list(found.values())).values()
    assert not any(link.lacks for link in links)
    assert [link.wide for link in links] == [False, True, True, False, False, False]
    assert links[1].claim.numbers["momentum"] >= sun_of(found).numbers["momentum"] > 2 * links[3].claim.numbers["momentum"]
    assert math.degrees(links[1].claim.numbers["angle"]) < 0.2
    assert math.degrees(links[3].claim.numbers["angle"]) < 0.1
    assert links[0].rate > math.radians(0.5)
    assert links[0].angle == math.inf
    sun = sun_of(found)
    assert (sun.outcome, sun.left_out) == ("proved", [])
    assert math.degrees(sun.numbers["angle"]) < 0.2
    assert math.degrees(sun.numbers["slew_angle"]) > 24.0
    for mode in ("sun", "nadir", "unload", "sun to nadir", "nadir to unload"):
        claim = found[f"mission: {mode}"].claim("pointing")
        attack = Attack({"programs": dict(claim.proof.programs)}, claim.proof.claim, 1)
        # Until after the bound holds.
        attack.longest = 2000
        broken, reached = attack.worst()
        assert not broken
        assert min(reached[1:]) > 0.1
