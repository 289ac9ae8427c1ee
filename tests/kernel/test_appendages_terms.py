"""Terms of the bounds of loops with appendages: each is needed, for motions in which it is nearly all come near to it."""

from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import expm

from starhold.kernel import appended
from starhold.kernel.appended import Appended, Box, Left, after, combined, follow, image
from starhold.kernel.numbers import Account
from starhold.kernel.polynomials import apply, dot, var
from starhold.kernel.regions import STATE
from starhold.kernel.theorems.appendages import inner, settled, sized
from starhold.kernel.theorems.response import Response
from tests.kernel.flights import along

N, H, COUNT = 7, 0.5, 181
FIRST = np.eye(3)[:, :1]
TOLERANCE = 1e-9


def exact(v):
    return [Fraction(float(x)) for x in v]


def exactly(rows):
    return list(map(exact, rows))


def only(x, place=0, count=N):
    v = np.zeros(count)
    v[place] = x
    return v


@dataclass
class Chain:
    """z_0 is driven, and drives z_1, which drives z_2, and so on; the law, its remainder and torques act about the first
    axis. All of this is positive: so what is largest of each is where all that acts is largest at all times."""

    radii: np.ndarray = field(default_factory=lambda: np.zeros(N - 1))
    chain: float = 0.8
    torque: float = 1.0
    rate: float = 0.0
    turn: float = 0.0
    state: float = 0.0
    held: float = 0.0
    rest: float = 0.0
    place: int = 0
    law: float = 0.0
    law_rest: float = 0.0
    told: dict = field(default_factory=dict)

    def __post_init__(self):
        Account.left = 10**12
        self.A = np.diag([self.chain] * (N - 1), -1)
        self.B, self.T, self.K, self.U, self.D = (np.zeros(shape) for shape in ((N, 3), (N, 3), (3, N), (3, N), (N, N)))
        self.B[0, 0], self.T[0, 0], self.D[0, 0] = self.torque, self.held, self.state
        self.K[0, 0], self.K[0, 3], self.U[0, 0] = -self.rate, -self.turn, self.law
        s, c = np.sin(0.7), np.cos(0.7)
        self.W = np.diag([1.0, 1.0, 3.0, 0.5, 1.0, 2.0, 1.0])
        self.W[:2, :2] = 2.0 * np.array([[c, s], [-s, c]])
        self.blocks = [2, *[1] * (N - 2)]
        self.numbers = {"outside": 0.0, "error": 0.0, "period": H} | self.told

    @cached_property
    def motion(self):
        made = Appended.__new__(Appended)
        made.n, made.count, made.h = N, 1, Fraction(H)
        made.numbers = {name: Fraction(x) for name, x in self.numbers.items()}
        made.A, made.B, made.K = map(exactly, (self.A, self.B, self.K))
        made.take(exactly(self.W), self.blocks)
        rest, law_rest = exact(only(self.rest, self.place)), exact(only(self.law_rest, count=3))
        left = Left(*map(exactly, (self.D, self.T)), rest, exactly(self.U), law_rest)
        made.left = lambda box: left
        return made

    @cached_property
    def bounds(self):
        """Those of a period in a box that is hardly larger than they are."""
        radii, motion = exact(self.radii), self.motion
        box = Box([Fraction(1, 10**9)] * N, [Fraction(1, 10**9)] * 3, [Fraction(0)] * N)
        for _ in range(8):
            period = motion.period(box)
            state = combined(image(period.between, radii), period.far, [Fraction(1, 10**20)] * N)
            torque = combined(image(period.torque, radii), period.pushed, [Fraction(1, 10**20)] * 3)
            box = Box(state, torque, combined(state, motion.misread))
        return radii, box, motion.period(box)

    def most(self, name):
        fast = np.linalg.norm(np.array(self.bounds[1].state[:3], dtype=float))
        return self.numbers[name] + self.numbers.get(f"{name}.per.rate", 0.0) * fast

    @cached_property
    def begun(self):
        """States at samples: in each lane the first two coordinates, which are one block, are in another direction."""
        turns = np.linspace(0.0, 2.0 * np.pi, COUNT)
        first = self.radii[0] * np.array([np.cos(turns), np.sin(turns)])
        return np.linalg.inv(self.W) @ np.vstack([first, np.repeat(self.radii[1:, None], COUNT, axis=1)])

    @cached_property
    def torques(self):
        """The torque that is asked for, and all that act, for the period."""
        misread = only(self.numbers.get("error.rate", 0.0)) + only(self.numbers.get("error.attitude", 0.0) / 2, 3)
        told = self.begun + misread[:, None]
        command = -self.K @ told + self.U @ np.abs(told) + only(self.law_rest, count=3)[:, None]
        return command, command + (self.most("error") + self.most("outside")) * FIRST

    def after(self, t):
        """States after a time, with as much as there may be of each remainder."""
        grown = expm(np.block([[self.A + self.D, np.eye(N)], [np.zeros((N, 2 * N))]]) * t)
        return grown[:N, :N] @ self.begun + grown[:N, N:] @ self.driven

    @property
    def driven(self):
        return (self.B + self.T) @ self.torques[1] + only(self.rest, self.place)[:, None]

    def rates(self, z):
        """z' of states."""
        return self.A @ z + self.D @ z + self.driven

    @property
    def wrong(self):
        """The torque that is held besides that which is linear in the state at the sample, and its bound."""
        radii, _, period = self.bounds
        most = period.error + appended.norm(combined(image(period.law, radii), period.law_rest))
        return self.torques[1] - self.most("outside") * FIRST + self.K @ self.begun, most

    def shares(self):
        """How much of each bound is used, component by component of what is bounded at all."""
        radii, box, period = self.bounds
        command, every = self.torques
        flown = [self.after(t) for t in np.linspace(0.0, H, 11)]
        last = self.W @ flown[-1]
        wrong, most_wrong = self.wrong
        # In each direction external torques have the effect that is bounded, or less.
        linear = np.array(self.motion.sampled, dtype=float) @ self.begun
        ways = [np.linalg.norm(np.array(way, dtype=float), axis=1) for way in self.motion.ways]
        pushes = [self.most("outside")] * 3 + [float(most_wrong)]
        beside = np.array(self.motion.beside(period, box, most_wrong), dtype=float)
        pull = np.array(self.motion.pull, dtype=float) @ self.begun
        hurry = np.max([np.linalg.norm(self.rates(z)[:3] - pull, axis=0) for z in flown])
        used = {
            "samples": (period.grown, period.more, [np.linalg.norm(last[:2], axis=0), *last[2:]]),
            "states": (period.between, period.far, np.max(np.abs(flown), axis=0)),
            "torques": (period.torque, period.pushed, every),
            "commands": (period.torque, period.commanded, command),
        }
        bounds = {
            name: (np.array(combined(image(rows, radii), more), dtype=float), reached)
            for name, (rows, more, reached) in used.items()
        }
        bounds["beside"] = beside + sum(x * y for x, y in zip(ways, pushes, strict=True)), flown[-1] - linear
        bounds["hurried"] = [float(self.motion.hurried(period, box, radii, most_wrong))], [hurry]
        bounds["wrong"] = [float(most_wrong)], [np.linalg.norm(wrong, axis=0)]
        return {
            name: [used / max(y, 1e-30) for used, y in zip(map(np.max, np.abs(reached)), most, strict=True) if used > 1e-12]
            for name, (most, reached) in bounds.items()
        }


SMALL = 1e-3
DISK, THIRD = only(SMALL, count=N - 1), only(SMALL, 2, N - 1)
ALONE = {
    "samples of a block": {"radii": DISK},
    "samples": {"radii": THIRD},
    "feedback of the rate": {"radii": DISK, "rate": 1.0, "chain": 0.1},
    "feedback of the turn": {"radii": THIRD, "turn": 3.0, "chain": 0.1},
    "rest": {"rest": SMALL},
    "in proportion to the state": {"radii": DISK, "state": 0.1, "chain": 0.1},
    "in proportion to the torque": {"radii": DISK, "rate": 1.0, "torque": 1e-9, "held": 1.0, "chain": 0.1},
    "in proportion to what is pushed": {"told": {"outside": SMALL}, "state": 0.1, "chain": 0.1},
    "in proportion to what pushes": {"told": {"outside": SMALL}, "torque": 1e-9, "held": 1.0, "chain": 0.1},
    "law": {"radii": DISK, "law": 1.0, "chain": 0.1},
    "rest of the law": {"law_rest": SMALL},
    "outside": {"told": {"outside": SMALL}},
    "outside with the rate": {"radii": DISK, "told": {"outside.per.rate": 0.3}, "chain": 0.1},
    "error": {"told": {"error": SMALL}},
    "error with the rate": {"radii": DISK, "told": {"error.per.rate": 0.3}, "chain": 0.1},
    "misread rate": {"rate": 1.0, "told": {"error.rate": SMALL}},
    "misread turn": {"turn": 1.0, "told": {"error.attitude": SMALL}},
    "law of what is misread": {"law": 1.0, "told": {"error.rate": SMALL}},
}


@pytest.mark.parametrize("case", ALONE)
def test_a_motion_comes_near_to_what_bounds_it_and_no_further(case):
    shares = Chain(**ALONE[case]).shares()
    assert all(0.96 < max(used) <= 1.0 + TOLERANCE for used in shares.values() if used)


SERIES = {
    # Terms of a series that ends after the first one.
    "samples": ({"radii": THIRD}, {"FINE": 1}),
    "samples of a block": ({"radii": DISK}, {"FINE": 1}),
    "rest": ({"rest": SMALL}, {"FINE": 1}),
    "rest beside a block": ({"rest": SMALL, "place": 1}, {"FINE": 1}),
    "outside": ({"told": {"outside": SMALL}}, {"FINE": 1}),
    "error": ({"told": {"error": SMALL}}, {"FINE": 1}),
    # Terms that are rounded to nothing.
    "rounded samples": ({"radii": THIRD}, {"PLACES": 1}),
    "rounded rest": ({"rest": SMALL}, {"PLACES": 1}),
    "rounded outside": ({"told": {"outside": SMALL}}, {"PLACES": 1}),
    # Matrices of samples and of pushes that are rounded down.
    "rounded motion": ({"radii": THIRD, "chain": -1e-3}, {"PLACES": 4}),
    "rounded pushes": ({"told": {"outside": SMALL}, "torque": 0.24, "chain": 1e-3}, {"PLACES": 4}),
    "rounded errors": ({"told": {"error": SMALL}, "torque": 0.12, "chain": 1e-3}, {"PLACES": 4}),
}


@pytest.mark.parametrize("case", SERIES)
def test_what_series_leave_out_is_in_the_bound(case, monkeypatch):
    given, patches = SERIES[case]
    for name, x in patches.items():
        monkeypatch.setattr(appended, name, x)
    shares = Chain(**{"chain": 0.02} | given).shares()
    assert max(map(max, filter(None, shares.values()))) <= 1.0 + TOLERANCE


PULLED = {
    # y.e^(A t)B d is even, as its chord is, or a parabola between zeros, or a cubic with three of them.
    "chord": ((1.0, 1.0), 1.0),
    "parabola": ((0.0, H, -2.0), 1.0),
    "cubic": ((0.0, H * H / 2, -3.0 * H, 6.0), 0.12),
}


@pytest.mark.parametrize("shape", PULLED)
def test_external_torques_that_reverse_within_a_period_move_it_as_far_as_is_said_and_no_further(shape):
    """y is such that y.A^mB are the derivatives of that function at the end."""
    slopes, near = PULLED[shape]
    chain = Chain(told={"outside": SMALL}, chain=1.0)
    _, box, period = chain.bounds
    y = np.zeros(N)
    y[: len(slopes)] = slopes
    ways = [np.linalg.norm(y @ np.array(way, dtype=float)) for way in chain.motion.ways[:3]]
    beside = np.array(chain.motion.beside(period, box, Fraction(0)), dtype=float)
    t = np.linspace(0.0, H, 4001)
    pulled = np.trapezoid(np.abs(np.polyval([s / f for s, f in zip(slopes, (1, 1, 2, 6), strict=False)][::-1], t)), t)
    assert near * (sum(ways) * SMALL + np.abs(y) @ beside) < pulled * SMALL * (1.0 + 1e-6)
    assert pulled * SMALL <= (sum(ways) * SMALL + np.abs(y) @ beside) * (1.0 + 1e-6)


def test_a_curve_is_away_from_its_middle_by_what_is_said():
    """The second derivative at the end, less that in the middle."""
    chain = Chain(chain=1.0)
    ends = [chain.A @ chain.A @ expm(chain.A * t) @ chain.B for t in (H, H / 2)]
    away = np.linalg.norm(ends[0] - ends[1], axis=1) * H**3 / 12
    bent = np.array(chain.motion.bent, dtype=float)
    assert (away <= bent).all()
    assert (away >= 0.99 * bent)[3:].all()


@pytest.mark.parametrize(("fine", "rate"), [(1, 0.02), (20, 0.02), (2**14, 0.6)])
def test_what_series_leave_out_of_a_curve_is_in_the_bound(fine, rate, monkeypatch):
    """Of the value at the end, and of the second derivative."""
    monkeypatch.setattr(appended, "FINE", fine)
    chain = Chain(chain=rate)
    motion, end = chain.motion, expm(chain.A * H) @ chain.B
    last, middle = (np.array(way, dtype=float) for way in motion.ways[1:3])
    away = np.linalg.norm(H / 2 * end - last, axis=1)
    away += np.linalg.norm(H**3 / 12 * chain.A @ chain.A @ end - middle, axis=1)

    assert (away <= np.array(motion.bent, dtype=float)).all()


@pytest.mark.parametrize("blocks", [[1] * N, [2, 1, 2, 2]])
def test_a_start_is_within_its_radii_and_reaches_them(blocks):
    """The farthest of an ellipsoid, with appendages as far as they are."""
    random = np.random.default_rng(2)
    motion, W, F = Appended.__new__(Appended), random.normal(size=(N, N)), random.normal(size=(6, 6))
    if 2 in blocks:
        # Nothing that is longest together is in two directions.
        W[1::2, 6], F = 0.0, np.eye(6)
        W[:, :6] = np.diag([1.0, 3.0, 0.5, 2.0, 1.0, 1.5, 1.0])[:, :6]
    motion.W, motion.blocks = exactly(W), blocks
    radii = np.array(motion.begun(exactly(F @ F.T), [Fraction(2)]), dtype=float)
    at = 0
    for size, radius in zip(blocks, radii, strict=True):
        turns = np.linspace(0.0, 2.0 * np.pi, 1441)
        ways = np.array([np.cos(turns), np.sin(turns)])[:, :: 1 if size > 1 else 2000][:size]
        rows, at = W[at : at + size], at + size
        x = F @ F.T @ rows[:, :6].T @ ways
        x /= np.sqrt((x * np.linalg.solve(F @ F.T, x)).sum(axis=0)).clip(1e-12)
        reached = [np.linalg.norm(rows[:, :6] @ x + sign * 2.0 * rows[:, 6:], axis=0).max() for sign in (1.0, -1.0)]
        assert (0.75 if 2 in blocks else 1.0 - 1e-9) * radius < max(reached) <= radius * (1.0 + TOLERANCE)


def test_an_ellipsoid_holds_a_set_of_v_and_hardly_more():
    """On the border of the set where V is that of a small turn, and of a large one."""
    s, G = 2.0, np.diag([1.0, 2.0, 3.0, 0.1, 0.0, 0.2])
    G[0, 3] = G[3, 0] = 0.3
    q0, x = var("q0"), [var(name) for name in STATE]
    V = Fraction(s) * (1 - q0) + dot(x, apply(exactly(G), x))
    loop = SimpleNamespace(lyapunov=V, q=[q0])
    random = np.random.default_rng(1)
    for level, near in ((1e-4, 0.999), (0.3, 0.85)):
        X = np.array(inner(loop, Fraction(level)), dtype=float)
        z = along(random.normal(size=(6, 4000)))
        low, high = np.zeros(4000), np.full(4000, 0.99)
        for _ in range(60):
            middle = (low + high) / 2
            q = z[3:] * middle
            size = s * (1 - np.sqrt((1 - (q * q).sum(axis=0)).clip(0.0))) + (middle**2) * (z * (G @ z)).sum(axis=0)
            low, high = np.where(size < level, middle, low), np.where(size < level, high, middle)
        reached = low**2 * (z * np.linalg.solve(X, z)).sum(axis=0)
        assert near < reached.max() <= 1.0 + TOLERANCE


def test_the_scalar_part_is_off_by_no_more_than_is_said():
    for q in (0.05, 0.3, 0.5):
        said = float(sized([Fraction(0)] * 3 + [Fraction(q), *[Fraction(0)] * 2])["v"])
        assert said / 2 < 1.0 - np.sqrt(1.0 - q * q) <= said


def test_bounds_of_samples_are_those_of_every_one_of_them():
    """Of a motion that swings between two of its coordinates, so that the largest is not the last."""
    random = np.random.default_rng(3)
    period = SimpleNamespace(grown=exactly(random.uniform(0.0, 0.4, (4, 4))), more=exact(random.uniform(size=4)))
    period.grown[0][1], period.grown[1][0] = Fraction(3, 2), Fraction(1, 3)
    for begun in (exact([0.0, 3.0, 0.0, 9.0]), exact([9.0, 0.0, 1.0, 0.0])):
        for count in (1, 2, 5, 12):
            samples = [np.array(begun, dtype=float)]
            for _ in range(count):
                samples.append(np.array(period.grown, dtype=float) @ samples[-1] + np.array(period.more, dtype=float))
            most, last = follow(period, begun, count)
            assert np.allclose(np.array(most, dtype=float), np.max(samples[:-1], axis=0), rtol=1e-12)
            for one in (last, after(period, begun, count)):
                assert np.allclose(np.array(one, dtype=float), samples[-1], rtol=1e-12)


def response(chain):
    """That of one sample, of the rows of the rate, the turn and the linear acceleration."""
    motion = chain.motion
    rows = np.vstack([np.eye(N)[:6], np.array(motion.pull, dtype=float)])
    first, last, middle, held = (rows @ np.array(way, dtype=float) for way in motion.ways)
    parts = [slice(3 * k, 3 * k + 3) for k in range(3)]
    gains = [
        exact([np.linalg.norm(one[k], 2) for one in (first, middle, held)] + np.array([np.linalg.norm(last[k], 2), 0, 0]))
        for k in parts
    ]
    left = np.abs(rows @ np.array(motion.sampled, dtype=float))
    return Response(1, gains, exactly(left), exactly(np.abs(rows)))


LATER = {
    "samples": {"radii": only(SMALL, 1, N - 1)},
}
for name in ("rest", "rest of the law", "outside", "error", "misread rate", "law of what is misread"):
    LATER[name] = ALONE[name]


@pytest.mark.parametrize("case", LATER)
def test_rates_are_within_their_bound_until_half_a_period_after_a_sample(case):
    """The state is at rest at the sample before, if not any within its radii."""
    chain = Chain(**LATER[case] | {"chain": 1e-3})
    radii, box, period = chain.bounds
    begun = response(chain)
    if not chain.radii.any():
        begun = replace(begun, left=exactly(np.zeros((9, N))))
    wide, _ = settled(chain.motion, begun, period, box, radii)
    z = chain.after(H)
    # What is asked for is the same torque again.
    last = np.linalg.norm((z + H / 2 * (chain.rates(z) - chain.D @ z))[:3], axis=0).max()
    assert 0.85 < last / float(wide) <= 1.0 + TOLERANCE


@pytest.mark.parametrize("spinning", [True, False])
def test_turns_are_as_far_from_the_line_between_samples_as_is_said(spinning):
    """A body that spins about an axis at right angles to its turn, and one that is driven to and fro."""
    chain, at, fast = Chain(rest=0.0 if spinning else 1e-2, chain=0.0), 0.3, 0.2
    radii, box, period = chain.bounds
    w = fast * spinning
    box = box._replace(state=exact([w, 0, 0, 0, at * spinning, 0, 0]))
    no = Response(1, exactly(np.zeros((3, 3))), *(exactly(np.zeros((9, N))) for _ in range(2)))
    _, turned = settled(chain.motion, no, period, box, radii)
    t = np.linspace(-H / 2, H / 2, 201)
    if spinning:
        # q' = q (0, w)/2 turns (q2, q3).
        q = at * np.array([0 * t, np.cos(w * t / 2), np.sin(w * t / 2)])
    else:
        q = np.array([np.sin(1e-2 * t * t / 4), 0 * t, 0 * t])
    away = np.linalg.norm(q[:, 100] - (q[:, 0] + q[:, -1]) / 2)
    assert 0.98 * float(turned) < away <= float(turned)
