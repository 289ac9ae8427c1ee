"""A period of loops with wheels and a target that moves: no state is farther than what is shown of the period."""

from fractions import Fraction
from functools import cache

import numpy as np
import pytest

from starhold.certification.evidence.attitude import Loop
from starhold.certification.evidence.claims import floats
from starhold.certification.evidence.finding import read
from starhold.certification.evidence.pointing import Pushed
from starhold.certification.evidence.terms import valued
from starhold.certification.subject import make_subject
from starhold.certification.unmodelled import Pushes, pushes
from starhold.kernel.held import CHANGE, Held
from starhold.kernel.loops import MOMENTA, AttitudeLoop
from starhold.kernel.numbers import Account, RefusedError
from starhold.kernel.regions import ANGLE, AT_REST, SPEED, STATE
from starhold.kernel.theorems.kinetic import QUARTIC, changing, kinds_of, twice_energy
from starhold.kernel.theorems.pointing import points
from tests.kernel.flights import Around, Surroundings, along, cross
from tests.kernel.oracle import Oracle, run
from tests.making import built
from tests.tiers import leading

LANES = 2000


def told_change(n):
    """How fast a torque that the law is told may change."""
    return tuple(n.get(name, other) for name, other in zip(CHANGE, (np.inf, 0.0), strict=True))


FLOWN = [
    (*loop, share) for share in (1e-3, 1e-5, 0.03) for loop in (("cubesat-nadir", "lyapunov"), ("wheels-orbital", "wheel"))
]


@pytest.mark.parametrize(("scenario", "law", "share"), leading(FLOWN))
def test_a_period_with_wheels_takes_no_state_farther_than_its_bounds(scenario, law, share):
    Account.left = 10**12
    loop = Loop(make_subject(built(scenario, law)))
    own = Pushed(loop, pushes(loop.loop, loop.known.envelope(False)))
    _, V, held, _ = own.leans[0]
    oracle = Oracle({"programs": loop.by_digest}, loop.claim("points", own.words, V, **own.numbers))
    n, h, rng = oracle.numbers, loop.loop.period, np.random.default_rng(3)
    region = held.region((held.s + held.G[3][3]) * round(share * 2**30) / 2**30)
    tube, inverse = held.tube(region), np.linalg.inv(oracle.J)
    x = np.linalg.cholesky(floats(region.X)) @ along(rng.normal(size=(6, LANES)))
    x *= rng.uniform(size=LANES) ** 0.2
    w, q = x[:3], np.concatenate([[np.sqrt(1.0 - (x[3:] ** 2).sum(0))], x[3:]])
    told = [n.get(f"outside.{k}", 0.0) for k in range(3)]
    bounds = Surroundings(told, n["target.rate"], n["target.acceleration"], n["momentum"], 0.0, 0.0, None, told_change(n))
    Q, H, F, size, rest, _ = held.fall(tube)
    Q, H, F = floats(Q), floats(H), floats(F)
    corners = np.array([floats(A) for A in held.corners()])
    linear = [(corners[9 + 2 * k] - corners[8 + 2 * k]) / (2 * 1.4144 * n["momentum"]) for k in range(3)]
    grown, stiff = 0.0, own.stiffness if held.soft else np.inf

    def leaning(around, q, t):
        """Where the momentum and the target's rate alone would hold the body."""
        return np.concatenate([0.0 * w, -cross(around.target(q, t)[0], around.kept) / stiff])

    def asked(q, w, *around):
        return run(oracle.programs["law"], oracle.inputs(q, w, *around)[0])

    for unit in (along(rng.normal(size=(3, LANES))), along(F[:3] @ x)):
        around = Around(bounds, oracle.J, inverse, rng, LANES)
        around.kept = n["momentum"] * rng.uniform(size=LANES) ** 0.3 * along(rng.normal(size=(3, LANES)))
        begun, momentum, turning = leaning(around, q, 0.0), around.kept, np.linalg.norm(w, axis=0) + n["target.rate"]
        error = n["error"] + n.get("error.per.rate", 0.0) * turning
        command = around.command(asked, q, w, 0.0, unit) + error * unit
        later, rate, turned = q, w, rng.uniform()
        for part, sign in ((turned, 1.0), (1.0 - turned, -1.0)):
            for k in range(4):
                outside = sign * (n["outside"] + n.get("outside.per.rate", 0.0) * turning) * unit
                outside = outside + around.loaded(unit, turning, part * h / 4)
                later, rate = around.after(later, rate, h * k / 4, command, outside, part * h / 4)
        y, ended = np.concatenate([rate, later[1:]]), leaning(around, later, h)
        states = [
            dict(zip(("q0", *STATE[3:], *STATE[:3], *MOMENTA), np.concatenate(one), strict=True))
            for one in ((q, w, momentum), (later, rate, around.kept))
        ]
        command = held.alone
        for parts, kinds in (([twice_energy(held)], QUARTIC), (command, kinds_of(command))):
            means, beside, pushed = changing(held, tube, parts, kinds)
            before, after = (np.array([valued(p, one) for p in parts]) for one in states)
            off = np.abs((after - before) / h - [valued(p, states[0]) for p in means])
            off /= np.array([[float(one + pushed)] for one in beside])
            assert 0.01 < off.max() <= 1.0
        assert np.linalg.norm(begun, axis=0).max() <= float(held.leant[1])
        assert (np.abs(y) <= np.array([[float(tube.sizes[name])] for name in STATE])).all()
        drift = np.abs(rate - w).max(axis=1) / np.array([float(one) for one in tube.drift])
        assert 0.02 < drift.max() <= 1.0
        change = oracle.lyapunov(later, rate) - oracle.lyapunov(q, w)
        most = h * (float(size) * np.linalg.norm(F @ x, axis=0) + float(rest) - (x * (Q @ x)).sum(0))
        assert (change <= most).all()
        A = floats(held.near.A)[:, :, None] + sum(a[:, :, None] * b for a, b in zip(linear, momentum, strict=True))
        # All of the motion in A of the momentum, or all of it what noise adds, which is in A without momentum.
        z = x - begun
        whole, moving = (
            np.einsum("ijk,jk->ik", A, z),
            (region.sizes[SPEED], held.pulled((region.sizes[SPEED], region.sizes[ANGLE]))),
        )
        for after, radii in ((whole, AT_REST), (floats(held.near.A) @ z, moving)):
            left, ways = y - ended - after, np.concatenate([np.eye(6), rng.normal(size=(100, 6))])
            most = sum(np.linalg.norm(ways @ floats(B), axis=1) * float(b) for B, b in held.linear(tube, *radii))
            used = float((np.abs(ways @ left) / most[:, None]).max())
            assert used <= 1.0
            grown = max(grown, used)
    assert grown > 0.1


@cache
def calm():
    """A loop on which almost nothing acts but a torque that the law is told."""
    loop = Loop(make_subject(built("cubesat-nadir", "wheel")))
    return loop, Pushed(loop, Pushes(0.0))


def carried(**more):
    """That loop with other numbers, and its programs."""
    Account.left = 10**12
    loop, own = calm()
    n = {name: x for name, x in own.numbers.items() if name not in CHANGE}
    n |= dict.fromkeys(("momentum", "target.rate", "target.acceleration"), 1e-9) | more
    claim = own.claim(own.leans[0][1], n)
    return Held(AttitudeLoop(read(claim, loop.by_digest))), Oracle({"programs": loop.by_digest}, claim)


def test_a_torque_that_is_told_changes_a_motion_by_no_more_than_as_fast_as_it_may():
    sudden, _ = carried()
    held, oracle = carried(**dict(zip(CHANGE, (4e-7, 1e-9), strict=True)))
    n, h, rng, lanes = oracle.numbers, float(held.h), np.random.default_rng(8), 300
    told = np.array([[n[f"outside.{k}"]] for k in range(3)])
    # In a period it changes by less than it may at once, but not by much less.
    assert 0.2 < h * n[CHANGE[0]] / (2 * np.linalg.norm(told)) < 0.9
    region = held.region((held.s + held.G[3][3]) / 2**40)
    inverse = np.linalg.inv(oracle.J)
    x = np.linalg.cholesky(floats(region.X)) @ along(rng.normal(size=(6, lanes)))
    w, q = x[:3], np.concatenate([[np.sqrt(1.0 - (x[3:] ** 2).sum(0))], x[3:]])
    around = Around(
        Surroundings(told[:, 0], 0.0, 0.0, n["momentum"], 0.0, 0.0, None, told_change(n)), oracle.J, inverse, rng, lanes
    )
    around.kept = 0.0 * w
    unit = np.sign(rng.normal(size=(3, lanes)))
    command = around.command(lambda *given: run(oracle.programs["law"], oracle.inputs(*given)[0]), q, w, 0.0, unit)
    later, rate = q, w
    for k in range(8):
        later, rate = around.after(later, rate, k * h / 8, command, around.loaded(unit, 0.0, h / 8), h / 8)
    y = np.concatenate([rate, later[1:]])
    left, ways = y - floats(held.near.A) @ x, np.concatenate([np.eye(6), rng.normal(size=(100, 6))])
    change = oracle.lyapunov(later, rate) - oracle.lyapunov(q, w)

    def used(held):
        tube = held.tube(region)
        most = sum(np.linalg.norm(ways @ floats(B), axis=1) * float(b) for B, b in held.linear(tube))
        Q, _, F, size, rest, _ = held.fall(tube)
        Q, F = floats(Q), floats(F)
        fall = h * (float(size) * np.linalg.norm(F @ x, axis=0) + float(rest) - (x * (Q @ x)).sum(0))
        widest = np.array([[float(one)] for one in tube.drift])
        return (
            float((np.abs(ways @ left) / most[:, None]).max()),
            float((change / fall).max()),
            float((np.abs(rate - w) / widest).max()),
        )

    assert 0.9 < max(used(held)) <= 1.0
    assert max(used(sudden)) < 0.5
    held.change = [x / 2 for x in held.change]
    assert max(used(held)) > 1.0
    # One that could change faster than it may at once is no different from that.
    held.change = [Fraction(1), Fraction(0)]
    assert used(held) == used(sudden)


def test_a_torque_that_is_told_at_a_misread_attitude_is_misread_by_no_more_than_its_bound():
    angle, steep = 1e-3, 2e-3
    held, oracle = carried(**{"error.attitude": angle}, **dict(zip(CHANGE, (0.0, steep), strict=True)))
    rng, none = np.random.default_rng(9), np.zeros((3, 200))
    turned, off = along(rng.normal(size=(3, 200))), along(rng.normal(size=(3, 200)))
    off[:, :100] = -turned[:, :100]

    def asked(half, torque):
        q = np.concatenate([[np.sqrt(1.0 - (half**2).sum(0))], half])
        return np.array(run(oracle.programs["law"], oracle.inputs(q, none, torque, none, none, none)[0]))

    wrong = asked(np.sin(angle / 2) * turned, steep * angle * off) - asked(none, none)
    bound = float(held.misread(held.region((held.s + held.G[3][3]) / 2**40))[0])
    assert 0.5 * bound < np.linalg.norm(wrong, axis=0).max() <= bound
    held.change = None
    assert float(held.misread(held.region((held.s + held.G[3][3]) / 2**40))[0]) < 0.5 * bound


def test_a_target_whose_motion_is_misread_moves_the_torque_by_no_more_than_its_bound():
    """What the target is read to turn more, the error is read to turn less, as the body's own rate is read as it is."""
    Account.left = 10**12
    loop = Loop(make_subject(built("cubesat-nadir", "lyapunov")))
    wrong = pushes(loop.loop, loop.known.envelope(False))._replace(attitude=0.0, rate=0.0)
    wrong = wrong._replace(target_rate=1e-4, target_acceleration=3e-4)
    own = Pushed(loop, wrong)
    _, V, held, _ = own.leans[0]
    oracle = Oracle({"programs": loop.by_digest}, loop.claim("points", own.words, V, **own.numbers), 7)
    region = held.region(held.s / 1000)
    bound, rng, far = float(held.misread(region)[0]), oracle.rng, 0.0
    states = np.linalg.cholesky(floats(region.X)) @ along(rng.normal(size=(6, 300)))
    for x in states.T:
        q, w = np.array([np.sqrt(1.0 - x[3:] @ x[3:]), *x[3:]]), x[:3]
        e, r, a, H = oracle.environment()
        turn, more = along(rng.normal(size=(3, 2))).T * [[wrong.target_rate], [wrong.target_acceleration]]
        inputs = oracle.inputs(q, w, e, r, a, H)[0]
        misread = inputs | oracle.inputs(q, w - turn, e, r + turn, a + more, H)[0]
        true, seen = (np.array(run(oracle.programs["law"], one)) for one in (inputs, misread))
        far = max(far, float(np.linalg.norm(seen - true)))
    assert 0.3 * bound < far <= bound


def test_a_body_that_leans_on_its_momentum_is_where_it_is_said_to_be_and_stays():
    """Without the lean the push that holds it would be a larger one than is claimed of what is not slow."""
    Account.left = 10**12
    loop = Loop(make_subject(built("cubesat-nadir", "lyapunov")))
    own = Pushed(loop, pushes(loop.loop, loop.known.envelope(True))._replace(attitude=0.0, rate=0.0))
    held = own.leans[0][2]
    n, A, B = own.numbers, floats(held.near.A), floats(held.near.B)
    b = sum(b for _, b in held.linear(held.tube(held.region(held.s / 2**26)))[:2]) / 2
    torque = np.cross(np.eye(3)[0] * n["target.rate"], np.eye(3)[2] * n["momentum"])
    assert np.isclose(np.linalg.norm(torque), float(held.lasting), rtol=1e-9)
    x = np.zeros(6)
    for _ in range(2000):
        x = A @ x + B @ torque
    assert np.isclose(np.linalg.norm(x[3:]), float(held.leant[1]), rtol=1e-6)
    assert float(b) < np.linalg.norm(torque)


def test_a_potential_that_is_even_holds_motions_on_one_side_of_a_half_turn():
    """With V the same for both quaternions a set is that with q0 > 0, which no motion may leave within a period."""
    Account.left = 10**12
    loop = Loop(make_subject(built("wheels-orbital", "wheel")))
    own = Pushed(loop, pushes(loop.loop, loop.known.envelope(False)))
    _, V, held, _ = own.leans[0]
    assert held.even
    assert held.s == 0
    stiff = held.G[3][3]
    for share in (0.02, 0.5):
        region = held.region(stiff * round(share * 2**20) / 2**20)
        # At rest V = stiff |q|^2; no less of the set is left out by its mixed term.
        assert 0.0 < float(region.least) <= np.sqrt(1.0 - share)
    with pytest.raises(RefusedError, match="the other quaternion"):
        held.region(stiff)
    low, high = stiff / 2, stiff
    for _ in range(30):
        middle = (low + high) / 2
        try:
            held.region(middle)
            low = middle
        except RefusedError:
            high = middle
    with pytest.raises(RefusedError, match="a half turn"):
        held.tube(held.region(low))
    claim = own.claim(V, own.numbers | {"level": 1e-6, "start.angle": 3.2, "start.rate": 0.0, "highest": 1.0})
    with pytest.raises(RefusedError, match="the other quaternion"):
        dict(points(read(claim, loop.by_digest)))


def test_momentum_that_turns_with_the_target_changes_what_a_law_asks_for():
    """Where body, momentum and target turn as fits worst, flights show what that adds, and the bound of a change has it."""
    held, oracle = carried(**{"momentum": 5e-3, "target.rate": 0.02})
    n, h, rng = oracle.numbers, float(held.h), np.random.default_rng(9)
    level, command = (held.s + held.G[3][3]) / 2**12, held.alone
    tube = held.tube(held.region(level))
    means, beside, pushed = changing(held, tube, command, kinds_of(command))
    around = Around(
        Surroundings([0.0] * 3, n["target.rate"], 0.0, n["momentum"], 0.0, 0.0, None, told_change(n)),
        oracle.J, np.linalg.inv(oracle.J), rng, LANES,
    )  # fmt: skip
    q, w = np.eye(4)[0][:, None] + np.zeros(LANES), along(rng.normal(size=(3, LANES)))
    # V is a form in w.
    w *= np.sqrt(float(level) / (oracle.lyapunov(q, w) - oracle.lyapunov(q, 0.0 * w)))
    around.kept, around.axis, around.phase = n["momentum"] * along(w), along(cross(w, rng.normal(size=(3, LANES)))), 0.0
    momentum, none = around.kept, 0.0 * w
    torque = around.command(lambda *given: run(oracle.programs["law"], oracle.inputs(*given)[0]), q, w, 0.0, none)
    later, rate = q, w
    for k in range(8):
        later, rate = around.after(later, rate, k * h / 8, torque, none, h / 8)
    ends = (
        dict(zip(("q0", *STATE[3:], *STATE[:3], *MOMENTA), np.concatenate(one), strict=True))
        for one in ((q, w, momentum), (later, rate, around.kept))
    )
    before, after = ends
    changed = np.array([(valued(p, after) - valued(p, before)) / h for p in command])
    off = np.linalg.norm(changed - [valued(p, before) for p in means], axis=0)
    by_turning = np.linalg.norm(cross(w, cross(around.target(q, 0.0)[0], momentum)), axis=0).max()
    *_, unturned = changing(held, tube, held.u, kinds_of(command))
    assert off.max() > 0.8 * by_turning
    assert float(pushed - unturned) > by_turning
    assert off.max() < float(pushed) + np.linalg.norm([float(one) for one in beside])
