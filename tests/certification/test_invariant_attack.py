"""The built-in problems, and an attempt to break their sets: states, motions, areas, all by code that shares nothing."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from starhold.certification.invariant import builtin_names
from starhold.certification.invariant.wording import OBLIGATIONS, evidence, limit, sentence, size
from starhold.studies.phase_portraits import portraits
from tests.certification.invariants import claim, proved
from tests.tiers import leading

STORED = json.loads((Path(__file__).parents[2] / "docs" / "generators" / "sets.json").read_text(encoding="utf-8"))

VDP = (
    *((0.41201, 2, 0), (-0.41629, 1, 1), (0.2336, 0, 2)),
    *((-0.07024, 4, 0), (0.10986, 3, 1), (0.004159, 2, 2), (0.0079332, 1, 3), (-0.0042282, 0, 4)),
    *((0.007509, 6, 0), (-0.0013626, 5, 1), (-0.0023504, 4, 2), (-0.0038831, 3, 3), (0.00068424, 2, 4)),
    *((-0.00067759, 1, 5), (4.6721e-05, 0, 6)),
)


def sextic(x):
    return sum(c * x[0] ** i * x[1] ** j for c, i, j in VDP)


def switching(x):
    """As it is published, which the built-in one is multiplied by what is positive of."""
    inside = x[0] ** 2 + x[1] ** 2 <= 2.0 * x[0]
    upper = np.where(inside, (x[1] ** 2 - x[0] ** 2) / (2.0 * np.where(inside & (x[0] > 0.0), x[0], 1.0)), 1.0 - x[0])
    return np.array([x[1], np.where(x[1] <= 0.0, -2.0 * x[0] - 3.0 * x[1], upper)])


def halves(x):
    lower = (2.0 * x[0] + x[1]) ** 2 - 8.0 * (x[0] + x[1])
    upper = 4.0 * ((x[0] - 1.0) ** 2 + x[1] ** 2 - 1.0)
    return np.maximum(np.where(x[1] <= 0.0, lower, upper), 0.0)


def held(x):
    w = 1.393
    f1, f2, f3 = x[0] ** 2 + x[1] ** 2 - 1.0, x[2] + w * x[1], x[3] - w * x[0]
    return np.array([x[2], x[3], -w * x[3] - 2.0 * f1 * x[0] - f2, w * x[2] - 2.0 * f1 * x[1] - f3])


def held_by(x):
    w = 1.393
    return ((x[0] ** 2 + x[1] ** 2 - 1.0) ** 2 + (x[2] + w * x[1]) ** 2 + (x[3] - w * x[0]) ** 2) / 2.0


def ring(x):
    f = x[0] ** 2 + x[1] ** 2 - 1.0
    return np.array([-x[1] - x[0] * f, x[0] - x[1] * f])


SYSTEMS = {
    # rates, V, the time after which V is down to a tenth of a percent
    "switching": (switching, halves, 60.0),
    "van-der-pol": (lambda x: np.array([-x[1], x[0] - x[1] + x[0] ** 2 * x[1]]), sextic, 60.0),
    "saturated-axis": (
        lambda x: np.array([x[1], x[0] - np.clip(2.0 * (x[0] + x[1]), -1.0, 1.0)]),
        lambda x: np.maximum((x[0] + x[1]) ** 2, x[0] ** 2 / 9.0),
        40.0,
    ),
    "circle": (ring, lambda x: (x[0] ** 2 + x[1] ** 2 - 1.0) ** 2, 40.0),
    "orbit": (held, held_by, 300.0),
    "dead-zone": (
        lambda x: np.array([x[1], -x[1] - (x[0] + x[1]) + np.clip(x[0] + x[1], -1.0, 1.0)]),
        lambda x: np.maximum(0.0, np.maximum((x[0] + x[1]) ** 2 - 1.0, x[0] ** 2 - 1.44)),
        40.0,
    ),
}


FEW = {"circle", "parrilo"}
"""Of these `make test` makes the proofs, which take long."""


@pytest.mark.parametrize("name", leading(sorted(builtin_names(), key=lambda name: name not in FEW), len(FEW)))
def test_examples_are_proved(name):
    problem, certificate = proved(name)
    assert certificate.outcome == "proved"
    for wanted, one, level in zip(problem.claims, certificate.claims, STORED[name]["levels"], strict=True):
        assert sentence(one)
        assert level is None or one.numbers["level"] == pytest.approx(level, rel=2e-3)
        assert wanted.published is None or one.numbers["level"] >= 0.98 * wanted.published
        assert {o.name for o in one.obligations} <= set(OBLIGATIONS)


def test_words_bound_numbers_from_the_right_side():
    assert "99.5 % of the true region's 12" in size({"size": 11.94, "known": 12.0})
    assert "no level reaches 1.0001:" in limit({"refuted_level": 1.00009999, "limited_by": "border"})
    refuted = claim(("-x", "-y"), "region", "x**2 + y**2 - 5").refutation()
    assert "state (x = " in evidence(refuted)


def states(name, count=200_000, seed=0):
    """Random states of the certified set, (n, N)."""
    problem, certificate = proved(name)
    box = np.array(problem.claims[0].box)
    random = np.random.default_rng(seed)
    x = random.uniform(box[:, :1], box[:, 1:], size=(len(box), count))
    return x[:, SYSTEMS[name][1](x) <= certificate.claims[0].numbers["level"]]


def rises(name, x, step=1e-6):
    """V's change along the motion, per time, by a small step."""
    rates, V, _ = SYSTEMS[name]
    return (V(x + step * rates(x)) - V(x)) / step


@pytest.mark.parametrize("name", leading(sorted(SYSTEMS, key=lambda name: name not in FEW), len(FEW & SYSTEMS.keys())))
def test_motions_stay_and_come_to_the_set(name):
    rates, V, time = SYSTEMS[name]
    level = proved(name)[1].claims[0].numbers["level"]
    x = states(name)
    outermost = x[:, np.argsort(-V(x))[:6]]
    for start in outermost.T:
        flown = solve_ivp(lambda t, s: rates(s), (0.0, time), start, rtol=1e-9, atol=1e-11, max_step=0.1)
        values = V(flown.y)
        assert values.max() <= level * (1.0 + 1e-5)
        assert values[-1] < 1e-3 * level


def limit_cycle():
    """The limit cycle of van der Pol's oscillator, (2, n), in forward time."""

    def forward(t, s):
        return [s[1], (1.0 - s[0] ** 2) * s[1] - s[0]]

    settled = solve_ivp(forward, (0.0, 80.0), [2.0, 0.0], rtol=1e-10, atol=1e-12).y[:, -1]
    return solve_ivp(forward, (0.0, 6.663286859), settled, rtol=1e-10, atol=1e-12, max_step=0.002).y


@pytest.mark.slow
def test_share_of_the_region_of_van_der_pol():
    x, y = limit_cycle()
    true = 0.5 * abs(np.sum(x[:-1] * np.diff(y) - y[:-1] * np.diff(x)))
    numbers = proved("van-der-pol")[1].claims[0].numbers
    assert 0.98 < numbers["size"] / true < 0.99
    # No point of the limit cycle is in the certified set, and the area is what random points say.
    assert sextic((x, y)).min() > numbers["level"]
    box = np.array([[-2.2, 2.2], [-2.9, 2.9]])
    points = np.random.default_rng(1).uniform(box[:, :1], box[:, 1:], size=(2, 400_000))
    area = np.prod(box[:, 1] - box[:, 0]) * np.mean(sextic(points) <= numbers["level"])
    assert area == pytest.approx(numbers["size"], abs=0.1)
    assert portraits(*proved("van-der-pol"))[0].orbit_area == pytest.approx(true, rel=1e-3)


LEAF = {
    # Published: how large a quadratic and a quartic V show the ellipsoid to be. Found here, by random search: a state from
    # which the motion diverges, and the size of the ellipsoid that it lies in (published, larger: 2.3328 and 5.8953).
    "falling-leaf-baseline": (
        (0.892067, 2.0006),
        2.2772,
        (-0.09142, -0.55304, 0.16803, -0.040407, 0.036223, 0.21182, -0.084052),
    ),
    "falling-leaf-revised": (
        (3.718758, 4.2995),
        5.681,
        (-0.015181, 0.93931, -0.0047509, 0.53193, -0.016079, 0.002816, 0.0092009),
    ),
}
AXES = np.radians([10, 25, 35, 30, 15, 25, 20])


@pytest.mark.slow
@pytest.mark.parametrize("name", LEAF)
def test_the_falling_leaf_returns_from_ellipsoids_as_large_as_published(name):
    problem, certificate = proved(name)
    published, unstable, state = LEAF[name]
    rates = [compile(problem.written["rates"][x], x, "eval") for x in problem.system.variables]

    def at(x, *codes):
        values = dict(zip(problem.system.variables, x, strict=True))
        return [eval(code, {}, values) for code in codes]

    def flown(x, time=60.0):
        def far(t, s):
            return 20.0 - np.linalg.norm(s / AXES)

        far.terminal = True
        return solve_ivp(lambda t, s: at(s, *rates), (0.0, time), x, rtol=1e-8, atol=1e-10, events=far).y

    state = np.array(state)
    assert np.sum((state / AXES) ** 2) < unstable
    assert np.linalg.norm(flown(state)[:, -1] / AXES) > 19.0
    assert len(certificate.claims) == len(published)
    for one, most, text, (first,) in zip(
        certificate.claims, published, problem.written["V"], problem.written["start"], strict=True
    ):
        assert one.outcome == "proved"
        V, start = compile(" ".join(text.split()), "V", "eval"), compile(first, "start", "eval")
        # The ellipsoid: 0.98 of the published one is in the start set, on the border of which V comes to the level.
        around = np.random.default_rng(3).normal(size=(20_000, 7))
        around *= np.sqrt(0.98 * most) / np.linalg.norm(around, axis=1)[:, None]
        assert all(at(x, start)[0] > 0.0 for x in around[:200] * AXES)
        heights = np.array([at(x, V)[0] for x in around * AXES])
        assert heights.max() < one.numbers["level"]
        # Motions from its border return, V falls along them; one from twice as far does not, and is not in the set.
        for x in (around * AXES)[np.argsort(-heights)[:5]]:
            along = [at(s, V)[0] for s in flown(x).T]
            assert max(along) <= along[0]
            assert along[-1] < 1e-3 * along[0]
        assert at(state, V)[0] > one.numbers["level"]
        assert at(state, start)[0] < 0.0


@pytest.mark.slow
@pytest.mark.parametrize("name", ["saturated-axis", "saturated-strip"])
def test_saturated_axis_is_certified_up_to_its_analytic_region(name):
    """|s| < sqrt(level): within one percent of |s| < 1, twice the linear zone |s| <= 1/2, and nothing of it outside."""
    numbers = proved(name)[1].claims[0].numbers
    assert 0.99 < np.sqrt(numbers["level"]) < 1.0
    assert numbers["refuted_level"] == pytest.approx(1.0, abs=1e-6)
