"""What sentences say is no more than the numbers of their claims."""

import math
from fractions import Fraction

import pytest
from hypothesis import example, given
from hypothesis import strategies as some

from starhold.certification.certificate import Certificate, Claim, Obligation
from starhold.certification.rounding import shown
from starhold.certification.wording import eigenvalues, sentence
from starhold.checker import Finding
from starhold.cli.show_certificates import print_certificate, print_findings
from starhold.studies.certificates import Tried

SUBJECT = {"law": "lqr", "quaternion_sign": "as_published", "hysteresis_width": 0.5}


@given(some.floats(1e-300, 1e300))
@example(0.0049951)
@example(math.nextafter(0.005, 0.0))
@example(59.99999999)
def test_a_bound_is_never_shown_for_more_than_it_is(x):
    least, most = Fraction(shown(x)), Fraction(shown(x, up=True))
    slack = Fraction(1, 10**14)
    assert least <= Fraction(x) * (1 + slack)
    assert most >= Fraction(x) * (1 - slack)
    assert most - least <= Fraction(x) / 100


def test_what_was_written_is_shown_as_it_was():
    assert shown(math.degrees(math.radians(60.0)), "°") == shown(math.degrees(math.radians(60.0)), "°", up=True) == "60°"
    assert shown(0.0049951, " N m") == "0.0049951 N m"
    assert shown(1.0 / 3.0) == "0.3333"
    assert shown(1.0 / 3.0, up=True) == "0.3334"


def claim(kind_, outcome="proved", **numbers):
    return Claim(kind_, numbers, {}, (), (Obligation("form", "exact identity", outcome, {}),))


def test_a_torque_that_is_withstood_is_not_rounded_up():
    told = {"torque": [0.00499512345] * 3, "margin": 1e-5}
    assert "up to 0.004995 N m" in sentence(claim("sliding", **told), SUBJECT)
    assert "up to 0.004996 N m" in sentence(claim("sliding", "refuted", **told), SUBJECT)
    told = {"limit": 0.00499512345, "kind": "axis", "everything": True}
    assert "never exceeds 0.004996 N m" in sentence(claim("torque-limit", **told), SUBJECT)
    assert "never exceeds 0.004995 N m" in sentence(claim("torque-limit", "refuted", **told), SUBJECT)


@pytest.mark.parametrize(
    ("slew_angle", "sign_policy", "law", "every"),
    [
        (math.radians(186.0), "as_published", "lqr", False),
        (math.radians(359.0), "as_published", "lqr", False),
        (2.0 * math.pi, "as_published", "lqr", True),
        (math.radians(186.0), "hysteresis", "lqr", False),
        (math.radians(240.1), "hysteresis", "lqr", True),
        (math.pi, "shortest", "lqr", True),
        (math.pi, "as_published", "wheel", True),
        (math.radians(179.0), "shortest", "lqr", False),
    ],
)
def test_every_attitude_is_said_of_both_its_quaternions(slew_angle, sign_policy, law, every):
    numbers = {"slew_angle": slew_angle, "rate": 0.1, "rate_everywhere": None, "everything": False}
    told = sentence(claim("convergence", **numbers), {**SUBJECT, "quaternion_sign": sign_policy, "law": law})
    assert ("rest at every attitude and" in told) == every
    assert every or f"up to {shown(math.degrees(slew_angle))}°" in told
    assert "global on rotations" not in told


def test_an_eigenvalue_is_shown_on_its_side_of_the_unit_circle():
    for z in ([0.99999999, 0.0], [-1.00000001, 0.0], [0.6, 0.8 - 1e-9], [0.5, 0.25]):
        told = eigenvalues(claim("sampling", eigenvalues=[z]))
        parts = [float(x.rstrip(" i")) for x in told.split("±")] + [0.0]
        assert (math.hypot(*parts[:2]) >= 1.0) == (math.hypot(*z) >= 1.0), told


def test_names_are_no_markup(capsys):
    for name in ("[/red]", "[bold", "\ud800", "a\x1b[31mb", "x" * 10_000, "\\"):
        certificate = Certificate(name, {**SUBJECT}, (claim("convergence", "undecided", everything=True),))
        print_certificate(Tried(certificate, None, {}))
        print_findings([Finding(name, name, name, "fails", name)])
    shown_there = capsys.readouterr().out
    assert "[/red]" in shown_there
    assert "\\ud800" in shown_there
    assert "\x1b[31m" not in shown_there


@pytest.mark.parametrize(("flown", "outcome"), [("proved", "proved"), ("undecided", "undecided")])
def test_what_is_undecided_of_an_ideal_loop_does_not_count_beside_the_loop_that_flies(flown, outcome):
    claims = claim("pointing", flown), claim("convergence", "undecided"), claim("sampling")
    assert Certificate("here", {}, claims).outcome == outcome
    assert Certificate("here", {}, (*claims, claim("torque-limit", "refuted"))).outcome == "refuted"
