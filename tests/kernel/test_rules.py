"""The rules, and what they read: each accepts what it is about and refuses what comes near it."""

import json
import random
from fractions import Fraction

import pytest

from starhold.kernel.check import check
from starhold.kernel.intervals import UNIT, Enclosed, Interval
from starhold.kernel.numbers import (
    Account,
    RefusedError,
    cosine_below,
    definite,
    inverse,
    rational,
    scalar,
    times,
)  # fmt: skip
from starhold.kernel.polynomials import Poly, read_poly, var
from starhold.kernel.programs import Enclosing, Exactly, Program, known
from starhold.kernel.rules import Contracts, Definite, Exceeds, Local, OnCells, Solves, Squares, Vanishes
from starhold.kernel.sentences import above, below
from tests.kernel.certificates import contents, rekeyed, text

x, y = var("x"), var("y")
ONE = Fraction(1)


@pytest.fixture(autouse=True)
def account():
    Account.open()


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
    solves = Solves([x + y, x - y], [x, y])
    solves.check({"matrix": [["1/2", "1/2"], ["1/2", "-1/2"]], "cofactors": [[], []]})
    refuses(solves, {"matrix": [["1/2", "1/2"], ["1/2", "1/2"]], "cofactors": [[], []]})
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


def test_cells():
    box = {"x": (-ONE, ONE), "y": (-ONE, ONE)}
    p, sloped = Enclosed(x * x + y * y + Fraction(1, 10)), Enclosed(x + Fraction(1, 2))
    rule = OnCells(box, {"p": lambda cell: p.on(cell).low > 0, "s": lambda cell: sloped.on(cell).low > 0})
    for tree in ("p", "0pp", "0ps", "01pp0pp", "00pp1ps"):
        rule.check(tree)
    for tree in ("", "pp", "0p", "0pps", "2pp", "q", "s", "0sp", 3, None):
        refuses(rule, tree)


def test_local_form():
    box = {"x": (-ONE, ONE), "y": (-ONE, ONE)}
    rule = Local(["x", "y"], x * x + y * y + x * x * x * Fraction(1, 4), box, lambda cell: False)
    gram = [[{"": "1", "x": "1/4"}, {}], [{}, {"": "1"}]]
    rule.check({"gram": gram, "tree": "g"})
    refuses(rule, {"gram": gram, "tree": "p"})
    refuses(rule, {"gram": [[{"": "1"}, {}], [{}, {"": "1"}]], "tree": "g"})
    refuses(
        Local(["x", "y"], x * x - y * y, box, lambda cell: False), {"gram": [[{"": "1"}, {}], [{}, {"": "-1"}]], "tree": "g"}
    )


def test_intervals_hold_what_they_are_about():
    r = random.Random(1)

    def some():
        a, b = sorted(Fraction(r.randint(-(10**6), 10**6), 10**5) for _ in range(2))
        return a + (b - a) * Fraction(r.randint(0, 100), 100), Interval.of(a, b)

    def inside(value, interval):
        return interval.low <= value * UNIT <= interval.high

    for _ in range(300):
        (a, A), (b, B) = some(), some()
        pairs = [(a + b, A + B), (a - b, A - B), (a * b, A * B), (a**2, A.power(2)), (a**3, A.power(3)), (a, A.hull(B))]
        if B.low > 0 or B.high < 0:
            pairs.append((a / b, A / B))
        assert all(inside(value, found) for value, found in pairs)
        root = Interval.of(abs(a)).sqrt()
        assert root.low**2 <= abs(a) * UNIT**2 <= root.high**2


def program(steps, inputs=("a", "b"), outputs=(-1,)):
    count = len(inputs) + len(steps)
    return Program.read({"inputs": list(inputs), "steps": steps, "outputs": [k % count for k in outputs]})


def test_programs_are_read_piecewise_and_over_intervals():
    clip = program([["less", 0, 1], ["select", 2, 0, 1]])
    (cases,) = clip.run({"a": known(x), "b": known(y)}, Exactly(), 1)
    assert {(tuple(case.value.terms), len(case.guards)) for case in cases} == {((("x",),), 1), ((("y",),), 1)}
    (found,) = clip.run({"a": Interval.of(-ONE, ONE), "b": Interval.of(ONE)}, Enclosing(), 1)
    assert found == Interval.of(-ONE, ONE)
    root = program([["product", 0, 0], ["sqrt", 1]], inputs=("a",))
    (found,) = root.run({"a": Interval.of(-ONE, ONE)}, Enclosing(), 1)
    assert found.low == 0
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
    Account.open()
    with pytest.raises(RefusedError, match="too"):
        program([["constant", "3"], *squaring], inputs=("a",)).run({"a": Interval.of(ONE)}, Enclosing(), 1)
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
    p = read_poly({"x x": "1", "y": "-1/2"})
    assert p.slope("x").terms == (2 * x).terms
    assert p.at({"x": y, "y": 2}).terms == (y * y - 1).terms
    with pytest.raises(RefusedError, match="twice"):
        read_poly({"x y": "1", "y x": "1"})
    with pytest.raises(RefusedError, match="multiple"):
        Poly({("x",): ONE, (): ONE}).over("x")
    third = Fraction(1, 3)
    assert Fraction(below(third)) < third < Fraction(above(third))
    assert below(Fraction(0.01)) == "0.01"
