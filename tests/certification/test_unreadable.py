"""Laws that polynomials cannot follow: undecided, with the operation and its line, and flown all the same."""

import pytest

from starhold.algebra.polynomial import Polynomial, UnreadableError
from starhold.algebra.scalar import both, divide, less, less_equal, opposite, sqrt
from starhold.certification.certify import certify
from starhold.conformance.bench import sample_loop
from starhold.conformance.suite import examine
from starhold.laws.catalogue import adopted, from_file
from starhold.scenario.reading import parse
from starhold.scenario.writing import scenario_with
from starhold.studies.certificates import certify_scenario
from starhold.studies.compare import compare

HEAD = """
from typing import Annotated, NamedTuple

from starhold.algebra.quaternion import vector_part
from starhold.algebra.scalar import absolute, clip, less, less_equal, opposite, side, sqrt, where
from starhold.algebra.vector import add, apply, dot, norm, scale
from starhold.laws.interface import Card, Gain

CARD = Card(title="Own", summary="u", sources=("a textbook",), assumptions=("rigid body",), claims="local")


class Gains(NamedTuple):
    k: Annotated[float, Gain("N m", above=0.0, text="stiffness")]
    d: Annotated[float, Gain("N m s", above=0.0, text="damping")]


def examples():
    return [Gains(0.01, 0.1)]
"""
V = """

def lyapunov(measurement, gains, craft):
    energy = 0.5 * dot(measurement.rate, apply(craft.inertia, measurement.rate))
    return energy + 2.0 * gains.k * (1.0 - measurement.attitude[0])
"""
PLAIN = """

def torque(measurement, gains, craft, memory):
    size = {size}
    return add(scale(-gains.d, measurement.rate), scale(-gains.k * size, vector_part(measurement.attitude))), memory
"""
SIZES = {
    "a square root": "sqrt(1.0 + dot(measurement.rate, measurement.rate))",
    "a division by what varies": "1.0 / (1.5 + measurement.attitude[0])",
    "less_equal": "where(less_equal(measurement.attitude[0], 0.5), 1.0, 2.0)",
    "opposite": "where(opposite(less(measurement.attitude[0], 0.5)), 1.0, 2.0)",
}
NEAR_REST = ("a division by what varies", "less_equal", "opposite")
TWIST = """

class Memory(NamedTuple):
    v: tuple


def remember(gains, craft, period):
    return Memory((0.0, 0.0, 0.0))


def torque(measurement, gains, craft, memory):
    s = add(measurement.rate, scale(gains.k / gains.d, vector_part(measurement.attitude)))
    u = tuple(-gains.root * sqrt(absolute(x)) * side(x) + v for x, v in zip(s, memory.v))
    v = tuple(clip(v - measurement.period * 0.001 * clip(1000.0 * x, 1.0), 0.01) for x, v in zip(s, memory.v))
    return u, Memory(v)
"""


def law_of(text, folder, head=HEAD):
    path = folder / "own.py"
    path.write_text(head + text)
    return from_file(path)


@pytest.mark.parametrize("declared", ["V", "no V"])
@pytest.mark.parametrize("operation", SIZES)
def test_what_cannot_be_read_is_undecided_with_the_operation_and_its_line(operation, declared, tmp_path):
    law = law_of(PLAIN.format(size=SIZES[operation]) + V * (declared == "V"), tmp_path)
    certificate = certify(sample_loop(law, law.examples()[0]))
    (claim,) = certificate.claims
    # Near rest the switching ones are one polynomial, whose step with the torque held is stable.
    stable = declared == "no V" and operation in NEAR_REST
    assert (certificate.outcome, claim.outcome) == ("undecided", "proved" if stable else "undecided")
    assert (claim.kind == "sampling") == stable
    reason = "" if stable else claim.obligations[0].evidence["reason"]
    line = next(n for n, row in enumerate((tmp_path / "own.py").read_text().splitlines(), 1) if row.startswith("    size ="))
    assert stable or reason.startswith(f"law own: own.py, line {line}: {operation}")


@pytest.mark.parametrize("declared", ["V", "no V"])
def test_a_law_with_a_root_and_a_memory_conforms_flies_and_is_undecided(declared, tmp_path):
    root = (
        'd: Annotated[float, Gain("N m s", above=0.0, text="d")]\n    root: Annotated[float, Gain("N m s^0.5", above=0.0)]'
    )
    head = HEAD.replace('d: Annotated[float, Gain("N m s", above=0.0, text="damping")]', root).replace("0.1)", "0.1, 0.05)")
    law = law_of(TWIST + V * (declared == "V"), tmp_path, head)
    failed = {v.name: v.reason for v in examine(law) if v.outcome == "failed"}
    # What it declares as V is none of it, and the numbers in its memory's equation have units.
    assert set(failed) <= {
        "V is positive and does not rise, at random states, for a body free of other torques",
        "The declared units are right: the torque is the same in any system of units",
    }
    with adopted(law):
        scenario = parse(scenario_with(law, law.examples()[0]), "here")
        (flight,) = compare(scenario)
        (tried,) = certify_scenario(scenario)
    assert flight.lost is None
    assert tried.certificate.outcome == "undecided"
    told = [claim.obligations[0].evidence["reason"] for claim in tried.certificate.claims]
    assert told == ["the law keeps a memory from call to call"] * (declared == "V")


def test_polynomials_say_what_they_cannot_follow():
    x, y = Polynomial.variable("x"), Polynomial.variable("y")
    truth = less(x, y)
    for refused in (
        lambda: sqrt(x),
        lambda: divide(1.0, x),
        lambda: less_equal(x, y),
        lambda: opposite(truth),
        lambda: both(truth, truth),
    ):
        with pytest.raises(UnreadableError, match=r"test_unreadable\.py, line \d+: "):
            refused()
