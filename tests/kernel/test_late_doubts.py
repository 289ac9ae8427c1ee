"""Doubts about what is late in a loop: each bound of a period with a lag against periods that are flown, with laws that are
not linear in the attitude, and what a statement says of the lag."""

import json

import pytest

from starhold.certification.evidence.finding import certificate
from starhold.certification.proofs import pointed
from starhold.certification.subject import make_subject
from starhold.kernel.check import check
from starhold.kernel.numbers import RefusedError
from starhold.kernel.regions import settled
from starhold.parts.catalogue import fit
from tests.kernel.lagging import AXES, BALL, Lagging
from tests.making import built
from tests.tiers import leading

KINDS = [
    (BALL, 0.5, 0.25, 1e-2, 0.1),
    (AXES, 0.5, 0.25, 1e-3, 0.05),
    (AXES, 0.5, 2.0, 1e-2, 0.1),
    (BALL, 0.25, 1.0, 0.02, 0.2),
]


@pytest.mark.parametrize("kind", leading([(kind,) for kind in KINDS]))
@pytest.mark.parametrize("alike", [True, False])
def test_no_period_exceeds_what_is_late_after_it_and_where_it_takes_the_state(kind, alike):
    loop = Lagging(*kind, alike=alike)
    for level, off in ((1e-9, 1e-3), (1e-7, 1e-2), (1e-5, 1e-3)):
        assert loop.changed(level, off, True) <= 1.0
        assert loop.changed(level, off, False) <= 1.0
        assert loop.moved(level, off) <= 1.0 + 1e-8
    assert loop.moved(1e-9, 1e-2) > 0.5


@pytest.mark.parametrize("late", [{"mean": 0.0}, {"mean": -0.1}, {"kept": 1.0}, {"kept": -0.1}, {"weight": 0.0}])
def test_numbers_of_what_is_never_late_are_refused(late):
    with pytest.raises(RefusedError):
        Lagging(BALL, 0.5, 0.25, 1e-2, 0.1, alike=False, **late)


def test_bounds_that_only_grow_are_refused_for_that_and_not_for_how_long_numbers_become():
    with pytest.raises(RefusedError, match="the period is too long for the rates"):
        settled(lambda bounds: [1 + 3 * x * x for x in bounds])


@pytest.mark.slow
@pytest.mark.parametrize(("part", "number"), [("lag", 0.05), ("rate-limit", 0.1)])
def test_a_claim_says_that_components_near_what_is_asked_for_alike_where_it_uses_it(part, number):
    loop = built("three-laws", "lyapunov").with_parts(fit("actuator", part, number))
    claim, _ = pointed(make_subject(loop))
    one, programs = claim.proof.claim, list(claim.proof.programs.values())
    for alike in (True, False):
        numbers = {x: one["numbers"][x] for x in one["numbers"] if not x.endswith(".least") and x != "late.torque.moment"}
        if alike:
            numbers |= {x: y for x, y in one["numbers"].items() if x not in numbers}
            numbers.setdefault("late.torque.moment", "1/3")
            for x in ("kept", "mean", "moment"):
                numbers.setdefault(f"late.torque.{x}.least", numbers[f"late.torque.{x}"])
        try:
            (proved,) = check(json.dumps(certificate(programs, [one | {"numbers": numbers}])))
        except RefusedError:
            # The evidence for one is not that for the other.
            assert alike == (part == "rate-limit")
            continue
        assert ("late-alike" in proved.statement.assumptions) == alike
        assert ("in all components alike" in proved.statement.text) == alike
