"""Every law passes every check of the conformance suite, and broken laws do not."""

from pathlib import Path

import pytest

from starhold.conformance.suite import CHECKS, NotApplicableError, examine
from starhold.laws.catalogue import catalogue, from_file


@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.__name__)
@pytest.mark.parametrize("name", sorted(catalogue()))
def test_law_conforms(name, check):
    try:
        check(catalogue()[name])
    except NotApplicableError as reason:
        pytest.skip(str(reason))


def test_catalogue_holds_the_laws_of_the_published_comparison():
    assert {"lyapunov", "matrix-pd", "mpc", "pd", "sliding"} <= set(catalogue())


GOOD = Path(catalogue()["pd"].module.__file__).read_text()

BROKEN = {
    "wrong unit": ('Gain("N m s", above', 'Gain("N m", above', "keeps_units"),
    "torque at rest": ("craft), feedback)", "craft), add(feedback, (1e-9, 0.0, 0.0)))", "rests_on_target"),
    "anti-damping": ("scale(gains.k_rate, seen.rate)", "scale(-gains.k_rate, seen.rate)", "decreases_lyapunov"),
    "wrong sign of stiffness": ("scale(gains.k_attitude", "scale(-gains.k_attitude", "decreases_lyapunov"),
    "even in q": ("vector_part(seen.attitude)", "scale(seen.attitude[0], vector_part(seen.attitude))", "double_cover"),
    "not finite": (
        "subtract(tracking_torque(seen, craft), feedback)",
        "subtract(scale(0.0 / (1.0 - seen.attitude[0] * seen.attitude[0]), seen.rate), feedback)",
        "stays_finite",
    ),
    "example out of bounds": ("Gains(0.5, 0.05)", "Gains(-0.5, 0.05)", "declares_itself"),
}


@pytest.mark.parametrize("fault", sorted(BROKEN))
def test_broken_law_is_caught(fault, tmp_path):
    old, new, check = BROKEN[fault]
    assert old in GOOD
    path = tmp_path / f"law_{fault.replace(' ', '_').replace('-', '_')}.py"
    path.write_text(GOOD.replace(old, new))
    law = from_file(path)
    failed = [c.__name__ for c in CHECKS if check in c.__name__ and _fails(law, c)]
    assert failed


def _fails(law, check):
    try:
        check(law)
    except Exception:
        return True
    return False


def test_examine_reports_each_check_once():
    verdicts = list(examine(catalogue()["pd"]))
    assert len(verdicts) == len(CHECKS) == len({v.name for v in verdicts})
    assert {v.outcome for v in verdicts} == {"passed"}
