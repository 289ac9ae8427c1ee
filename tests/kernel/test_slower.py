"""Bounds of rate and torque that motions keep although {V <= level} holds states beyond: what is proved, flights that are
steered against that, and false claims."""

import math
from dataclasses import replace
from fractions import Fraction
from itertools import takewhile

import numpy as np
import pytest

import starhold as sh
from starhold.analysis.departure import height_of, shown_at
from starhold.certification.certify import certify
from starhold.certification.evidence.attitude import Loop
from starhold.certification.evidence.blends import renumbered
from starhold.certification.evidence.pointing import Pushed
from starhold.certification.evidence.shapes import shares
from starhold.certification.evidence.slow import at_first, bound_of_rate
from starhold.certification.evidence.squares import CLEAR, definiteness, squares
from starhold.certification.evidence.starts import begins
from starhold.certification.evidence.terms import valued
from starhold.certification.subject import make_subject
from starhold.kernel.norms import norms, total_of
from starhold.kernel.numbers import Account
from starhold.kernel.polynomials import Poly, cross, dot, variables
from starhold.kernel.regions import STATE
from starhold.kernel.theorems.kinetic import (
    ASKED,
    CUBIC,
    PACE,
    changing,
    commanded,
    slowing,
    speeding_up,
    twice_energy,
)
from starhold.kernel.theorems.pointing import descends
from starhold.scenario.building import build
from starhold.studies.bodies.rigid_body import wanted_of
from tests.certification.attack import Attack
from tests.kernel.certificates import contents
from tests.kernel.flights import along
from tests.kernel.one_period import after_a_period, fleet_of, held_loop, states_of
from tests.kernel.oracle import Oracle
from tests.making import built

SCENARIO = sh.load("geostationary")
ENTRY = SCENARIO.pick("pd")
LOOP = build(SCENARIO, ENTRY)


@pytest.fixture(scope="module")
def claim():
    return certify(LOOP, "pd", replace(wanted_of(SCENARIO, True), alone=True)).claim("pointing")


@pytest.fixture(scope="module")
def begun(claim):
    """The search, its chain of the claim's start, and the numbers of that."""
    loop = Loop(make_subject(LOOP))
    pushed = Pushed(loop, loop.known.against(loop.known.envelope(False)))
    start = claim.numbers["slew_angle"], claim.numbers["rate_start"]
    [chain] = pushed.begun(*start, loop.limits)
    return pushed, chain, pushed.beginning(*start, loop.limits) | chain.of_level()


def flown(proof, programs, lanes=64, longest=400, **other):
    """A steered fleet of a claim, with other numbers in it."""
    told = {name: Fraction(x) * Fraction(other.pop(name, 1)) for name, x in proof["numbers"].items()}
    attack = Attack({"programs": dict(programs)}, proof | {"numbers": {name: str(x) for name, x in told.items()}}, 5, lanes)
    attack.longest = longest
    return attack.worst()[0], attack.used


def test_flights_come_near_to_the_bounds_and_not_beyond(claim):
    assert {"kinetic", "asked_torque"} <= claim.numbers.keys()
    found, used = flown(claim.proof.claim, claim.proof.programs)
    assert not found
    assert (used <= 1.0).all()
    assert (used[:2] > 0.85).all()


def test_flights_with_momentum_come_near_to_the_bounds_and_not_beyond():
    loop = Loop(make_subject(built("wheels-orbital", "wheel")))
    pushed = Pushed(loop, loop.known.against(loop.known.envelope(False)))
    assert pushed.find(math.radians(70.0), 0.004, loop.limits), loop.failed
    [proof] = loop.claims
    assert {"kinetic", "asked", "motors.0", "momentum"} <= proof["numbers"].keys()
    found, used = flown(proof, loop.by_digest, longest=150)
    assert not found
    assert (used <= 1.0).all()
    assert (used > 0.8).all()


def test_a_law_that_is_told_of_the_body_late_keeps_to_its_limits_too():
    """Errors that grow with the motion are known in a tube, and so is what the law asks for because of them."""
    tracker = {"type": "star-tracker", "cross": "1e-6 rad", "roll": "1e-6 rad", "delay": "0.2 s"}
    scenario = sh.load("wheels-orbital").with_({"part": [tracker]})
    loop = Loop(make_subject(build(scenario, scenario.pick("wheel"))))
    pushed = Pushed(loop, loop.known.against(loop.known.envelope(True)), True)
    assert pushed.find(math.radians(60.0), 0.004, loop.limits), loop.failed
    [proof] = loop.claims
    assert {"asked", "motors.0", "error.attitude.per.rate"} <= proof["numbers"].keys()
    found, used = flown(proof, loop.by_digest, longest=150)
    assert not found
    assert (used <= 1.0).all()
    assert (used > 0.7).all()


def test_a_bound_of_the_rate_is_nearly_the_least_that_can_be_shown():
    loop = Loop(make_subject(built("cubesat-nadir", "wheel")))
    pushed = Pushed(loop, loop.known.against(loop.known.envelope(True)), True)
    shape, angle, rate = pushed.usual[1], math.radians(90.0), math.radians(1.0)
    motion, level = pushed.sampled(shape).motion, Fraction(pushed.chain(shape, angle, rate).level)
    found, scales = bound_of_rate(motion, float(level), rate), pushed.chain(shape, angle, rate).scales

    def clear(times, faster):
        motion.kinetic = Fraction(found["kinetic"]) * Fraction(times)
        rates, pace = speeding_up(motion, motion.tube(motion.region(level))), Fraction(found[PACE] * faster)
        return (definiteness(slowing(motion, rates, motion.kinetic, pace, level), scales) or -1.0) >= CLEAR

    assert clear(1, 1.0)
    assert not any(clear(0.9, faster) for faster in (0.8, 0.9, 1.0, 1.1, 1.25))


def test_a_law_that_keeps_to_its_limits_accelerates_the_body_no_more_than_sets_know():
    """States of a set that the claim's bounds cut off, with momentum of any direction, by the law's own program."""
    loop = Loop(make_subject(built("wheels-orbital", "wheel")))
    pushed = Pushed(loop, loop.known.against(loop.known.envelope(False)))
    assert pushed.find(math.radians(70.0), 0.004, loop.limits), loop.failed
    [proof] = loop.claims
    attack = Attack({"programs": dict(loop.by_digest)}, proof, 3, 20000)
    n, r = attack.numbers, attack.rng
    motion = pushed.sampled(next(iter(pushed.known))).motion
    most = [float(x) for x in commanded(motion, {name: Fraction(x) for name, x in proof["numbers"].items()}).values()]
    half = r.uniform(0.0, math.pi / 2, attack.lanes)
    q = np.concatenate([np.cos(half)[None], np.sin(half) * along(r.normal(size=(3, attack.lanes)))])
    w, none = math.sqrt(n["kinetic"]) * r.normal(size=q[1:].shape), np.zeros(q[1:].shape)
    H = n["momentum"] * along(r.normal(size=w.shape))
    u = attack.fleet().law(q, w, none, none, none, H)
    # As far as the law's share of its limits lets it.
    u = u * n["asked"] / attack.loads(u)
    faster = np.abs(np.linalg.solve(attack.J, u)).max(axis=1)
    assert (faster <= most).all()
    assert (faster > 0.9 * np.array(most)).all()


def test_flights_contradict_a_smaller_bound(claim):
    proof = claim.proof.claim, claim.proof.programs
    assert not flown(*proof, longest=1, kinetic=0.1)[0], "flights begin in the set"
    found, used = flown(*proof, kinetic=0.1)
    assert found
    assert used[0] > 1.0


@pytest.mark.parametrize(("name", "times"), [("kinetic", 0.6), (PACE, 0.2), (PACE, 4.0), (ASKED, 0.7), ("asked.pace", 0.1)])
def test_no_evidence_is_found_for_other_bounds(begun, name, times):
    pushed, chain, numbers = begun
    motion = chain.motion

    def shown(numbers):
        if not begins(pushed.loop, motion, numbers, chain.scales):
            return False
        other = renumbered(motion, {**numbers, "highest": 0})
        wanted = dict(takewhile(lambda one: one[0] != "V between samples", descends(other.loop, other)))
        return all(squares(o, chain.scales) is not None for name, o in wanted.items() if " falls" in name)

    assert shown(numbers)
    kinetic = motion.kinetic
    try:
        motion.kinetic = Fraction(numbers["kinetic"]) * Fraction(times if name == "kinetic" else 1)
        assert not shown(numbers | {name: numbers[name] * times})
    finally:
        motion.kinetic = kinetic


def test_what_the_law_asks_for_at_first_is_that_of_some_state_of_the_start(begun):
    pushed, chain, _ = begun
    motion, rows = chain.motion, shares(chain.motion, pushed.loop.limits)
    angle, rate = 0.5, 0.001
    most, r = at_first(motion, rows, angle, rate), np.random.default_rng(1)
    turned, spun = (along(r.normal(size=(3, 20000))) for _ in range(2))
    states = [np.full(20000, math.cos(angle / 2)), *(math.sin(angle / 2) * turned), *(rate * spun)]
    u = np.array([valued(p, dict(zip(("q0", *STATE[3:], *STATE[:3]), states, strict=True))) for p in motion.u])
    assert 0.95 * most < np.abs(rows @ u).max() <= most * (1 + 1e-9)


@pytest.mark.parametrize(("name", "pushed"), [("skew", 0.02), ("moving", 0.02), ("skew", 1e-9)])
def test_what_a_period_changes_is_within_its_bounds(name, pushed):
    oracle = Oracle(contents("flying", name), contents("flying", name)["claims"][0])
    level = oracle.numbers["level"] / 30.0
    push = pushed * math.sqrt(level * oracle.subject["gains.k_attitude"])
    held, fleet = held_loop(name, outside=push, error=2 * push), fleet_of(name, push, 2 * push)
    q, w = states_of(oracle, level, fleet.lanes)
    tube, names = held.tube(held.region(Fraction(level))), ("q0", *STATE[3:], *STATE[:3])
    faster, more = speeding_up(held, tube)
    changes, rest, moves = changing(held, tube, held.u, CUBIC)
    at = dict(zip(names, (*q, *w), strict=True))
    for parts, rates, bounds in (([twice_energy(held)], [faster], [more]), (held.u, changes, [x + moves for x in rest])):
        least = np.array([valued(p, at) for p in rates])
        for unit in (fleet.push(0, q, w), fleet.directions(), along(w), -along(w)):
            later = dict(zip(names, np.concatenate(after_a_period(fleet, q, w, unit)), strict=True))
            moved = np.array([(valued(p, later) - valued(p, at)) / fleet.h for p in parts])
            beyond = np.abs(moved - least) / np.array([[float(x)] for x in bounds])
            assert 0.02 < beyond.max() <= 1.0


def test_lengths_of_vectors_bound_polynomials():
    Account.open()
    r = np.random.default_rng(2)
    q, w, h = (variables(x) for x in "qwh")
    triple = dot(q, cross(w, h))
    assert float(total_of(norms(triple), dict.fromkeys("qwh", Fraction(1)))) == pytest.approx(math.sqrt(2.0))
    assert float(total_of(norms(dot(w, w)), {"w": Fraction(3)})) == pytest.approx(9.0)
    for _ in range(40):
        terms = {}
        for _ in range(6):
            m = tuple(sorted(f"{letter}{r.integers(1, 4)}" for letter in r.choice(list("qwh"), r.integers(1, 5))))
            terms[m] = Fraction(float(r.normal()))
        p, sizes = Poly(terms), {letter: float(r.uniform(0.1, 3.0)) for letter in "qwh"}
        bound = float(total_of(norms(p), {letter: Fraction(x) for letter, x in sizes.items()}))
        at = {}
        for letter, size in sizes.items():
            at |= dict(zip((f"{letter}{k}" for k in (1, 2, 3)), size * along(r.normal(size=(3, 2000))), strict=True))
        assert np.abs(valued(p, at)).max() <= bound


def test_a_state_beyond_a_bound_is_outside_of_the_claim(claim):
    n, shown = claim.numbers, shown_at(LOOP, LOOP.start)
    half, J = n["slew_angle"] / 2.0, np.array(LOOP.craft.inertia)

    def height(turned, *rate):
        attitude = (math.cos(turned), math.sin(turned), 0.0, 0.0)
        return float(height_of(claim, LOOP, shown._replace(attitude=attitude, rate=rate)))

    assert height(half * 0.999, -n["rate_start"], 0.0, 0.0) <= n["start"]
    fast = math.sqrt(n["kinetic"] / J[2, 2])
    assert height(0.0, 0.0, 0.0, 1.001 * fast) == math.inf > height(0.0, 0.0, 0.0, 0.3 * fast)
    # The law is k_attitude q near rest.
    asked = n["asked_torque"] / float(LOOP.gains.k_attitude)
    assert height(math.asin(1.001 * asked), 0.0, 0.0, 0.0) == math.inf > height(math.asin(0.999 * asked), 0.0, 0.0, 0.0)
