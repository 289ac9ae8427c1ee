"""Claims about loops with appendages: what they say, flights against every bound of their evidence, and false ones."""

import copy
import json
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from starhold.analysis.departure import departures, start_inside
from starhold.certification.appendages import appended_motion
from starhold.certification.evidence import appendages
from starhold.certification.evidence.attitude import Loop
from starhold.certification.subject import make_subject
from starhold.kernel import appended
from starhold.kernel.check import check
from starhold.kernel.numbers import WORK, Account, RefusedError, rational
from starhold.kernel.programs import Program
from starhold.kernel.taylor import BITS, ONE, run, within
from starhold.kernel.theorems.response import Response
from starhold.simulation.lane import fly, label
from tests.kernel.certificates import failing, with_program
from tests.kernel.flights import turned_on
from tests.kernel.oracle import number
from tests.kernel.programs import run as run_in_floats
from tests.kernel.programs import written
from tests.kernel.swaying import MODES, MOMENTS, Swaying, content_of, found, issued_of, loop_of
from tests.tiers import leading

MOST = 1.0 + 1e-6


def proved(content):
    return check(json.dumps(content))[0]


def accepted(content):
    try:
        proved(content)
    except RefusedError:
        return False
    return True


def changed(content, change):
    content = copy.deepcopy(content)
    change(content["claims"][0])
    return content


def shares(content, seconds=20.0, seed=1, lanes=32):
    flown = Swaying(content, seed, lanes).against(seconds)
    return {name: x for name, x in flown.items() if name != "flown"}


@pytest.mark.parametrize("name", ["bent", *(pytest.param(name, marks=pytest.mark.slow) for name in ("panels", "biased"))])
def test_no_flight_exceeds_a_bound(name):
    content = content_of(name)
    statement = proved(content).statement
    assert WORK - Account.left < WORK / 3
    assert statement.label == "appendages"
    assert "unlimited-torque" not in statement.assumptions
    reached = shares(content)
    assert max(reached.values()) <= MOST
    # They are no idle bounds.
    assert reached["modes"] > 0.95
    assert reached["sizes"] > 0.5


def test_the_claim_has_all_parts_of_the_loop_in_it():
    issued = issued_of("bent")
    claim = issued.claim("appendages")
    assert claim.outcome == "proved"
    assert not claim.left_out
    assert issued.claim("pointing").left_out
    assert claim.numbers["angle"] < 1e-3 < 0.05 < claim.numbers["slew_angle"]


def test_own_equations_move_as_the_program():
    program, random = appended_motion(loop_of("bent")), np.random.default_rng(1)
    D, f = np.array(MODES)[:, 2:5], np.array(MODES)[:, 0]
    M = np.block([[np.diag(MOMENTS), D.T], [D, np.eye(2)]])
    for _ in range(5):
        w, x, v, u = (random.normal(size=n) for n in (3, 2, 2, 3))
        load = u - np.cross(w, np.array(MOMENTS) * w + D.T @ v)
        own = np.linalg.solve(M, [*load, *(-0.02 * f * v - f * f * x)])
        given = {f"rate.{k}": y for k, y in enumerate(w)} | {f"torque.{k}": y for k, y in enumerate(u)}
        given |= {f"state.{k}": y for k, y in enumerate([*x, *v])}
        assert np.allclose(run_in_floats(program, given), [*own[:3], *v, *own[3:]], rtol=1e-12, atol=1e-12)


def test_flights_by_scipy_and_by_starhold_stay_within_the_claim():
    loop, content = loop_of("bent"), content_of("bent")
    against = Swaying(content, 3, 4)
    begun, n = against.starts(), against.numbers
    D, f = np.array(MODES)[:, 2:5], np.array(MODES)[:, 0]
    M = np.block([[np.diag(MOMENTS), D.T], [D, np.eye(2)]])

    def slope(t, y, u):
        q0, q, w, x, v = y[0], y[1:4], y[4:7], y[7:9], y[9:]
        moved = np.linalg.solve(M, [*(u - np.cross(w, np.array(MOMENTS) * w + D.T @ v)), *(-0.02 * f * v - f * f * x)])
        return [-0.5 * q @ w, *(0.5 * (q0 * w + np.cross(q, w))), *moved[:3], *v, *moved[3:]]

    for y in begun.T:
        flown = y
        for _ in range(150):
            u = against.command(flown[:4, None], flown[4:7, None])[:, 0]
            flown = solve_ivp(slope, (0.0, n["period"]), flown, "DOP853", args=(u,), rtol=1e-10, atol=1e-13).y[:, -1]
        start = loop.start._replace(attitude=tuple(map(float, y[:4])), rate=tuple(map(float, y[4:7])))
        effector = appended_start(loop, y[7:])
        recorded = recording(replace(effector, start=start, substeps=10), 150).arrays
        own = [*recorded["attitude"][-1], *recorded["rate"][-1]]
        assert np.allclose(own, flown[:7], rtol=1e-6, atol=1e-8)
        assert against.energy(flown[:, None])[0] < n["highest"]


def recording(loop, steps):
    samples, carry = fly(loop, steps)
    return label(loop, samples, carry, 1)


def appended_start(loop, state):
    """The loop with its modes in another state."""
    (fitted,) = loop.used("effector")
    kind = type(loop.carry().effectors[0])
    other = replace(fitted, start=kind(tuple(map(float, state[:2])), tuple(map(float, state[2:]))))
    return replace(loop, parts=tuple(other if one is fitted else one for one in loop.parts))


STRONGER = {
    "level": 1.01, "angle": 1.01, "begun.0": 1.02, "begun.3": 1.05, "outside": 30.0, "highest": 0.99, "settling": 0.9,
    "end.angle": 0.99, "end.rate": 0.99, "limit": 0.2, "period": 2.0,
}  # fmt: skip


@pytest.mark.parametrize("name", STRONGER)
def test_a_stronger_claim_is_refused(name):
    def stronger(claim):
        claim["numbers"][name] = str(Fraction(claim["numbers"][name]) * Fraction(STRONGER[name]))

    assert not accepted(changed(content_of("bent"), stronger))


def test_a_bound_of_the_rate_is_not_taken_from_a_claim_that_does_not_show_it():
    def slowed(claim):
        claim["numbers"] |= {"kinetic": "1/1000000000", "kinetic.pace": "1/100"}

    assert accepted(content_of("bent"))
    assert not accepted(changed(content_of("bent"), slowed))


@pytest.mark.slow
def test_each_piece_of_evidence_counts():
    content, refused, tried = content_of("bent"), 0, 0
    random = np.random.default_rng(2)
    rounds = len(content["claims"][0]["evidence"]["rounds"])
    changes = []
    for part in ("sizes", "torques", "radii"):
        for k in random.choice(rounds, 3, replace=False):
            place = random.integers(len(content["claims"][0]["evidence"]["rounds"][k][part]))
            changes.append(lambda claim, k=k, part=part, place=place: shrink(claim["evidence"]["rounds"][k][part], place))
    changes += [
        lambda claim: claim["evidence"].update(blocks=[*claim["evidence"]["blocks"][::-1], 1]),
        lambda claim: claim["evidence"]["modes"].__setitem__(0, claim["evidence"]["modes"][1]),
        lambda claim: claim["evidence"]["rounds"].pop(),
        lambda claim: claim["evidence"]["rounds"][-1].update(periods=5),
        lambda claim: claim["evidence"]["rounds"][3].update(periods=0),
        lambda claim: claim["evidence"]["rounds"][3].update(periods=10**6),
        lambda claim: claim["evidence"].update(rounds=[]),
        lambda claim: claim["taken"].append("outside torque"),
        lambda claim: claim["numbers"].update({"error.rate": "1/1000"}),
        lambda claim: claim["numbers"].update({"error": "1/10"}),
        lambda claim: claim["numbers"].pop("begun.0"),
        lambda claim: claim["programs"].update(motion=claim["programs"]["law"]),
    ]
    for change in changes:
        tried += 1
        refused += not accepted(changed(content, change))
    assert refused == tried


def shrink(column, place):
    column[place] = str(Fraction(column[place]) * Fraction(9, 10))


def test_a_motion_that_does_not_rest_is_pushed():
    """f(0) is a torque: a program with it is refused with the evidence of one without."""
    content = copy.deepcopy(content_of("bent"))
    (claim,) = content["claims"]
    program = copy.deepcopy(content["programs"][claim["programs"]["motion"]])
    count = len(program["inputs"]) + len(program["steps"])
    program["steps"] += [["constant", "1/20"], ["plus", program["outputs"][0], count]]
    program["outputs"][0] = count + 1
    assert not accepted(with_program(content, "motion", program))
    assert max(shares(content, 5.0).values()) > 1.0


def none(rows):
    return [[Fraction(0) for _ in row] for row in rows]


def without_rest(monkeypatch):
    kept = appended.Appended.left
    monkeypatch.setattr(
        appended.Appended, "left", lambda self, box: (one := kept(self, box))._replace(state=none(one.state))
    )


def without_push(name):
    def drop(monkeypatch):
        kept = appended.Appended.push
        monkeypatch.setattr(appended.Appended, "push", lambda self, one, state: kept(self, one, state) * (one != name))

    return drop


def without_misread(monkeypatch):
    monkeypatch.setattr(appended.Appended, "misread", property(lambda self: [Fraction(0)] * self.n))


def without_tube(monkeypatch):
    kept = appended.Appended.period
    monkeypatch.setattr(
        appended.Appended,
        "period",
        lambda self, box: kept(self, box)._replace(between=self.start, far=none([self.misread])[0]),
    )


@pytest.mark.parametrize(("name", "near"), leading([("bent", 0.95), ("biased", 0.95), ("panels", 0.93)]))
def test_steered_flights_come_near_to_what_is_proved_and_no_further(name, near):
    against = Swaying(content_of(name), 1, 16)
    ends = np.hstack([np.eye(3), against.rng.normal(size=(3, 3))])
    angles, _ = against.steered(ends)
    _, rates = against.steered(ends, part=slice(3))
    assert near < angles.max() <= 1.0
    assert 0.7 < rates.max() <= 1.0


@pytest.mark.parametrize("name", leading(["bent", "panels"]))
def test_gains_are_the_sums_of_the_impulse_response(name):
    """Sums of what SciPy makes of pushes in the tenths of a period, by the kernel's A, B and K."""
    motion = appendages.Swinging(Loop(make_subject(loop_of(name)))).motion
    A, B, K = (np.array(rows, dtype=float) for rows in (motion.A, motion.B, motion.K))
    n, h, parts = motion.n, float(motion.h), 10
    fine, held = (expm(np.block([[A, B], [np.zeros((3, n + 3))]]) * h / k) for k in (parts, 1))
    moved = held[:n, :n] - held[:n, n:] @ K
    assert np.allclose(np.array(motion.sampled, dtype=float), moved, rtol=1e-9, atol=1e-12)
    told = content_of(name)["claims"][0]["evidence"]["response"]
    rows, free, error = np.vstack([np.eye(n)[:6], (A - B @ K)[:3]]), np.zeros(9), np.zeros(9)
    for _ in told["weights"][0]:
        error += np.linalg.norm(rows @ held[:n, n:], axis=1)
        later = rows
        for _ in range(parts):
            free += np.linalg.norm(later @ fine[:n, n:], axis=1)
            later = later @ fine[:n, :n]
        rows = rows @ moved
    for k, (chord, bent, late) in enumerate(told["gains"]):
        part = slice(3 * k, 3 * k + 3)
        # In a direction between the axes rates and acceleration may be larger.
        wide = 1.04 if k == 1 else 1.4
        assert free[part].max() <= number(chord) + number(bent) < wide * free[part].max()
        assert error[part].max() <= number(late) < wide * error[part].max()


@pytest.mark.parametrize("part", ["rate", "turn", "acceleration"])
def test_a_gain_that_is_too_small_is_refused(part):
    content = copy.deepcopy(content_of("bent"))
    (claim,) = content["claims"]
    gains = claim["evidence"]["response"]["gains"]
    place = ["rate", "turn", "acceleration"].index(part)
    gains[place] = [str(rational(x) * Fraction(95, 100)) for x in gains[place]]
    assert failing(claim, content["programs"]) == {f"response of the {part}"}


def without_left(monkeypatch):
    begin = Response.__init__
    monkeypatch.setattr(
        Response, "__init__", lambda self, count, gains, left, beside: begin(self, count, gains, none(left), beside)
    )


def test_what_is_left_of_the_motion_before_a_response_counts(monkeypatch):
    """Else a response of few samples would end the motion where it does not end."""
    monkeypatch.setattr(appendages, "LEFT", 0.7)
    content = copy.deepcopy(content_of("bent"))
    (claim,), swinging = content["claims"], appendages.Swinging(Loop(make_subject(loop_of("bent"))))
    told, _ = swinging.response
    assert len(told["weights"][0]) < 100
    claim["evidence"]["response"] = told
    claim["numbers"]["end.angle"] = str(Fraction(claim["numbers"]["end.angle"]) * Fraction(7, 10))
    assert failing(claim, content["programs"]) == {"end of the angle", "end of the rate"}
    without_left(monkeypatch)
    assert "end of the angle" not in failing(claim, content["programs"])
    assert Swaying(content, 1, 3).steered(np.eye(3))[0].max() > 1.2


def test_what_is_not_linear_counts_in_a_response():
    """Of one period from far off, with the true sizes of z, what is beside the linear motion is as large as it is said."""
    swinging, against = appendages.Swinging(Loop(make_subject(loop_of("bent")))), Swaying(content_of("bent"), 1, 200)
    motion, random = swinging.motion, np.random.default_rng(2)
    z = random.uniform(-0.05, 0.05, size=(200, motion.n))
    z[:, 6:] /= 10.0
    x = against.state(z[:, :6], z[:, 6:])
    reached = swinging.reached([Fraction(float(r.max())) for r in against.modes(x)], None)
    box = appended.Box(*[[2 * size + Fraction(1, 50) for size in part] for part in reached], [Fraction(1, 4)] * motion.n)
    period = motion.period(box)
    rest, less = (
        np.array(motion.beside(one, box, Fraction(0)), dtype=float)[:, None] + 1e-9
        for one in (period, period._replace(over=none([period.over])[0]))
    )
    none_of = np.zeros((3, 200))
    later = against.after(x, [none_of] * 4, none_of, none_of, none_of)
    far = np.vstack([later[4:7], later[1:4], later[7:]]) - np.array(motion.sampled, dtype=float) @ z.T
    assert (np.abs(far) <= rest).all()
    assert (np.abs(far) > 10.0 * less)[:6].any(axis=1).all()


EACH = ("outside", "error", "error.attitude", "error.rate")
DROPPED = {
    "rest": (without_rest, ()), "tube": (without_tube, EACH), "outside": (without_push("outside"), ("outside",)),
    "error": (without_push("error"), ("error",)), "misread": (without_misread, ("error.attitude", "error.rate")),
}  # fmt: skip
"""Ways to leave a term out, each with the errors that there are beside."""


@pytest.mark.parametrize("name", [pytest.param(name, marks=pytest.mark.slow) for name in ["", *DROPPED]])
def test_a_period_exceeds_its_bounds_without_a_term(name, monkeypatch):
    """Flights of one period from states of one mode each, in which the linear motion moves no other."""
    drop, errors = DROPPED.get(name, (None, EACH))
    if drop:
        drop(monkeypatch)
    sizes = {one: 1e-3 * (one in errors) for one in EACH}
    swinging = appendages.Swinging(Loop(make_subject(loop_of("panels"))))
    motion = swinging.motion
    motion.numbers.content.update({one: Fraction(size) for one, size in sizes.items()})
    against, random = Swaying(content_of("panels"), 1, 1), np.random.default_rng(5)
    against.W, against.blocks = swinging.modes, swinging.blocks
    columns, ends = np.linalg.inv(swinging.modes), np.cumsum([0, *swinging.blocks])
    worst = 0.0
    for trial in range(3 * len(swinging.blocks)):
        k = trial % len(swinging.blocks)
        y = np.zeros(motion.n)
        y[ends[k] : ends[k + 1]] = random.normal(size=swinging.blocks[k])
        z = columns @ y
        z *= (0.0 if trial >= 2 * len(swinging.blocks) else 0.05) / np.abs(z).max()
        x = against.state(z[None, :6], z[None, 6:])
        radii = [Fraction(float(r)) * (1 + Fraction(1, 10**9)) for r in against.modes(x)[:, 0]]
        reached = swinging.reached(radii, None)
        box = [[size * 2 + Fraction(1, 50) for size in part] for part in reached]
        told = [a + Fraction(1, 1000) for a in box[0]]
        period = motion.period(appended.Box(*box, told))
        bounds = [
            np.array([float(one + two) for one, two in zip(appended.image(rows, radii), rest, strict=True)])[:, None]
            for rows, rest in ((period.grown, period.more), (period.between, period.far))
        ]
        d, e, a, b = (v[:, None] / np.linalg.norm(v) for v in random.normal(size=(4, 3)))
        q = turned_on(x[:4], sizes["error.attitude"] * a)
        u = against.command(q, x[4:7] + sizes["error.rate"] * b) + sizes["error"] * e
        for _ in range(20):
            x = against.later(x, u + sizes["outside"] * d, float(motion.h) / 20)
            size = np.abs(np.vstack([x[4:7], x[1:4], x[7:]]))
            worst = max(worst, float((size / bounds[1].clip(1e-12)).max()))
        worst = max(worst, float((against.modes(x) / bounds[0].clip(1e-12)).max()))
    assert (worst > 1.0) == bool(name), worst


def test_what_is_left_is_no_larger_and_no_less():
    """Of program, turn and law, at states on the box and within: each part of the bound is needed somewhere."""
    motion = appendages.Swinging(Loop(make_subject(loop_of("bent")))).motion
    against, random, n = Swaying(content_of("bent"), 1, 400), np.random.default_rng(3), motion.n
    box = appended.Box([Fraction(1, 10)] * n, [Fraction(1, 2)] * 3, [Fraction(1, 10)] * n)
    left = motion.left(box)
    A, B, K, D, T, U = (
        np.array(rows, dtype=float) for rows in (motion.A, motion.B, motion.K, left.state, left.torque, left.law)
    )
    z = random.uniform(-0.1, 0.1, size=(400, n)) * random.choice([0.01, 1.0], size=(400, n))
    t = random.uniform(-0.5, 0.5, size=(400, 3)) * random.choice([0.0, 1.0], size=(400, 1))
    moved = against.rates(against.state(z[:, :6], z[:, 6:]), t.T)
    rates = np.vstack([moved[4:7], moved[1:4], moved[7:]]) - A @ z.T - B @ t.T
    rest = np.array(left.rest, dtype=float)[:, None] + 1e-15
    asked = against.command(against.state(z[:, :6], z[:, 6:])[:4], z[:, :3].T) + K @ z.T
    assert (np.abs(rates) <= D @ np.abs(z.T) + T @ np.abs(t.T) + rest).all()
    assert (np.abs(asked) <= U @ np.abs(z.T) + np.array(left.law_rest, dtype=float)[:, None] + 1e-15).all()
    for rows in (slice(3), slice(3, 6)):
        assert (np.abs(rates) > T @ np.abs(t.T) + rest)[rows].any()
    assert (np.abs(rates) > 0.7 * (D @ np.abs(z.T)) + rest)[3:6].any()


def without_appendages(monkeypatch):
    kept = appended.Appended.begun
    monkeypatch.setattr(appended.Appended, "begun", lambda self, X, v: kept(self, X, [x / 100 for x in v]))


@pytest.mark.slow
def test_a_start_without_its_appendages_is_false(monkeypatch):
    without_appendages(monkeypatch)
    content = found(loop_of("bent"))
    assert accepted(content)
    monkeypatch.undo()
    assert not accepted(content)
    assert shares(content, 1.0)["modes"] > MOST


def test_models_hold_what_programs_do():
    program, random = appended_motion(loop_of("panels")), np.random.default_rng(1)
    names = [*(f"rate.{k}" for k in range(3)), *(f"state.{k}" for k in range(4)), *(f"torque.{k}" for k in range(3))]
    sizes = dict(zip(names, map(Fraction, (0.05, 0.04, 0.03, 0.2, 0.1, 0.2, 0.1, 0.2, 0.3, 0.1)), strict=True))
    Account.open()
    told = written(program)
    models = run(Program.read(program), {name: within(size, k) for k, (name, size) in enumerate(sizes.items())}, 7)
    for _ in range(200):
        x = random.choice([-1.0, 1.0], 10) * random.uniform(size=10) ** random.choice([0.05, 1.0])
        values = run_in_floats(told, {name: y * float(sizes[name]) for name, y in zip(names, x, strict=True)})
        for model, value in zip(models, values, strict=True):
            terms = [(m >> BITS, c) for m, c in model.terms.items()]
            powers = [c / ONE * np.prod([x[k] ** (m >> 4 * k & 15) for k in range(10)]) for m, c in terms]
            assert abs(value - sum(powers)) <= model.radius / ONE + 1e-13
    # Past an eighth of a turn the program has no value, and the kernel refuses the box.
    with pytest.raises(RefusedError, match="switches"):
        run(Program.read(program), {name: within(Fraction(4, 5), k) for k, name in enumerate(names)}, 7)


def test_a_flight_with_appendages_that_move_more_is_not_covered():
    loop = loop_of("bent")
    issued = issued_of("bent")
    begun = issued.claim("appendages").numbers["begun"]
    assert start_inside(issued, loop)["appendages"]
    for share, covered in ((0.9, True), (1.1, False)):
        other = appended_start(loop, share * np.array(begun))
        assert start_inside(issued, other)["appendages"] == covered
        left = departures(issued, other, recording(other, 50))["appendages"]
        assert any("appendages" in one.how for one in left) != covered
