"""The rules, and what they read: each accepts what it is about and refuses what comes near it."""

import json
import random
from fractions import Fraction
from itertools import combinations
from unittest.mock import patch

import pytest
from flint import fmpq, fmpq_mat

from starhold.kernel import numbers
from starhold.kernel.check import check
from starhold.kernel.numbers import (
    WORK,
    Account,
    RefusedError,
    cosine_below,
    definite,
    inverse,
    rational,
    scalar,
    surely_definite,
    times,
)  # fmt: skip
from starhold.kernel.polynomials import horner, read_poly, var
from starhold.kernel.programs import Exactly, Program, known
from starhold.kernel.rules import Contracts, Definite, Exceeds, Squares, Vanishes
from starhold.kernel.sentences import above, below
from tests.kernel.certificates import contents, rekeyed, text

x, y = var("x"), var("y")
ONE = Fraction(1)


def refuses(rule, evidence):
    with pytest.raises(RefusedError):
        rule.check(evidence)


def test_numbers_are_read_exactly():
    assert rational("-3/4") == Fraction(-3, 4)
    r = random.Random(0)
    for value in (0.1, -2.5, 5e-324, 1.7e308, *(r.uniform(-1, 1) * 10.0 ** r.randint(-300, 300) for _ in range(200))):
        assert rational(value.hex()) == Fraction(value)
    for wrong in (
        "",
        "1.5",
        "1e3",
        "nan",
        "inf",
        "0x",
        "1/0",
        "1/-2",
        "+1",
        " 1",
        "1_0",
        "١",
        "0x1p+2000",
        "0x1.8p",
        None,
        1,
        0.5,
        True,
        ["1"],
    ):
        with pytest.raises(RefusedError):
            rational(wrong)


def test_definiteness_is_decided_exactly():
    tiny = Fraction(1, 10**40)
    assert definite([[ONE, ONE], [ONE, ONE + tiny]])
    assert not definite([[ONE, ONE], [ONE, ONE]])
    assert definite([[ONE, ONE], [ONE, ONE]], strictly=False)
    assert not definite([[ONE, ONE], [ONE, ONE - tiny]], strictly=False)
    assert not definite([[Fraction(0), ONE], [ONE, Fraction(0)]], strictly=False)
    with pytest.raises(RefusedError, match="not symmetric"):
        definite([[ONE, ONE], [Fraction(0), ONE]])
    a = [[Fraction(2), ONE], [ONE, Fraction(3)]]
    assert times(a, inverse(a)) == scalar(1, 2)


def test_definiteness_is_that_of_the_minors():
    """Against FLINT's determinants, of semidefinite matrices too and of entries with long and unlike denominators."""
    rng, found = random.Random(7), set()
    for _ in range(300):
        count, rank = rng.randint(1, 4), rng.randint(0, 4)
        below = [1, 3, 2 ** rng.randint(0, 60), 10**17 + 3]
        rows = [[Fraction(rng.randint(-3, 3), rng.choice(below)) for _ in range(count)] for _ in range(rank)]
        a = [[sum((row[i] * row[k] for row in rows), Fraction(0)) for k in range(count)] for i in range(count)]
        i, k = rng.randrange(count), rng.randrange(count)
        a[i][k] = a[k][i] = a[i][k] + Fraction(rng.choice([0, 0, -1, 1]), 10 ** rng.randint(0, 9))
        minors = {
            places: fmpq_mat([[fmpq(a[r][c].numerator, a[r][c].denominator) for c in places] for r in places]).det()
            for size in range(1, count + 1)
            for places in combinations(range(count), size)
        }
        told = definite(a), definite(a, strictly=False)
        assert told == (all(minors[tuple(range(n))] > 0 for n in range(1, count + 1)), all(x >= 0 for x in minors.values()))
        found.add(told)
    assert len(found) == 3


def test_factors_with_remainders_are_of_definite_matrices():
    """Matrices near the border, with rows of unlike size: what is factored is definite by elimination, and most that are by
    far are factored."""
    rng, factors, counts = random.Random(11), 0, {True: 0, False: 0}
    for _ in range(600):
        count = rng.randint(1, 7)
        rows = [
            [Fraction(rng.randint(-9, 9), rng.randint(1, 9)) for _ in range(count)] for _ in range(rng.randint(1, count + 1))
        ]
        shift = Fraction(rng.randint(-2, 2), 10 ** rng.randint(0, 24))
        sizes = [Fraction(10) ** rng.randint(-30, 30) for _ in range(count)]
        a = [
            [sizes[i] * sizes[k] * (sum((r[i] * r[k] for r in rows), Fraction(0)) + shift * (i == k)) for k in range(count)]
            for i in range(count)
        ]
        by_factors = surely_definite(a)
        with patch.object(numbers, "surely_definite", lambda a: False):
            by_elimination = numbers.definite(a)
        assert by_elimination or not by_factors
        counts[by_elimination] += 1
        factors += by_factors
    assert counts[False] > 150
    assert 0.8 * counts[True] < factors < counts[True]
    wide = [[Fraction((i == k) + 1, 3) for k in range(119)] for i in range(119)]
    Account.open()
    assert definite(wide)
    assert WORK - Account.left < 2_000_000


def test_cosine_is_from_below():
    import math

    for angle in (0.0, 0.3, 1.0, math.pi / 2, 2.5, 3.0):
        assert math.cos(angle) - 1e-12 <= float(cosine_below(Fraction(angle))) <= math.cos(angle) + 1e-15


def test_identities():
    Vanishes(x * y - y * x).check(None)
    refuses(Vanishes(x * y - y), None)
    circle = x * x + y * y - 1
    Vanishes(x * x * y + y * y * y - y, [circle]).check([{"y": "1"}])
    refuses(Vanishes(x * x * y + y * y * y - y, [circle]), [{"y": "2"}])
    refuses(Vanishes(x * x * y + y * y * y - y, [circle]), [])
    refuses(Vanishes(x - x), [])


def test_squares():
    good = {"multipliers": [], "cofactors": [], "gram": [["1", "0"], ["0", "2"]]}
    Squares(x * x + 2 * y * y, [x, y], 2).check(good)
    refuses(Squares(x * x + 3 * y * y, [x, y], 2), good)
    refuses(Squares(x * x, [x, y], 2), good | {"gram": [["1", "0"], ["0", "0"]]})
    Squares(x * x, [x, y], 0).check(good | {"gram": [["1", "0"], ["0", "0"]]})
    Squares(x * x, [x, y], 1).check(good | {"gram": [["1"]]})
    refuses(Squares(x * x, [x, y], 2), good | {"gram": [["1"]]})
    known = Squares(x, [x], 0, known=[x])
    known.check({"multipliers": ["1"], "cofactors": [], "gram": [["0"]]})
    refuses(Squares(-x, [x], 0, known=[x]), {"multipliers": ["-1"], "cofactors": [], "gram": [["0"]]})
    refuses(Squares(0 * x, [x], 0, strict=[x]), {"multipliers": ["0"], "cofactors": [], "gram": [["0"]]})
    refuses(known, {"multipliers": ["1"], "cofactors": [], "gram": [["0"]], "more": []})


def test_systems_and_steps():
    solved = Vanishes(y, [x + y, x - y])
    solved.check([{"": "1/2"}, {"": "-1/2"}])
    refuses(solved, [{"": "1/2"}, {"": "1/2"}])
    half = [["1", "0"], ["0", "1"]]
    Contracts(scalar(Fraction(1, 2), 2)).check(half)
    refuses(Contracts(scalar(1, 2)), half)
    refuses(Contracts(scalar(Fraction(1, 2), 2), Fraction(1, 2)), half)
    Contracts(scalar(-1, 2), flow=True).check(half)
    refuses(Contracts(scalar(1, 2), flow=True), half)
    Definite(scalar(1)).check(None)
    refuses(Definite(scalar(-1)), None)
    refuses(Definite(scalar(1)), [])
    Exceeds(ONE).check(None)
    refuses(Exceeds(ONE, ONE), None)


def program(steps, inputs=("a", "b"), outputs=(-1,)):
    count = len(inputs) + len(steps)
    return Program.read({"inputs": list(inputs), "steps": steps, "outputs": [k % count for k in outputs]})


def test_programs_are_read_piecewise():
    clip = program([["less", 0, 1], ["select", 2, 0, 1]])
    (cases,) = clip.run({"a": known(x), "b": known(y)}, Exactly(), 1)
    assert {(tuple(case.value.terms), len(case.guards)) for case in cases} == {((("x",),), 1), ((("y",),), 1)}
    below = [["less", 0, 1], ["negative", 0], ["negative", 1], ["less", 3, 4], ["select", 5, 0, 1], ["select", 2, 6, 0]]
    (cases,) = program(below).run({"a": known(x), "b": known(y)}, Exactly(), 1)
    assert [case.value.terms for case in cases] == [x.terms, y.terms]
    root = program([["product", 0, 0], ["sqrt", 1]], inputs=("a",))
    assert root.digest != clip.digest
    with pytest.raises(RefusedError, match="no exact value"):
        root.run({"a": known(x)}, Exactly(), 1)
    with pytest.raises(RefusedError, match="divides by the state"):
        program([["divide", 0, 1]]).run({"a": known(x), "b": known(y)}, Exactly(), 1)
    with pytest.raises(RefusedError, match="outputs"):
        clip.run({"a": known(x), "b": known(y)}, Exactly(), 2)


@pytest.mark.parametrize(
    "steps",
    [[["plus", 0]], [["plus", 0, 2]], [["plus", 0, -1]], [["plus", 0, True]], [["plus", 0, 1.0]], [["root", 0]], [[]],
     [["less", 0, 1]], [["less", 0, 1], ["plus", 0, 2]], [["select", 0, 0, 1]], [["constant"]], [["constant", 1]], ["plus"]],
)  # fmt: skip
def test_malformed_programs_are_refused(steps):
    with pytest.raises(RefusedError):
        program(steps)
    with pytest.raises(RefusedError, match="twice"):
        program([["plus", 0, 1]], inputs=("a", "a"))


def test_what_grows_without_end_is_refused_soon():
    squaring = [["product", 1 + k, 1 + k] for k in range(200)]
    for start in (["plus", 0, 0], ["constant", "3"], ["constant", "1/3"]):
        grown = program([start, *squaring], inputs=("a",))
        with pytest.raises(RefusedError, match="too"):
            grown.run({"a": known(x + y)}, Exactly(), 1)
    folded = [["constant", "0"]]
    for k in range(30):
        at, before = 1 + len(folded), len(folded)
        folded += [["constant", str(k)], ["plus", 0, at], ["negative", at + 1], ["less", at + 1, 1]]
        folded += [["select", at + 3, at + 2, at + 1], ["plus", before, at + 4]]
    with pytest.raises(RefusedError, match="too"):
        program(folded, inputs=("a",)).run({"a": known(x)}, Exactly(), 1)


def test_every_part_of_a_certificate_is_read():
    def changed(change):
        content = contents("three-laws", "sliding")
        change(content, content["claims"][0])
        with pytest.raises(RefusedError):
            check(text(rekeyed(content)))

    changed(lambda content, claim: content.update(more=1))
    changed(lambda content, claim: content.update(format="starhold certificate 2"))
    changed(lambda content, claim: content["programs"].update(more={"inputs": ["a"], "steps": [], "outputs": [0]}))
    changed(lambda content, claim: claim.update(more=1))
    changed(lambda content, claim: claim.update(theorem="anything"))
    changed(lambda content, claim: claim["taken"].append("sunshine"))
    changed(lambda content, claim: claim["subject"].update({"gains.more": "1"}))
    changed(lambda content, claim: claim["numbers"].update({"more": "1"}))
    changed(lambda content, claim: claim["evidence"].update({"more": None}))
    changed(lambda content, claim: claim["programs"].update(more=claim["programs"]["law"]))
    changed(lambda content, claim: claim["programs"].pop("law"))


def test_a_program_under_another_digest_is_refused():
    content = contents("three-laws", "sliding")
    (name, *_) = content["programs"]
    content["programs"][name]["steps"].append(["constant", "0"])
    with pytest.raises(RefusedError, match="digest"):
        check(text(content))
    for stray in (1.5, 10**12):
        with pytest.raises(RefusedError, match="format"):
            check(json.dumps(contents("three-laws", "sliding") | {"format": stray}))
        content = contents("three-laws", "sliding")
        check(json.dumps(content | {"certificates": [stray]}))
        content["claims"][0]["subject"]["gains.boundary_layer"] = stray
        with pytest.raises(RefusedError, match="a number is not written as one"):
            check(json.dumps(content))


def test_polynomials_and_rounding():
    with pytest.raises(RefusedError, match="twice"):
        read_poly({"x y": "1", "y x": "1"})
    p = 3 * x * x * y + 2 * y + x
    assert [part.terms for part in p.powers("x")] == [(2 * y).terms, {(): ONE}, (3 * y).terms]
    assert horner(p.powers("x"), x).terms == p.terms
    third = Fraction(1, 3)
    assert Fraction(below(third)) < third < Fraction(above(third))
    assert below(Fraction(0.01)) == "0.01"
