"""Laws that polynomials cannot follow: undecided, with the operation and its line, and flown all the same."""

import pytest

from starhold.certification.certify import certify
from starhold.conformance.bench import sample_loop
from starhold.laws.catalogue import from_file

HEAD = """
from typing import Annotated, NamedTuple

from starhold.algebra.elementary import tanh
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
    "a number's bits": "tanh(1.0 + dot(measurement.rate, measurement.rate))",
    "less_equal": "where(less_equal(measurement.attitude[0], 0.5), 1.0, 2.0)",
    "opposite": "where(opposite(less(measurement.attitude[0], 0.5)), 1.0, 2.0)",
}
NEAR_REST = ("a division by what varies", "less_equal", "opposite")


def law_of(text, folder, head=HEAD):
    path = folder / "own.py"
    path.write_text(head + text)
    return from_file(path)


@pytest.mark.parametrize("declared", ["V", "no V"])
@pytest.mark.parametrize("operation", SIZES)
def test_what_cannot_be_read_is_undecided_with_the_operation_and_its_line(operation, declared, tmp_path):
    law = law_of(PLAIN.format(size=SIZES[operation]) + V * (declared == "V"), tmp_path)
    certificate = certify(sample_loop(law, law.examples()[0]))
    claim, *others = certificate.claims
    if declared == "V" and operation == "less_equal":
        # The kernel can read it: V does not know of the step of the stiffness.
        assert (claim.kind, claim.outcome) == ("convergence", "refuted")
        return
    assert not others
    # Near rest the switching ones are one polynomial, whose step with the torque held is stable.
    stable = declared == "no V" and operation in NEAR_REST
    assert (certificate.outcome, claim.outcome) == ("undecided", "proved" if stable else "undecided")
    assert (claim.kind == "sampling") == stable
    reason = "" if stable else claim.obligations[0].evidence["reason"]
    line = next(n for n, row in enumerate((tmp_path / "own.py").read_text().splitlines(), 1) if row.startswith("    size ="))
    assert stable or reason.startswith(f"law own: own.py, line {line}: {operation}")


def test_a_law_with_a_memory_is_undecided(tmp_path):
    kept = "\n\nclass Memory(NamedTuple):\n    v: float\n\n\ndef remember(gains, craft, period):\n    return Memory(0.0)\n"
    law = law_of(kept + PLAIN.format(size="1.0") + V, tmp_path)
    (claim,) = certify(sample_loop(law, law.examples()[0])).claims
    assert claim.obligations[0].evidence["reason"] == "the law keeps a memory from call to call"
