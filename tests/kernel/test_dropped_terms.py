"""Terms of the bounds of a period with wheels: each is needed, for without it a flight of a period exceeds the bound."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from starhold.certification.evidence.claims import floats
from starhold.certification.evidence.terms import valued
from starhold.kernel.follower import FIRST, REST
from starhold.kernel.held import Held
from starhold.kernel.loops import MOMENTA
from starhold.kernel.near import spinning
from starhold.kernel.numbers import RefusedError, scalar
from starhold.kernel.polynomials import var
from starhold.kernel.regions import ANGLE, AT_REST, LOAD, RATE, SPEED, STATE, TURN, felt
from starhold.kernel.theorems.noise import driven
from tests.kernel.flights import along, cross, stepped
from tests.kernel.periods import LANES, NONE, PARTS, Flight, pushed, quiet
from tests.tiers import leading


def used(held, tube, left):
    """The largest share that is used of what pushes make of a motion."""
    ways = np.concatenate([np.eye(6), np.random.default_rng(2).normal(size=(300, 6))])
    most = sum(np.linalg.norm(ways @ floats(B)[:6], axis=1) * float(b) for B, b in held.linear(tube))
    return float((np.abs(ways @ left) / most[:, None]).max())


def dropped(monkeypatch, held, tube, left, term, zero):
    """That share without a term."""
    with monkeypatch.context() as patched:
        patched.setattr(*((Held, term) if callable(zero) else (held, term)), zero)
        return used(held, tube, left)


BESIDE = [
    # What momentum makes of the rates of y, at the sample and as these drift.
    ("lyapunov", "rate", {}, ("turning", NONE)),
    ("wheel", "turn", {}, ("pulled", lambda held, radii: Fraction(0))),
    # Of the rate that is told the law makes a torque with momentum, which drives a drift with it.
    ("wheel", "noise", {}, ("heeded", NONE)),
    # As momentum changes, so does what it makes of noise.
    ("lyapunov", "rate", {"momentum": 5e-6, "outside": 4e-6}, ("apart", AT_REST)),
    ("lyapunov", "turn", {"momentum": 5e-6, "outside": 4e-6}, ("apart", AT_REST)),
]


@pytest.mark.parametrize(("law", "kind", "numbers", "term"), leading(BESIDE, 0))
def test_what_momentum_makes_of_noise_beside_its_own_motion_is_in_the_bound(law, kind, numbers, term, monkeypatch):
    """z = x - y, with the motion y(H) that noise causes, to the first order in momentum. Here x is at rest on target, where
    y is with the largest momentum, and without any it is zero."""
    held, oracle = quiet(law, **numbers, **({"noise.rate": 1e-4} if kind == "noise" else {}))
    rng, c, zero = np.random.default_rng(0), np.eye(3)[2] * oracle.numbers["momentum"], np.zeros((3, LANES))
    flight, unit = Flight(held, oracle, momentum=c[2]), 1e-4 * along(rng.normal(size=(3, LANES)))
    y, noise = (np.concatenate(parts) for parts in ((unit * (kind == "rate"), unit * (kind == "turn")), (zero, unit)))
    noise *= kind == "noise"
    outside = -np.eye(3)[2][:, None] * numbers.get("outside", 0.0)
    (A, B), (D, E) = flight.linear(0.0 * c), flight.spun(c)
    x, H = flight.after(0.0 * y, np.tile(c[:, None], LANES), 0.0, noise[TURN], outside)
    later = A @ y + E @ noise
    left = x - B @ noise - H[2] / c[2] * later + (A + D) @ y
    radii = [max(np.linalg.norm(one[part], axis=0).max() for one in (y, later)) * (1.0 + 1e-9) for part in (RATE, TURN)]
    held.apart = held.swayed = Fraction(radii[0]), Fraction(radii[1])
    tube = held.tube(held.region((held.s + held.G[3][3]) / 2**70))
    assert used(held, tube, left) <= 1.0
    assert dropped(monkeypatch, held, tube, left, *term) > 1.0


def test_what_a_law_that_makes_up_for_momentum_does_late_is_in_the_drift_of_the_rates(monkeypatch):
    """A torque that lags makes up for momentum by as much as it acts in the drift of the linear motion, and at samples at
    once: what is between is in no matrix, and turns momentum on."""
    _, own = pushed("wheel")
    h, lag = own.loop.loop.period, 20.0 * own.loop.loop.period
    kept, mean = np.exp(-h / lag), lag / h * -np.expm1(-h / lag)
    late = {"kept": kept, "mean": mean, "moment": lag / h * (1.0 - mean)}
    late |= {f"{name}_least": (1.0 - 4e-9) * x for name, x in late.items()} | {"weight": 1.0, "begun": 0.0, "rest": 0.0}
    held, oracle = quiet("wheel", **{f"late_torque_{name}": x for name, x in late.items()})
    region, size = held.region((held.s + held.G[3][3]) / 2**36), Fraction(oracle.numbers["momentum"])
    tube = held.tube(replace(region, sizes=region.sizes | {FIRST: Fraction(1, 10**9), REST: Fraction(0)}))
    x = np.linalg.cholesky(floats(region.X)) @ along(np.random.default_rng(3).normal(size=(6, LANES)))
    q, w, H = np.concatenate([[np.sqrt(1.0 - (x[TURN] ** 2).sum(0))], x[TURN]]), x[RATE], np.zeros((3, LANES))
    H[2] = float(size)
    flight = Flight(held, oracle, momentum=float(size))
    around, at = flight.around(H), [Fraction(0), Fraction(0), size]
    command = around.command(flight.asked, q, w, 0.0, 0.0 * H)
    for _ in range(PARTS):
        q, w = around.after(q, w, 0.0, command, 0.0 * H, h / PARTS)
    law, body = spinning(held.loop, at)
    # Nothing is late at first.
    y = np.concatenate([x, floats(held.near.torque) @ x + floats(law) @ x[RATE]])
    left = np.concatenate([w, q[1:]]) - ((floats(held.near.A) + floats(held.near.spun(law, body))) @ y)[:6]
    assert used(held, tube, left) <= 1.0
    assert dropped(monkeypatch, held, tube, left, "spun_on", lambda *given: Fraction(0)) > 1.5


def sizes_of(held, *states):
    """How large the variables of states (q, w, H) are."""
    q, w = (np.concatenate(parts, axis=1) for parts in list(zip(*states, strict=True))[:2])
    sizes = {f"q{k}": Fraction(np.abs(x).max()) for k, x in enumerate(q)}
    sizes |= {name: Fraction(np.abs(x).max()) for name, x in zip(STATE, w, strict=False)}
    lengths = {SPEED: w, ANGLE: q[1:]}
    sizes |= {name: Fraction(np.linalg.norm(v, axis=0).max()) for name, v in lengths.items()}
    return held.others | sizes | {LOAD: Fraction(0)}


ALIKE = [
    # The target's rate takes momentum along, and is turned with the body.
    (0, {"target.rate": 0.05}, 0.02),
    # A torque from outside adds to momentum.
    (1, {"outside": 1e-3}, 0.02),
    # An error of the command turns the body otherwise, and its momentum with it.
    (2, {"error": 1e-2}, 1e-3),
]


@pytest.mark.parametrize(("term", "numbers", "fast"), leading(ALIKE, 0))
def test_changes_of_momentum_that_does_not_turn_as_without_pushes_are_in_the_bound(term, numbers, fast):
    held, oracle = quiet("lyapunov", **numbers)
    rng, n, inverse = np.random.default_rng(4), oracle.numbers, np.linalg.inv(oracle.J)
    flight = Flight(held, oracle, rng, momentum=n["momentum"], rate=n["target.rate"])
    H, unit, turn = (along(rng.normal(size=(3, LANES))) for _ in range(3))
    H, x = n["momentum"] * H, np.concatenate([fast * turn, 1e-3 * unit])
    push = {name: numbers.get(name, 0.0) * unit for name in ("outside", "error")}
    states = list(flight.states(x, H, **push))
    _, q, w, _, around = states[0]
    free = flight.asked(q, w, 0 * w, around.target(q, 0.0)[0], 0 * w, H)

    def plain(q, w, H):
        own = q[1:]
        turning = np.concatenate([[-(own * w).sum(0)], q[0] * w + cross(own, w)]) / 2
        return turning, inverse @ (free - cross(w, H) - oracle.J @ cross(w, around.target(q, 0.0)[0])), cross(H, w)

    def at(q, w, H, r):
        values = {f"{name}{k + 1}": x for name, v in (("w", w), ("h", H), ("r", r)) for k, x in enumerate(v)}
        return dict.fromkeys(held.others, 0 * w[0]) | values | {f"q{k}": x for k, x in enumerate(q)}

    def moved(parts, one, other):
        return np.linalg.norm([valued(p, one) - valued(p, other) + 0 * w[0] for p in parts], axis=0)

    steady, turning = held.parted
    straight, means, r = (q, w, H), [], around.target(q, 0.0)[0]
    for t, q, w, kept, own in states:
        straight = stepped(plain, straight, flight.h / PARTS) if t else straight
        here, rate = straight[2], own.target(q, t)[0]
        means.append(
            moved(steady, at(q, w, kept, rate), at(q, w, H, r)) + moved(turning, at(q, w, kept, rate), at(q, w, here, r))
        )
    sizes = sizes_of(held, *[(q, w, 0 * w) for _, q, w, *_ in states])
    change = float(np.trapezoid(means, dx=1.0 / PARTS, axis=0).max())
    pushed_away = float(np.linalg.norm(w - straight[1], axis=0).max())
    calm, slower = map(float, held.unlike_body(sizes, held.parted))
    bounds = [float(held.stale(sizes, steady)), float(held.stale(sizes, turning, 0)), slower * pushed_away]
    assert np.isclose(calm, sum(bounds[:2]))
    assert change <= sum(bounds)
    assert change > sum(bounds) - bounds[term]


def test_no_variable_of_a_motion_without_pushes_changes_faster_than_is_said_and_each_does_as_fast():
    held, oracle = quiet("lyapunov")
    rng, inverse, h = np.random.default_rng(5), np.linalg.inv(oracle.J), 1e-7
    signs = rng.choice([-1.0, 1.0], size=(10, 4000))
    w, H, u = 0.1 * signs[:3], 0.01 * along(signs[3:6]), 0.02 * signs[6:9]
    H[:, ::2] = 0.01 * along(np.cross(rng.normal(size=(3, 2000)), w[:, ::2], axis=0))
    q = along(rng.normal(size=(4, 4000)))
    q[:, ::3] = np.concatenate([[0 * w[0]], along(w)])[:, ::3]
    q[:, 1::3] = np.eye(4)[:, :1]
    sizes = sizes_of(held, (q, w, H)) | dict.fromkeys(("u1", "u2", "u3"), Fraction(0.02))

    def slope(q, w, H):
        own = q[1:]
        turning = np.concatenate([[-(own * w).sum(0)], q[0] * w + cross(own, w)]) / 2
        return turning, u - inverse @ cross(w, H), cross(H, w)

    ends = stepped(slope, (q, w, H), h)
    rates = [np.abs(b - a).max(axis=1) / h for a, b in zip((q, w, H), ends, strict=True)]
    speeds = held.speeds(sizes)
    names = [f"q{k}" for k in range(4)], STATE[RATE], MOMENTA
    for name, rate in ((name, rate) for part in zip(names, rates, strict=True) for name, rate in zip(*part, strict=True)):
        assert 0.5 < rate / float(speeds[name]) <= 1.0 + 1e-6, name


@pytest.mark.parametrize("law", leading(["lyapunov", "wheel"], 0))
def test_what_momentum_adds_to_the_motion_that_noise_causes_is_that_of_flights(law):
    """With a momentum, and with the opposite one, to the first order."""
    held, oracle = quiet(law)
    size = Fraction(oracle.numbers["momentum"])
    flight = Flight(held, oracle, momentum=float(size))
    for axis in range(3):
        c = [size * (axis == k) for k in range(3)]
        A, B = flight.linear(np.zeros(3))
        D, E = flight.spun(np.array(c, dtype=float))
        # The law is told these errors themselves.
        motion, noise = map(floats, driven(held.near, scalar(1, 6), scalar(1, 6), spinning(held.loop, c)))
        wanted = np.block([[A + D / 2, D / 2, B + E], [-D / 2, A - D / 2, B - E]])
        assert np.abs(motion[:12] - wanted).max() < 1e-6 * np.abs(D).max()
        assert np.abs(noise[:12] - wanted[:, 12:]).max() < 1e-6 * np.abs(D).max()
        assert np.allclose(motion[-6:, 12:], E, atol=1e-6 * np.abs(E).max())
        assert min(np.abs(D).max(), np.abs(E).max()) > 1e-3


@pytest.mark.parametrize("law", leading(["lyapunov", "wheel"], 0))
def test_what_momentum_adds_to_the_torque_and_to_the_drift_of_the_rates_is_in_the_tube(law):
    """The one law makes no torque of it, and so the rates drift farther; the other makes up for it."""
    held, oracle = quiet(law)
    size, M, N = Fraction(oracle.numbers["momentum"]), floats(held.near.rates), floats(held.N)
    flight, tube = Flight(held, oracle, momentum=float(size)), held.tube(held.region((held.s + held.G[3][3]) / 2**40))
    X, drifts = floats(tube.region.X), np.array([float(x) for x in tube.drift])
    asks, beyond = np.array([float(tube.sizes[f"u{k + 1}"]) for k in range(3)]), []
    for axis in range(3):
        for sign in (1, -1):
            spin = [N @ floats(part) for part in spinning(held.loop, [sign * size * (axis == k) for k in range(3)])]
            commanded, moved = (M + np.hstack([one, 0 * one]) for one in (spin[0], spin[0] + spin[1]))
            H = sign * float(size) * np.eye(3)[:, [axis] * 3]
            for rows, most in ((commanded, asks), (moved, drifts)):
                # For each axis the state from which it goes farthest.
                x = X @ rows.T / np.sqrt(np.diag(rows @ X @ rows.T)) * (1.0 - 1e-9)
                q = np.concatenate([[np.sqrt(1.0 - (x[TURN] ** 2).sum(0))], x[TURN]])
                if most is asks:
                    far = N @ flight.asked(q, x[RATE], *[0 * H] * 3, H)
                else:
                    far = flight.after(x, H)[0][RATE] - x[RATE]
                assert (np.abs(np.diag(far)) <= most).all()
                linear = np.sqrt(np.diag(M @ X @ M.T)) * (1.0 if most is asks else flight.h)
                beyond.append((np.abs(np.diag(far)) / linear).max())
    assert max(beyond) > 1.05


def test_a_vector_whose_size_is_not_told_is_not_taken_for_zero():
    assert felt([var("w1")], "r", {}) == 0
    with pytest.raises(RefusedError, match="is not stated"):
        felt([var("h1") * var("w1")], "w", {"h1": Fraction(1)})
