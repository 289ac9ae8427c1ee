"""Claims about the loop that flies of laws that plan: the best plan against other solvers, and what is refused."""

import copy
import json
import math
import random
import time
from dataclasses import replace
from functools import cache

import control
import numpy as np
import piqp
import pytest
from scipy.linalg import block_diag

from starhold.certification.certify import Wanted, certify
from starhold.certification.comparison import differences
from starhold.certification.evidence.finding import certificate, obligations, read
from starhold.kernel.check import check
from starhold.kernel.loops import AttitudeLoop
from starhold.kernel.numbers import Account, RefusedError, rational
from starhold.kernel.plans import Plan
from starhold.laws import mpc
from starhold.laws.interface import Measurement
from starhold.parts.craft import make_craft
from tests.kernel.certificates import failing, rekeyed, text
from tests.kernel.mutations import refusals
from tests.kernel.oracle import Oracle, is_kept
from tests.kernel.planned import Planned
from tests.kernel.programs import number
from tests.making import built
from tests.tiers import fewer


@cache
def loop_of(name):
    return built(name, "mpc")


@cache
def claimed(name):
    claim = certify(loop_of(name), name, Wanted(pointing=True, alone=True)).claim("pointing")
    assert claim is not None
    assert claim.outcome == "proved"
    return claim


def content_of(name="three-laws"):
    proof = claimed(name).proof
    return copy.deepcopy(certificate(list(proof.programs.values()), [proof.claim]))


def plan_of(name="three-laws"):
    claim, Account.left = claimed(name).proof, 10**12
    return Plan(AttitudeLoop(read(claim.claim, claim.programs), remembers=True))


def oracle_of(name="three-laws"):
    content = content_of(name)
    return Oracle(content, content["claims"][0], 1)


def planned(oracle):
    return Planned(oracle.subject, oracle.numbers, oracle.J)


PROVED = {
    "three-laws": (10.0, 0.0, 0.00723, 0),
    "geostationary": (12.0, 0.0, 0.02345, 0),
    "cubesat-slew": (6.0, 1.0, 0.00935, 0),
    "three-laws-noise": (10.0, 0.0, 0.00723, 2),
}
"""From how many degrees at how many a second, to within how many, and without how many parts."""


@pytest.mark.parametrize("name", [pytest.param(n, marks=[pytest.mark.slow] * (n != "three-laws")) for n in PROVED])
def test_the_predictive_laws_of_scenarios_are_proved_to_point(name):
    begin, rate, end, without = PROVED[name]
    claim = claimed(name)
    assert math.degrees(claim.numbers.get("rate_start", 0.0)) >= rate * (1 - 1e-9)
    assert math.degrees(claim.numbers["slew_angle"]) >= begin * (1 - 1e-9)
    assert 0.5 * end < math.degrees(claim.numbers["angle"]) <= end
    assert "best-plan" in claim.assumptions
    assert "unlimited-torque" not in claim.assumptions
    assert sum(one.startswith("without:") for one in claim.assumptions) == without
    begun = time.process_time()
    (proved,) = check(text(content_of(name)))
    assert time.process_time() - begun < 4.0
    assert "the law's torque is of a plan as told" in proved.statement.written()
    assert "moves which are limited to" in proved.statement.text


def states_of(oracle, lanes, most=1.0):
    """States of the claim's set, of which the most rates and turns are on its border."""
    level, q, w = oracle.numbers["level"], [], []
    for k in range(lanes):
        oracle.numbers["level"] = level * (1.0 if k % 2 else 10.0 ** oracle.rng.uniform(-6, 0)) * most
        pair = oracle.border(0.0, oracle.numbers["level"] * oracle.rng.uniform())
        q.append(pair[0])
        w.append(pair[1])
    oracle.numbers["level"] = level
    return np.array(q).T, np.array(w).T


def by_piqp(plan, x, w, n, ahead):
    """The moves of least cost within the limits, by a library, from powers of the motion written out."""
    A, B = (part[0] for part in plan.motion(w[:, None], n[:, None]))
    powers = [np.linalg.matrix_power(A, k) for k in range(plan.N + 1)]
    free = np.vstack(powers[1:])
    forced = np.block([[powers[i - j] @ B if j <= i else np.zeros((6, 3)) for j in range(plan.N)] for i in range(plan.N)])
    weight = block_diag(*[plan.Q] * (plan.N - 1), plan.P)
    hessian = forced.T @ weight @ forced + block_diag(*[plan.R] * plan.N)
    solver = piqp.DenseSolver()
    solver.settings.eps_abs, solver.settings.eps_rel = 1e-12, 1e-12
    wide = np.full(3 * plan.N, plan.axis)
    shift = np.tile(ahead, plan.N)
    solver.setup(0.5 * (hessian + hessian.T), forced.T @ weight @ free @ x, x_l=-wide - shift, x_u=wide - shift)
    assert solver.solve() == piqp.PIQP_SOLVED
    return solver.result.x.reshape(-1, 3)


@pytest.mark.parametrize("name", [pytest.param(n, marks=[pytest.mark.slow] * (n != "three-laws")) for n in list(PROVED)[:3]])
def test_no_best_plan_is_farther_from_the_program_than_is_claimed(name):
    oracle, exact = oracle_of(name), plan_of(name)
    plan, most = planned(oracle), oracle.numbers["plan.error"]
    q, w = states_of(oracle, 200)
    n = oracle.rng.normal(size=(3, 200))
    n /= np.linalg.norm(n, axis=0)
    zero = np.zeros((3, 200))
    told, _ = oracle.inputs(q, w, *[zero] * 4)
    program = np.array(oracle.programs["law"]["function"](*(told[key] for key in oracle.programs["law"]["inputs"])))
    torques = plan.torques(q, w, n, 0.0)
    assert plan.exceeded(torques) <= 1.0
    off = np.linalg.norm(torques[0] - program, axis=0)
    size, units = np.linalg.norm(w, axis=0), np.array([float(x) for x in exact.units])
    length = np.hypot(units[:3].max() * size, units[3:].max() * np.linalg.norm(q[1:], axis=0))
    bound = sum(float(c) * size**k for k, c in enumerate(exact.missed)) * length
    assert (off <= bound).all()
    assert (off <= most).all()
    for lane in range(0, 200, 40):
        moves = by_piqp(plan, np.concatenate([w, q[1:]])[:, lane], w[:, lane], n[:, lane], np.zeros(3))
        assert np.abs(moves - torques[:, :, lane]).max() <= 1e-6 * np.abs(moves).max() + 1e-9 * plan.axis


@pytest.mark.parametrize(("dropped", "share"), [(0, 1e-5), (2, 0.1)])
def test_what_gravity_and_the_second_order_do_is_not_idle(dropped, share):
    """Without one of them the bound would be exceeded, at a slow and at a faster rate."""
    oracle, exact = oracle_of(), plan_of()
    plan, rate = planned(oracle), share * float(exact.fastest)
    w, n = oracle.rng.normal(size=(2, 3, 50))
    w, n = rate * w / np.linalg.norm(w, axis=0), n / np.linalg.norm(n, axis=0)
    plan.strength *= dropped == 0
    told = np.array(
        [[[[number(x) for x in row] for row in part] for part in move] for move in oracle.claim["evidence"]["plan"]["moves"]]
    )
    known = told[:, None, 0] + np.einsum("il,kiab->klab", w, told[:, 1:])
    units = np.array([float(x) for x in exact.units])
    off = (plan.moves(w, n) - known) / np.repeat([units[:3].max(), units[3:].max()], 3)
    farthest = max(np.linalg.norm(off[:, lane].reshape(-1, 6), 2) for lane in range(50))
    bounds = [float(c) * rate**k for k, c in enumerate(exact.missed)]
    assert sum(bounds) - bounds[dropped] < farthest <= sum(bounds)


def test_the_law_asks_for_what_is_claimed():
    """With its own limits and solver, cold and after a plan that its limits shaped."""
    oracle, loop = oracle_of(), loop_of("three-laws")
    q, w = states_of(oracle, 60)
    zero, farthest = np.zeros((3, 60)), 0.0
    told, _ = oracle.inputs(q, w, *[zero] * 4)
    program = np.array(oracle.programs["law"]["function"](*(told[key] for key in oracle.programs["law"]["inputs"])))
    shaped = mpc.remember(loop.gains, loop.known, loop.period)
    for k in range(60):
        place = oracle.rng.normal(size=3)
        place *= 7.0e6 / np.linalg.norm(place)

        def asked(attitude, rate, memory, place=place):
            seen = Measurement(tuple(attitude), tuple(rate), tuple(rate), *[(0.0,) * 3] * 3, tuple(place), loop.period)
            return np.array(mpc.torque(seen, loop.gains, loop.known, memory)[0])

        fresh = asked(q[:, k], w[:, k], mpc.remember(loop.gains, loop.known, loop.period))
        asked(np.array([0.5, 0.5, 0.5, 0.5]), 0.05 * np.ones(3), shaped)
        later = asked(q[:, k], w[:, k], shaped)
        for torque in (fresh, later):
            farthest = max(farthest, float(np.linalg.norm(torque - program[:, k])))
    assert 0.005 * oracle.numbers["plan.error"] < farthest <= oracle.numbers["plan.error"]
    assert mpc.counters(shaped)[mpc.EXHAUSTED] == 0


def test_moves_are_those_of_the_discrete_regulator():
    oracle = oracle_of()
    plan, move = planned(oracle), oracle.claim["evidence"]["plan"]["moves"][0][0]
    A, B = (part[0] for part in plan.motion(np.zeros((3, 1)), np.zeros((3, 1))))
    gain, P, _ = control.dlqr(A, B, plan.Q, plan.R)
    np.testing.assert_allclose([[-number(x) for x in row] for row in move], gain, rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(plan.P, P, rtol=1e-7, atol=1e-6)


def scaled(part, name, factor):
    def change(claim):
        claim[part][name] = str(rational(claim[part][name]) * factor)

    return change


def moved(*place, factor):
    def change(claim):
        node = claim["evidence"]["plan"]["moves"]
        for k in place[:-1]:
            node = node[k]
        node[place[-1]] = str(rational(node[place[-1]]) * rational(factor))

    return change


def units(*values):
    def change(claim):
        claim["evidence"]["plan"]["units"] = list(values) or claim["evidence"]["plan"]["units"][:5]

    return change


def without(part, name):
    def change(claim):
        claim[part].remove(name) if part == "taken" else claim[part].pop(name)

    return change


def told(part, name, value):
    def change(claim):
        claim[part][name] = value

    return change


FALSE = {
    "a smaller error": (scaled("numbers", "plan.error", rational("9/10")), "error of the plan"),
    "no faster than it is": (scaled("numbers", "plan.rate", rational("1/20")), "rates exceed"),
    "rates without bound": (scaled("numbers", "plan.rate", 1000), "too long for the plan|error of the plan"),
    "plans that cost more": (scaled("numbers", "plan.gap", 10**8), "error of the plan"),
    "plans of twice the cost": (told("numbers", "plan.gap", "1"), "not properly stated"),
    "more gravity": (scaled("numbers", "plan.stiffness", 10), "error of the plan"),
    "another period": (scaled("numbers", "period", rational("11/10")), "error of the plan|level|V decreases"),
    "a lower limit": (scaled("subject", "plan.limit", rational("9/10")), "moves within the limit"),
    "a limit of the norm too": (told("subject", "plan.limit.norm", "1"), "in two ways"),
    "one move more": (told("subject", "plan.moves", "11"), "another number of moves"),
    "another state weight": (scaled("subject", "plan.state.4", rational("101/100")), "error of the plan"),
    "another command weight": (scaled("subject", "plan.command.1", rational("101/100")), "error of the plan"),
    "another end": (scaled("subject", "plan.end.4.4", rational("101/100")), "error of the plan"),
    "a state that pays": (scaled("subject", "plan.state.0", -1), "not positive"),
    "commands that pay": (scaled("subject", "plan.command.0", -1), "not positive"),
    "commands for nothing": (scaled("subject", "plan.command.0", 0), "not positive"),
    "an end that pays": (scaled("subject", "plan.end.5.5", -1), "not positive"),
    "another first move": (moved(0, 0, 1, 1, factor="101/100"), "not the first move"),
    "another first slope": (moved(0, 1, 1, 2, factor="101/100"), "not the first move"),
    "another later move": (moved(6, 0, 1, 1, factor="101/100"), "error of the plan"),
    "another later slope": (moved(6, 1, 1, 2, factor="3/2"), "error of the plan"),
    "units without size": (units("0", "1", "1", "1", "1", "1"), "not properly stated"),
    "too few units": (units(), "another length"),
    "no plan": (without("taken", "plan"), "evidence is not a table"),
    "no limit told": (without("subject", "plan.end.0.0"), "lack plan.end.0.0"),
    "a memory too": (lambda claim: claim["taken"].append("memory"), "lack memory"),
}


@pytest.mark.parametrize("what", FALSE)
def test_what_is_not_so_is_refused(what):
    content = content_of()
    change, why = FALSE[what]
    change(content["claims"][0])
    with pytest.raises(RefusedError, match=why):
        check(text(content))


HYPOTHESES = {
    "error of the plan": scaled("numbers", "plan.error", rational("1/1000")),
    "moves within the limit": scaled("subject", "plan.limit", rational("1/5")),
}


@pytest.mark.parametrize("hypothesis", HYPOTHESES)
def test_only_this_hypothesis_fails_and_best_plans_contradict_the_claim(hypothesis):
    content = content_of()
    (claim,) = content["claims"]
    assert Oracle(content, claim).plans(100)
    HYPOTHESES[hypothesis](claim)
    assert failing(claim, content["programs"]) == {hypothesis}
    assert not Oracle(content, claim).plans(100)


@pytest.mark.parametrize("theorem", ["converges", "converges strictly"])
def test_no_other_theorem_takes_a_plan(theorem):
    content = content_of()
    _, known = obligations(content["claims"][0] | {"theorem": theorem}, content["programs"])
    assert "plan" in known.taken.unread


def test_a_body_with_another_inertia_has_other_plans():
    content = content_of()
    claim = content["claims"][0]
    for name in ("body.inertia.0.0", "craft.inertia.0"):
        if name in claim["subject"]:
            claim["subject"][name] = str(rational(claim["subject"][name]) * rational("21/20"))
    with pytest.raises(RefusedError, match=r"error of the plan|not the first move"):
        check(text(content))


def test_a_claim_is_compared_with_the_plan_of_the_loop():
    """Without the word it would be about a law that asks for the program's torque."""
    claim, loop = content_of()["claims"][0], loop_of("three-laws")
    assert differences(claim, loop) == []
    changes = {
        "the law plans its moves": without("taken", "plan"),
        "plan.limit is not stated": without("subject", "plan.limit"),
        "plan.gap is exceeded": scaled("numbers", "plan.gap", rational("1/2")),
        "plan.stiffness is exceeded": scaled("numbers", "plan.stiffness", rational("1/2")),
        "plan.state.1 is another number": scaled("subject", "plan.state.1", 2),
    }
    for how, change in changes.items():
        one = copy.deepcopy(claim)
        change(one)
        assert how in differences(one, loop)
    assert "its law does not plan" in differences(claim, built("three-laws", "lyapunov"))


def test_a_law_that_takes_the_body_for_another_one_has_no_claim():
    loop = loop_of("three-laws")
    other = replace(loop, nominal=make_craft([2.1, 3.0, 4.0], 0.01, loop.craft.gravity))
    certificate_of = certify(other, "three-laws", Wanted(pointing=True, alone=True))
    assert certificate_of.claims == ()
    assert "another inertia" in certificate_of.subject["no_pointing"]


def test_the_program_may_be_another_one_only_with_its_moves():
    content = content_of()
    program = content["programs"][content["claims"][0]["programs"]["law"]]
    constant = next(step for step in program["steps"] if step[0] == "constant" and abs(number(step[1])) > 1e-3)
    constant[1] = str(rational(constant[1]) * rational("1001/1000"))
    with pytest.raises(RefusedError, match="not the first move"):
        check(json.dumps(rekeyed(content)))


@pytest.mark.slow
def test_nothing_false_is_accepted():
    count = fewer(40)
    assert refusals(content_of(), random.Random(7), count, is_kept) > count / 2
