"""A page refuses what the program refuses, in its words: the recorded questions against the reader's own answer."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from starhold.algebra.structure import mapped
from starhold.errors import InputError
from starhold.scenario.building import build
from starhold.scenario.reading import parse
from starhold.studies.questions import UNASKED, Question, record_check
from starhold.studies.reflight import Reflight, reflight
from starhold.trace.handles import RecordingError
from starhold.trace.machine import load
from tests.texts import toml
from tests.tiers import leading

HEAD = toml("""
name = "asked"
[spacecraft] inertia = {inertia}; torque_limit = 0.05
[simulation] duration = 1.0; control_period = 0.1
[initial] attitude = [0.9, 0.3, -0.2, 0.1]; rate = [0.01, 0.0, 0.0]
""")
LAWS = toml("""
[[law]] type = "pd"; k_rate = 0.09; k_attitude = 0.02; limit = "axis"
[[law]] type = "pid"; k_rate = 0.3; k_attitude = 0.03; k_integral = 1e-3; integral_limit = 2e-3
[[law]] type = "super-twisting"; surface_gain = [[0.08, 0.01, 0.0], [0.01, 0.1, 0.0], [0.0, 0.0, 0.12]]; k1 = 4e-4
k2 = 6e-5
[[law]] type = "modal"; phi_0 = -0.1; phi_1 = [[-0.2, 0.1, 0.0], [-0.1, -0.2, 0.0], [0.0, 0.0, -0.1]]; b = -0.01
""")
WHEELS = toml("""
[wheels] layout = "orthogonal"; inertia = 0.5; torque_limit = 0.1; momentum_limit = 5.0
[[law]] type = "pid"; k_rate = 0.3; k_attitude = 0.03; k_integral = 1e-3; integral_limit = 2e-3
""")
MPC = toml("""
[[law]] type = "mpc"; horizon = 3; q_attitude = 1.0; q_rate = 10.0; r = 100.0
""")
CASES = {
    "moments": HEAD.format(inertia="[2.0, 3.0, 4.0]") + LAWS,
    "matrix": HEAD.format(inertia="[[2.0, 0.1, -0.2], [0.1, 3.0, 0.15], [-0.2, 0.15, 4.0]]") + LAWS,
    "wheels": HEAD.format(inertia="[2.0, 3.0, 4.0]") + WHEELS,
}


def asker(questions: tuple[Question, ...]) -> Callable[[dict[str, Any]], str | None]:
    """A function that tells what the page says of values; None where it takes them."""
    machines = [load(question.program, 1) for question in questions]
    return lambda values: _said(questions, machines, values)


def _said(questions: tuple[Question, ...], machines: list[Any], values: dict[str, Any]) -> str | None:
    for question, machine in zip(questions, machines, strict=True):
        x = np.array([number for key in question.keys for number in np.ravel(values[key])], dtype=float)
        y = np.zeros(1 + max(place for flag, words in question.refusals for place in (flag, *_places(words))))
        machine(x.ctypes.data, y.ctypes.data, 1)
        for flag, words in question.refusals:
            if y[flag] == 1.0:
                return "".join(word if isinstance(word, str) else format(y[word[0]], word[1]) for word in words)
    return None


def _places(words: Any) -> list[int]:
    return [word[0] for word in words if not isinstance(word, str)]


def reader(made: Reflight, values: dict[str, Any]) -> str | None:
    """What the program says of the page's file."""
    try:
        scenario = made.changed(values)
        for entry in scenario.laws:
            build(scenario, entry)
    except InputError as error:
        return str(error)
    return None


def stretched(made: Reflight, random: np.random.Generator) -> dict[str, Any]:
    """Some keys moved, as far as sliders and fields go."""
    moves: dict[str, Any] = {}
    for key in random.choice(list(made.dials), size=3, replace=False):
        wide = 0.6 if key.endswith("inertia") else 1.5
        turned = -1.0 if key.startswith("law.") and np.ndim(made.dials[key]) == 2 and random.random() < 0.3 else 1.0
        factors = iter(turned * 10.0 ** random.uniform(-wide, wide, 16))
        moves[key] = mapped(made.dials[key], lambda x, f=factors: x * next(f))
        if np.ndim(moves[key]) == 2 and key.endswith("inertia"):
            rows = moves[key]
            moves[key] = tuple(tuple(rows[min(i, j)][max(i, j)] for j in range(3)) for i in range(3))
    return moves


@pytest.mark.parametrize("case", leading(CASES))
def test_a_page_refuses_what_the_program_refuses_in_its_words(case: str) -> None:
    made, random = reflight(parse(CASES[case], case)), np.random.default_rng(len(case))
    assert made.checks.fixed == {}
    assert made.checks.ranged == {}
    answer, refused, taken = asker(made.checks.questions), set[str](), 0
    for _ in range(24):
        moves = stretched(made, random)
        linked = {key: moves[leader] for key, leader in made.scenario.hooks.linked.items() if leader in moves}
        said, told = answer(made.dials | linked | moves), reader(made, moves)
        assert (said is None) == (told is None), (moves, said, told)
        if said is None or told is None:
            taken += 1
            continue
        # Of two keys that the tables refuse, the program may tell the other.
        key, _, reason = said.partition(": ")
        refused.add(key)
        assert reason in told or not (key.startswith("law ") or key in told), (said, told)
    assert taken
    assert len(refused) >= (2 if case == "wheels" else 3), refused


def test_a_check_is_recorded_along_every_way() -> None:
    def check(pair: tuple[float, float]) -> None:
        a, b = pair
        shown = f"{b:.3g}"
        if a != b and (a < 0.0 or not b < 10.0 * a):
            raise ValueError(f"found {a:g} beside {shown}")
        if 2.0 <= a <= 3.0:
            raise ValueError("between")

    made = record_check(check, ((1.0, 1.0),))
    assert made is not None
    answer = asker((Question("", ("a", "b"), *made),))
    for a in (-1.0, 0.0, 0.5, 1.0, 2.0, 2.5, 3.0, 4.0):
        for b in (-1.0, 0.0, 1.0, 2.0, 25.0, 100.0):
            try:
                check((a, b))
                wanted = None
            except ValueError as error:
                wanted = str(error)
            assert answer({"a": a, "b": b}) == wanted
    assert record_check(lambda pair: None, ((1.0, 1.0),)) is None
    with pytest.raises(RecordingError):
        record_check(lambda pair: np.linalg.eigvalsh(np.diag(pair)), ((1.0, 1.0),))


def test_what_a_law_checks_by_other_means_is_not_moved() -> None:
    made = reflight(parse(HEAD.format(inertia="[2.0, 3.0, 4.0]") + MPC, "mpc"))
    assert made.checks.fixed.keys() >= {"law.mpc.q_attitude", "law.mpc.r"}
    assert set(made.checks.fixed.values()) == {UNASKED}
    assert made.checks.ranged == {"spacecraft.inertia": 3.0}
