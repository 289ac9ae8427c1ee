"""Weights that no regulator is made of end in one line that names them."""

import numpy as np
import pytest

from starhold.errors import InputError
from starhold.laws import lqr
from starhold.scenario.reading import builtin_text, parse
from tests.refusals import refused

HEAD = builtin_text("three-laws").split("[[law]]")[0]
FULL = HEAD.replace("[2.0, 3.0, 4.0]", "[[2.0, 0.1, 0], [0.1, 3.0, 0], [0, 0, 4.0]]")
TURN = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]


def law(**entries):
    return '[[law]]\ntype = "lqr"\n' + "".join(f"{key} = {value}\n" for key, value in entries.items())


def matrix(*weights):
    """A full block with these eigenvalues, as TOML."""
    turned = TURN * np.array(weights) @ TURN.T
    return (0.5 * (turned + turned.T)).tolist()


def both(rate, attitude):
    return np.block([[np.array(rate), np.zeros((3, 3))], [np.zeros((3, 3)), np.array(attitude)]]).tolist()


def says(text, *words):
    with refused(*words, start="my.toml: law[1]"):
        parse(text, "my.toml")


ONES, WIDE = matrix(1, 1, 1), matrix(1e-3, 1, 1e10)
SPREADS = {
    "rate": ("[1, 1e13, 1, 1, 1, 1]", "1", ["q: the weights of the rate", "1e+13", "1e+12"]),
    "attitude": ("[1, 1, 1, 1e-7, 1, 1e7]", "1", ["q: the weights of the attitude", "1e+14", "1e+12"]),
    "torque": ("1", "[1e7, 1, 1e-6]", ["r: the weights of the torque", "1e+13", "1e+12"]),
}


@pytest.mark.parametrize("form", ["II", "III", "numeric"])
@pytest.mark.parametrize("name", SPREADS)
def test_weights_too_far_apart_are_named(form, name):
    q, r, words = SPREADS[name]
    for head in (HEAD,) if form == "II" else (HEAD, FULL):
        says(head + law(form=f'"{form}"', q=q, r=r), *words)


@pytest.mark.parametrize("form", ["II", "III", "numeric"])
def test_twelve_orders_of_magnitude_are_taken(form):
    text = law(form=f'"{form}"', q="[1e6, 1, 1e-6, 1e-6, 1, 1e6]", r="[1e-6, 1, 1e6]")
    gains = parse(HEAD + text, "x").laws[0].gains
    assert gains.k_attitude == pytest.approx([1.0, 1.0, 1.0], rel=1e-15)
    assert gains.k_rate == pytest.approx(np.sqrt([2.0 + 1e12, 4.0, 4.0 + 1e-12]), rel=1e-15)
    # The units of rate, attitude and torque differ, so nothing is said of one against another.
    far = law(form=f'"{form}"', q="[1e20, 1e20, 1e20, 1, 1, 1]", r="1e-10")
    assert parse(HEAD + far, "x").laws[0].gains.k_rate == pytest.approx([1e15] * 3, rel=1e-9)


def test_full_weights_of_twelve_orders_are_taken():
    wide = matrix(1e-6, 1, 1e6)
    parse(HEAD + law(form='"numeric"', q=both(wide, wide), r=wide), "x")


UNSYMMETRIC = [[1, 0.5, 0], [0.25, 1, 0], [0, 0, 1]]
INDEFINITE = [[1, 2, 0], [2, 1, 0], [0, 0, 1]]


FAR = np.array(ONES) * 1e-9
NUMERIC = [
    ({"q": 1, "r": UNSYMMETRIC}, "r must be symmetric"),
    ({"q": both(UNSYMMETRIC, ONES), "r": 1}, "q must be symmetric"),
    ({"q": both(ONES, FAR + np.triu(np.ones((3, 3)), 1) * 1e-12), "r": 1}, "q must be symmetric"),
    ({"q": 1, "r": INDEFINITE}, "r must be positive definite"),
    ({"q": both(INDEFINITE, ONES), "r": 1}, "q must be positive definite"),
    ({"q": both(np.array(ONES) * 1e9, np.array(INDEFINITE) * 1e-9), "r": 1}, "q must be positive definite"),
    ({"q": 1, "r": [1, 1, 0]}, "r must be positive definite; its diagonal holds 0"),
    ({"q": [1, 1, 1], "r": 1}, "6x6 matrix"),
    ({"q": ONES, "r": 1}, "6x6 matrix"),
    ({"q": 1, "r": both(ONES, ONES)}, "3x3 matrix"),
    ({"q": '"a lot"', "r": 1}, "law[1].q"),
    ({"q": "nan", "r": 1}, "finite"),
    ({"q": 1, "r": "inf"}, "finite"),
    ({"q": 1}, "law[1].r"),
    ({"q": 1, "r": 1, "balance": '"least"'}, 'an input of another form than "numeric"'),
    ({"q": both(WIDE, ONES), "r": 1}, "q: the weights of the rate differ by a factor of 1e+13"),
    ({"q": both(ONES, WIDE), "r": 1}, "q: the weights of the attitude differ by a factor of 1e+13"),
    ({"q": 1, "r": WIDE}, "r: the weights of the torque differ by a factor of 1e+13"),
]
DIAGONAL = [
    ({"q": [1, 1, 1, 1, 1], "r": 1}, "6 numbers"),
    ({"q": 1, "r": ONES}, "3 numbers"),
    ({"q": [1, 1, 1, 1, 0, 1], "r": 1}, "above 0"),
    ({"q": 1, "r": [1, -1, 1]}, "above 0"),
    ({"q": 1, "r": 1, "balance": '"all"'}, "none, least"),
    ({"q": [1, 1, 1, 1e-4, 1, 1], "r": 1, "balance": '"q6"'}, "no value of q6 balances the weights; q5 or r2 can"),
    ({"q": [1, 1, 1, 1e-12, 1, 1], "r": [1, 1, 1e-3], "balance": '"r2"'}, "balanced r: the weights of the torque"),
]
WRONG = [("numeric", *one) for one in NUMERIC] + [(form, *one) for form in ("II", "III") for one in DIAGONAL]
WRONG += [("I", {"a": 1, "b": 0}, "above 0"), ("optimal", {"q": 1, "r": 1}, "one of I, II, III, numeric")]


@pytest.mark.parametrize(("form", "entries", "said"), WRONG)
def test_weights_that_are_wrong(form, entries, said):
    says(HEAD + law(form=f'"{form}"', **entries), said)


def test_form_ii_of_a_full_inertia_and_equal_moments_of_one():
    says(FULL + law(form='"II"', q=1, r=1), "form 'II' needs a diagonal inertia")
    turned = HEAD.replace("[2.0, 3.0, 4.0]", str(matrix(2, 3, 3)))
    says(turned + law(form='"III"', q=1, r=[1, 1, 2]), "principal moments 2 and 3 are equal (3 kg m^2)")
    gains = parse(turned + law(form='"III"', q=1, r=[1, 2, 2]), "x").laws[0].gains
    expected = TURN * np.array([1.0, 0.5**0.5, 0.5**0.5]) @ TURN.T
    assert np.abs(np.array(gains.k_attitude) - expected).max() < 1e-15


def test_numbers_at_the_end_of_the_range_are_one_line_or_gains():
    said = set()
    values = ("1e31", "1e30", "1e-30", "1e20", "1e-20")
    forms = {"I": ("a", "b"), "II": ("q", "r"), "III": ("q", "r"), "numeric": ("q", "r")}
    for form, keys in forms.items():
        for first in (*values, "1"):
            for second in values:
                for head in (HEAD,) if form == "II" else (HEAD, FULL):
                    text = head + law(form=f'"{form}"', **dict(zip(keys, (first, second), strict=True)))
                    try:
                        gains = parse(text, "x").laws[0].gains
                    except InputError as error:
                        said.add(str(error))
                    else:
                        assert all(np.isfinite(np.array(gain)).all() for gain in gains)
                        assert np.diagonal(lqr.tensor(gains.k_attitude)).min() > 0.0
    assert any("between 1e-30 and 1e+30 in size" in message for message in said)
    assert not any("\n" in message for message in said)
