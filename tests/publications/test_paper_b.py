"""The publication that compares three laws: its measures against SciPy and plain counting, and its verdicts."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from starhold.loop.kernels import Numbers, make_step
from starhold.loop.programs import replay
from starhold.publications.desk import Desk
from starhold.publications.paper import read_paper
from starhold.publications.papers.A import measures as wheels
from starhold.publications.papers.B import calls, equations, measures, random_starts
from starhold.scenario.building import build
from starhold.scenario.reading import parse
from starhold.trace.program import Call, Op, statements
from tests.tiers import leading

MOMENTS = np.array([2.0, 3.0, 4.0])


@pytest.fixture(scope="module")
def desk():
    return Desk("B")


def test_rate_of_a_target_is_scipys_by_e_and_not_as_printed(desk):
    """Differences of SciPy's rotations along a motion."""
    turn, h = np.array([0.3, -0.2, 0.5]), 1e-5

    def attitude(t):
        return Rotation.from_rotvec([0.4, 1.1, -0.3]) * Rotation.from_rotvec(turn * t + np.array([0.0, 0.1, 0.2]) * t**2)

    before, after = attitude(0.7 - h), attitude(0.7 + h)
    rate = (before.inv() * after).as_rotvec() / (2.0 * h)
    q = attitude(0.7).as_quat()
    slope = (after.as_quat() - before.as_quat()) / (2.0 * h)
    block = q[3] * np.eye(3) + np.cross(np.eye(3), q[:3])
    assert np.allclose(2.0 * np.vstack([block, -q[:3]]).T @ slope, rate, atol=1e-8)
    assert np.linalg.norm(2.0 * block @ slope[:3] - rate) > 0.1
    assert equations.target_motion(desk).value == {"rate": False, "acceleration": True}


def test_gravity_block_lacks_a_factor_by_scipys_rotations(desk):
    r, h = np.array([0.6, -0.48, 0.64]), 1e-4

    def torque(vector_part):
        turned = Rotation.from_quat([*vector_part, np.sqrt(1.0 - vector_part @ vector_part)]).inv().apply(r)
        return 3.0 * np.cross(turned, MOMENTS * turned)

    def cross(a):
        return np.cross(np.eye(3), a)

    slopes = np.column_stack([(torque(h * e) - torque(-h * e)) / (2.0 * h) for e in np.eye(3)])
    printed = (cross(r) @ np.diag(MOMENTS) - cross(MOMENTS * r)) @ cross(r)
    factor = equations.gravity_block(desk).value
    assert np.allclose(slopes, factor * printed, atol=1e-6)


@pytest.mark.parametrize(
    ("measure", "letter", "moments", "strength"),
    [
        (measures.gravity_torque, "B", MOMENTS, 398600.0e9 / 7.0e6**3),
        (wheels.gravity_torque, "A", [0.0, 1e4, 1e4], wheels.ORBIT**2),
    ],
)
def test_gravity_torque_is_the_largest_over_all_directions(measure, letter, moments, strength):
    directions = np.random.default_rng(1).normal(size=(200_000, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    torque = 3.0 * strength * np.linalg.norm(np.cross(directions, np.array(moments) * directions), axis=1)
    assert np.ravel(measure(Desk(letter)).value)[-1] == pytest.approx(torque.max(), rel=1e-3)


def test_every_figure_of_the_publication_is_made():
    assert {item.number for item in read_paper("B").figures} >= {str(number) for number in range(1, 31)}


def test_operations_are_those_of_the_program(desk):
    """Counted statement by statement; its one loop turns once a call."""
    names = {"plus", "minus", "product", "divide", "sqrt"}

    def count(function):
        found = list(statements(function.body))
        own = sum(isinstance(s, Op) and s.operation.name in names for s in found)
        return own + sum(count(s.function) for s in found if isinstance(s, Call))

    found = {}
    for law in ("lyapunov", "sliding"):
        for gravity in (True, False):
            scenario = desk.scenario("three-laws", {"environment.gravity_gradient": gravity})
            loop = build(scenario, scenario.pick(law))
            program = replay(make_step(loop.composition()), loop.carry(), Numbers.of(loop.phases(1)[0]))
            found[law, gravity] = count(program.main)
            assert calls.operations(desk, law, gravity) == found[law, gravity]
    assert found["sliding", True] == found["sliding", False]
    assert found["lyapunov", True] > found["sliding", True] > found["lyapunov", False]


@pytest.fixture
def few(desk, monkeypatch):
    """A desk with eight random starts of the laws that compile at once."""
    text = desk._files["random-starts"].partition('[[law]]\ntype = "mpc"')[0].replace("runs = 96", "runs = 8")
    small = Desk("B")
    small.once(("scenario", "random-starts", None), lambda: parse(text, "few"))
    monkeypatch.setattr(random_starts, "LAWS", ("lyapunov", "sliding"))
    return small


@pytest.mark.parametrize("kind", leading(["attitude", "rate"]))
def test_counts_over_random_starts_are_those_of_flights(few, kind):
    kept, first = random_starts.counts(few, kind), random_starts.first_passages(few, kind)
    frame = few.campaign("random-starts").frame()
    for law in random_starts.LAWS:
        assert kept[law].shape == first[law].shape == (8, 6)
        assert (first[law] <= kept[law]).all()
        row = frame[frame["law"] == law].iloc[3]
        start = {
            "initial.attitude": [row[f"flown.state.attitude[{k}]"] for k in (1, 2, 3, 4)],
            "initial.rate": [row[f"flown.state.rate[{k}]"] for k in (1, 2, 3)],
        }
        assert 0.02 < np.linalg.norm(start["initial.rate"]) < 0.07
        run = few.recording("three-laws", law, start)
        error = run["attitude_error"][:, 1:] if kind == "attitude" else run["rate"]
        for k in range(6):
            inside = np.linalg.norm(error, axis=1) <= 10.0 ** -(k + 1)
            begins = [n for n in range(len(inside)) if inside[n]]
            assert first[law][3, k] == (begins[0] if begins else np.inf)
            outside = np.flatnonzero(~inside)
            after = 0 if not outside.size else int(outside[-1]) + 1
            assert kept[law][3, k] == (after if after <= 0.9 * 20000 else np.inf)


def test_statements_about_counts():
    def flights(file, law, changes=None):
        return SimpleNamespace(metrics={"steps": {"soon": 10, "late": 30, "never": None}[law]})

    desk = SimpleNamespace(flight=flights)

    def sooner(first, second, factor=1.0):
        case = {"name": "a", "metric": "steps", "first": ["f", first], "second": ["f", second]}
        return measures.sooner(desk, [case], factor).value["a"]

    assert sooner("soon", "late")
    assert sooner("soon", "never")
    assert not sooner("never", "late")
    assert not sooner("never", "never")
    assert not sooner("late", "soon", 2.0)
    assert sooner("late", "soon", 4.0)


def test_signs_that_change_are_counted():
    alternating = np.tile([[1.0], [-1.0]], (1000, 3))
    halting = np.tile([[1.0], [1.0], [-1.0], [-1.0]], (500, 3))
    desk = SimpleNamespace(recording=lambda file, law: {"torque": {"fast": alternating, "slow": halting}[law]})
    of = {"fast": ["f", "fast"], "slow": ["f", "slow"]}
    assert measures.alternates(desk, of, "torque").value == {"fast": True, "slow": False}
