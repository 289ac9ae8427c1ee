"""From where a pointing claim is sought: what floats tell of a start set beside what is proved, and how much is proved."""

import random
from dataclasses import replace
from fractions import Fraction

import pytest

from starhold.certification.certify import certify
from starhold.certification.evidence import cones, slow, squares, starts
from starhold.certification.evidence.starts import likely
from starhold.kernel.held import Held
from starhold.kernel.polynomials import dot, poly, variables
from starhold.kernel.rules import Squares
from starhold.scenario.building import build
from starhold.scenario.reading import load
from starhold.studies.bodies.rigid_body import wanted_of
from tests.proofs import afresh

Q, W = variables("q", 0), variables("w")


def limited(r):
    """A limit on a load that is linear in the state, on {V <= level} of a V with a cross term: near its end."""
    k, lean, level = (Fraction(r.randrange(50, 150), 100) for _ in range(3))
    V = k * (1 - Q[0]) * 2 + dot(W, W) * Fraction(1, 2) + lean * Fraction(1, 5) * dot(Q[1:], W)
    load = sum((Fraction(r.randrange(-9, 10), 9) * x for x in [*Q[1:], *W]), poly(0))
    bound = Fraction(r.randrange(20, 400), 100)
    return Squares(bound - load, [poly(1), *Q, *W], 0, [level - V], [dot(Q, Q) - 1])


def test_floats_tell_which_limits_can_be_proved():
    r, kept = random.Random(1), []
    for _ in range(40):
        o = limited(r)
        chance = likely(o, {})
        # Nearer to the border than this nothing is told.
        if abs(chance) > 1e-6:
            kept.append(chance > 0.0)
            assert (squares.squares(o, {}) is not None) == kept[-1]
    assert 10 < sum(kept) < 30 < len(kept)


def test_floats_tell_nothing_where_entries_of_the_matrix_share_a_monomial():
    z = [poly(1), *Q[1:], *(a * b for a in Q[1:] for b in Q[1:2])]
    assert likely(Squares(poly(1) - dot(Q[1:], Q[1:]), z, 0, [], [dot(Q, Q) - 1]), {}) is None


@pytest.mark.slow
@pytest.mark.parametrize(("name", "law"), [("flexible-slew", "pd"), ("cubesat-nadir", "wheel")])
def test_what_is_proved_in_vain_is_counted(name, law, monkeypatch):
    """Where a start set is looked for, no sum of squares is made exact, images of a sum are not judged again, and V is
    followed over few periods."""
    counts = {"falls": 0, "exact": 0, "likely": 0, "definite": 0}

    def counted(owner, name, what):
        made = getattr(owner, name)

        def count(*given, **more):
            counts[what] += 1
            return made(*given, **more)

        monkeypatch.setattr(owner, name, count)

    counted(Held, "fall", "falls")
    counted(squares, "exactly", "exact")
    counted(starts, "likely", "likely")
    counted(slow, "definiteness", "definite")
    scenario = load(name)
    monkeypatch.setattr(cones, "_KNOWN", {})
    with afresh():
        certificate = certify(replace(build(scenario, scenario.pick(law)), events=()), name, wanted_of(scenario, True))
    assert certificate.claim("pointing").outcome == "proved"
    assert 0 < counts["likely"] < 40
    assert counts["definite"] < 40
    assert counts["exact"] < 45
    assert counts["falls"] < 60
