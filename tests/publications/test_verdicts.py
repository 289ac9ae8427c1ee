"""Verdicts follow from what was measured and from the printed digits alone."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from starhold.publications.verdicts import Finding, Printed, judge

DIGITS = st.decimals(min_value=-1000, max_value=1000, places=3).map(str)


@given(DIGITS, st.floats(-1.0, 1.0))
def test_a_number_agrees_just_where_it_rounds_to_the_printed_digits(text, share):
    ours = float(text) + share * 1e-3
    # At the half itself either rounding is right.
    if abs(abs(share) - 0.5) > 1e-6:
        assert Printed.read(text).rounds_from(ours) == (round(ours, 3) == float(text))


@pytest.mark.parametrize(
    ("text", "ours", "tolerance", "verdict"),
    [
        ("22.8", 22.8499, 0.0, "agrees"),
        ("22.8", 22.88, 0.0, "differs"),
        ("22.8", 22.88, 0.004, "close"),
        ("22.80", 22.88, 0.004, "close"),
        ("0.061", 0.0612, 0.0, "agrees"),
        ("1.22e-6", 1.224e-6, 0.0, "agrees"),
        ("1.22e-6", 1.226e-6, 0.0, "differs"),
        ("6540", 6540.4, 0.0, "agrees"),
        ("> 3000", 3001.0, 0.0, "agrees"),
        ("> 3000", 3000.0, 0.0, "differs"),
        ("< 0.1", 0.05, 0.0, "agrees"),
        ("1", math.nan, 0.5, "differs"),
        ("1", math.inf, 0.5, "differs"),
    ],
)
def test_verdict_on_a_number(text, ours, tolerance, verdict):
    assert judge(Finding(ours), [Printed.read(text)], tolerance) == verdict


def test_several_numbers_get_the_worst_of_their_verdicts():
    printed = [Printed.read("1.0"), Printed.read("2.0")]
    assert judge(Finding([1.01, 2.01]), printed, 0.0) == "agrees"
    assert judge(Finding([1.01, 2.1]), printed, 0.1) == "close"
    assert judge(Finding([1.01, 2.3]), printed, 0.1) == "differs"


STATEMENTS = [(True, "holds"), (False, "fails"), ({"a": True}, "holds"), ({"a": True, "b": False}, "depends")]


@pytest.mark.parametrize(("value", "verdict"), [*STATEMENTS, ({"a": False}, "fails")])
def test_verdict_on_a_statement(value, verdict):
    assert judge(Finding(value), [], 0.0) == verdict


@pytest.mark.parametrize(("value", "texts"), [(True, ["1"]), ({"a": True}, ["1"]), ({}, []), (1.0, []), ([1.0], ["1", "2"])])
def test_a_finding_of_another_kind_is_refused(value, texts):
    with pytest.raises(ValueError, match=r"measured|answer"):
        judge(Finding(value), [Printed.read(text) for text in texts], 0.0)


@pytest.mark.parametrize("text", ["", "about 3", "nan", "inf", "3 to 4"])
def test_only_numbers_are_read(text):
    with pytest.raises((ValueError, ArithmeticError)):
        Printed.read(text)
