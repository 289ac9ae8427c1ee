"""Expressions and files of invariant sets: what is read means what Python means, and all else is refused in one line."""

import re
from fractions import Fraction
from pathlib import Path

import pytest
from flint import fmpq
from hypothesis import given
from hypothesis import strategies as st

from starhold.algebra.polynomial import Polynomial, exact, pieces
from starhold.certification.invariant import load, parse
from starhold.certification.invariant.text import ExpressionError, as_written, read
from starhold.certification.invariant.theorems import program
from starhold.errors import InputError
from starhold.kernel.numbers import Account
from starhold.kernel.polynomials import Poly, var
from starhold.kernel.programs import Exactly, Program, known
from tests.certification.invariants import ORIGIN, file
from tests.refusals import refused

NAMES = {name: Polynomial.variable(name) for name in "xy"}


def sat(x, limit=1):
    return min(max(x, -limit), limit)


def sign(x):
    return (x > 0) - (x < 0)


PYTHON = {"min": min, "max": max, "abs": abs, "sat": sat, "clip": sat, "sign": sign, "where": lambda c, a, b: a if c else b}
atoms = st.sampled_from(["x", "y", "1", "2", "0.5", "3e-1", "7"])


def grown(inner):
    two = st.tuples(inner, inner)
    return st.one_of(
        st.builds("({} {} {})".format, inner, st.sampled_from("+-*"), inner),
        st.builds("(-{})".format, inner),
        st.builds("({}) / 4".format, inner),
        st.builds("({})**2".format, inner),
        two.map(lambda t: f"max({t[0]}, {t[1]})"),
        inner.map(lambda t: f"sat({t})"),
        inner.map(lambda t: f"abs({t})"),
        st.builds("({} if {} {} {} else {})".format, inner, inner, st.sampled_from(["<", "<=", ">", ">="]), inner, inner),
    )


expressions = st.recursive(atoms, grown, max_leaves=5)
numbers = st.integers(-12, 12).map(lambda n: Fraction(n, 4))


def exactly(text, x, y):
    """The value by Python's own rules, in fractions."""
    for written in ("0.5", "3e-1"):
        text = text.replace(written, f"Fraction('{written}')")
    return eval(text, {"Fraction": Fraction, **PYTHON}, {"x": x, "y": y})


@given(expressions, numbers, numbers)
def test_expressions_mean_what_python_means(text, x, y):
    try:
        value = read(text, NAMES)
    except ExpressionError:
        # Too large; what is said of that is tested below.
        return
    at = {"x": exact(x), "y": exact(y)}
    found = [
        case.value.at(at)
        for case in pieces(value)
        if all((condition.positive.at(at) > 0) == truth for condition, truth in case.truths)
    ]
    assert len(found) == 1
    assert found[0] == exact(exactly(text, x, y))


@given(expressions, numbers, numbers)
def test_programs_are_what_expressions_are(text, x, y):
    """The kernel's reading of a recorded expression is its value, in one case at least, and no case says another."""
    try:
        value = read(text, NAMES)
    except ExpressionError:
        return
    recorded = Program.read(program([value], ["x", "y"]))
    Account.open()
    (cases,) = recorded.run({name: known(var(name)) for name in "xy"}, Exactly(), 1)
    at = {"x": x, "y": y}
    found = {
        case.value.at(at).number
        for case in cases
        if all((Poly(dict(p)).at(at).number > 0) == truth for p, truth in case.guards)
    }
    assert found == {Fraction(exactly(text, x, y))}


def test_conditions_may_be_joined():
    value = read("1 if 0 < x < 1 and not y > 0 or x > 5 else 0", NAMES)
    for x, y, wanted in ((0.5, -1, 1), (0.5, 1, 0), (2, -1, 0), (6, 1, 1), (-1, -1, 0)):
        at = {"x": exact(x), "y": exact(y)}
        found = {c.value.at(at) for c in pieces(value) if all((k.positive.at(at) > 0) == t for k, t in c.truths)}
        assert found == {fmpq(wanted)}


@pytest.mark.parametrize(
    ("text", "found", "allowed"),
    [
        ("__import__('os')", "function", "one of where"),
        ("x.real", '"x.real"', "numbers, variables"),
        ("(lambda: 1)()", "lambda", "numbers"),
        ("[x for x in y]", "for", "numbers"),
        ("tan(x)", 'function "tan"', "one of where"),
        ("sin(2*x)", 'sin of "2*x"', "sin of a variable"),
        ("cos(w)", 'cos of "w"', "cos of a variable"),
        ("sin(x, y)", 'function "sin"', "one of where"),
        ("z + 1", 'name "z"', "one of x, y"),
        ("1/x", 'division by "x"', "a number"),
        ("x/0", "division", "a number"),
        ("x ^ 2", '"x ^ 2"', "** for powers"),
        ("x**y", "power", "whole number"),
        ("x**-1", "power", "whole number"),
        ("x**0.5", "power", "whole number"),
        ("x**99", "power", "whole number"),
        ("x == y", '"x == y"', "numbers"),
        ("1 if x == y else 0", '"x == y"', "< <= > >="),
        ("1 if x else 0", '"x"', "a comparison"),
        ("x +", "invalid syntax", "an expression"),
        ("", "invalid syntax", "an expression"),
        ("True", '"True"', "numbers"),
        ("'x'", "'x'", "numbers"),
        ("1j", '"1j"', "numbers"),
        ("sat(x, 1, 2)", "sat with 3", "1 to 2"),
        ("max(x)", "max with 1", "2 to 8"),
        ("max(x, key=y)", "max", "numbers"),
        ("((x+y+1)**24)**2", "too large", "degree"),
        ("+".join(["x"] * 11_000), "characters", "at most"),
        ("(" * 400 + "x" + ")" * 400, "", "an expression"),
        ("-" * 1900 + "x", "", "a less deeply nested expression"),
        ("abs(x+abs(y+abs(x+abs(y+abs(x+abs(y+abs(x-y)))))))", "", ""),
        ("(((1e9999**24)**24)**24)**24", "1e9999", "a power of ten"),
        ("(((1e999**24)**24)**24)**24", "a number that is too long", "1000 digits"),
        ("(x/1e-300)**24", "a number that is too long", "1000 digits"),
        ("max(" + ", ".join(f"abs(x + {k}*y)" for k in range(8)) + ")", "pieces", "at most 64"),
        ("1 if " + " and ".join(f"abs(x + {k}*y) < abs(y)" for k in range(40)) + " else 0", "pieces", "at most 64"),
        ("+".join(f"(x+y+{k})**12*(x-y+x*y+{k})**12" for k in range(40)), "too large", ""),
        ("x\0y", "", "an expression"),
    ],
)
def test_what_is_not_allowed_is_said(text, found, allowed):
    with pytest.raises(ExpressionError) as said:
        read(text, NAMES)
    assert found in str(said.value)
    assert allowed in str(said.value)
    assert "\n" not in str(said.value)


SIX = [" + ".join(f"abs(x - {k + 6 * j}*y)" for k in range(6)) for j in range(2)]
PARAMETERS = "[parameters]\n" + "".join(f"p{k} = [0, 1]\n" for k in range(8))
GOOD = file(name="small", half=1)


def test_a_small_file_is_read():
    problem = parse(GOOD, "small.toml")
    assert problem.name == "small"
    assert problem.claims[0].equilibrium == (0, 0)


@pytest.mark.parametrize(
    ("old", "new", "key", "said"),
    [
        ('x = "-x"', 'x = "-z"', "rates.x", 'found the name "z"; allowed: one of x, y'),
        ('x = "-x"\n', "", "rates.x", "this key is required"),
        ('x = "-x"', "x = true", "rates.x", "found True; allowed: an expression in quotes"),
        ('y = "-y"', 'y = "-y"\nz = "1"', "rates.z", "an unknown key"),
        ("x = [-1, 1]", "x = [1, -1]", "box.x", "two numbers [low, high]"),
        ("x = [-1, 1]", "x = [-inf, 1]", "box.x", "two numbers [low, high]"),
        ("x = [-1, 1]", "x = 1", "box.x", "two numbers [low, high]"),
        ('"region"', '"regoin"', "claim[1].theorem", "did you mean region?"),
        ('V = "x**2 + y**2"', 'V = "x**2 + w"', "claim[1].V", 'found the name "w"'),
        ('V = "x**2 + y**2"\n', "", "claim[1].V", "this key is required"),
        ("equilibrium = { x = 0, y = 0 }", "rest = { x = 0, y = 0 }", "claim[1].rest", "the key is named equilibrium"),
        ("equilibrium = { x = 0, y = 0 }", "equilibrium = { x = 0 }", "claim[1].equilibrium.y", "this key is required"),
        ("equilibrium = { x = 0, y = 0 }", 'equilibrium = { x = 0, y = "1/0" }', "claim[1].equilibrium.y", "a fraction"),
        ("equilibrium = { x = 0, y = 0 }", "level = -1", "claim[1].level", "a positive number"),
        ("equilibrium = { x = 0, y = 0 }", "escapes = 1", "claim[1].escapes", "did you mean escape?"),
        ("equilibrium = { x = 0, y = 0 }", 'escape = "abs(x)"', "claim[1].escape", "one polynomial"),
        ('["x", "y"]', '["x", "max"]', "variables", "a name of letters"),
        ('["x", "y"]', '["x", "x"]', "variables", "a name that is not taken"),
        ('["x", "y"]', "[]", "variables", "a list of 1 to 7 names"),
        ('["x", "y"]', '["a","b","c","d","e","f","g","h"]', "variables", "at most 7"),
        ("[rates]", PARAMETERS + "[rates]", "variables", "10 with parameters"),
        ('name = "small"', 'nane = "small"', "nane", "did you mean name?"),
        ('name = "small"', 'name = "../up"', "name", "letters, digits"),
        ("[rates]", "[rates", "", "not TOML"),
        ('"region"', '"intersection"', "claim[1].V", "a list of expressions"),
        ('y = "-y"', 'y = "-y - abs(x-2*y)*abs(x-3*y)*abs(x-y)*sign(x)*sign(y)"', "rates.y", "72 pieces"),
        ('x = "-x"\ny = "-y"', f'x = "{SIX[0]}"\ny = "{SIX[1]}"', "claim[1].V", "4096 cells"),
        ("x = [-1, 1]", "x = [-1e200, 1]", "box.x", "within 1e+100"),
        ("x = [-1, 1]", "x = [-1, 0x" + "f" * 5000 + "]", "box.x", "within 1e+100"),
        ('x = "-x"', "x = 0x" + "f" * 5000, "rates.x", "1000 digits"),
        ('x = "-x"', "x = " + "9" * 5000, "", "not TOML"),
        ('V = "x**2 + y**2"', "V = " + "[" * 400 + "]" * 400, "", "claim[1].V"),
        ("equilibrium = { x = 0, y = 0 }", "level = 1e300", "claim[1].level", "at most 1e+100"),
        ("equilibrium = { x = 0, y = 0 }", f'name = "{"n" * 300}"', "claim[1].name", "at most 100 characters"),
        ('name = "small"', f'name = "{"n" * 300}"', "name", "at most 100 characters"),
    ],
)
def test_what_is_wrong_with_a_file_is_one_line(old, new, key, said):
    assert old in GOOD
    with refused(said, start=f"small.toml: {key}"):
        parse(GOOD.replace(old, new, 1), "small.toml")


@pytest.mark.parametrize(
    ("theorem", "more", "key", "said"),
    [
        ("unstable", ORIGIN, "theorem", "another theorem"),
        ("avoids", 'start = ["x"]\nunsafe = ["y"]', "theorem", "another theorem"),
        ("region", "", "equilibrium", "an equilibrium, as the system has sin or cos"),
        ("region", f'core = "x**2"\n{ORIGIN}', "core", "V alone"),
        ("region", "equilibrium = { x = 1, y = 0 }", "equilibrium.x", "found an angle"),
    ],
)
def test_what_is_not_said_of_angles_is_one_line(theorem, more, key, said):
    with refused(said, start=f"a.toml: claim[1].{key}"):
        parse(file("y", "-sin(x) - y", '"1 - cos(x) + y**2"', theorem, more), "a.toml")


SETS = 'start = ["1 - x**2", "1 - y**2"]\nunsafe = ["x + y - 3"]'


@pytest.mark.parametrize(
    ("theorem", "more", "key", "said"),
    [
        ("avoids", 'start = ["1 - x**2"]', "unsafe", "this key is required"),
        ("avoids", SETS.replace("1 - y**2", "x - 1.5"), "start", "found a set without a state"),
        ("avoids", SETS.replace('["x + y - 3"]', "[]"), "unsafe", "found a set without a state"),
        ("avoids", SETS.replace("x + y - 3", "-1 - x**2"), "unsafe", "found a set without a state"),
        ("avoids", SETS.replace("x + y - 3", "abs(x) - 1"), "unsafe[1]", "one polynomial"),
        ("avoids", f"{SETS}\n{ORIGIN}", "equilibrium", "alone"),
        ("region", f"{SETS}\n{ORIGIN}", "unsafe", "theorem avoids"),
        ("stable", f'start = ["1 - x**2"]\n{ORIGIN}', "start", "theorem avoids, attracts, region"),
        ("region", f'start = ["1 - x**2"]\n{ORIGIN}', "level", "a level of V that the start set is shown to be below"),
        ("region", f'start = ["-1 - x**2"]\nlevel = 1\n{ORIGIN}', "start", "found a set without a state"),
        ("stable", f'core = "x**2"\n{ORIGIN}', "core", "theorem attracts or region"),
    ],
)
def test_sets_of_a_barrier_are_told_and_not_empty(theorem, more, key, said):
    assert len(parse(file(theorem="avoids", more=SETS), "b.toml").claims[0].start) == 2
    with refused(said, start=f"b.toml: claim[1].{key}"):
        parse(file(theorem=theorem, more=more), "b.toml")


def test_angles_are_the_variables_whose_sine_or_cosine_occurs():
    assert parse(file("y", "-sin(x) - y"), "a.toml").system.angles == ("x",)
    assert parse(file("y", "-x - y", V='"2*(1 - cos(y)) + x**2"'), "a.toml").system.angles == ("y",)
    assert parse(file("y", "-x - y"), "a.toml").system.angles == ()


def test_missing_files_name_the_nearest(tmp_path):
    with pytest.raises(InputError, match="did you mean van-der-pol"):
        load("van-der-pole")
    with pytest.raises(InputError, match=r"claim: found \[\]; allowed: at least one"):
        parse("claim = []\n" + GOOD.partition("[[claim]]")[0], "x")
    binary = tmp_path / "b.toml"
    binary.write_bytes(b"\xff\xfe")
    with pytest.raises(InputError, match="cannot be read"):
        load(binary)


def test_examples_of_the_documents():
    page = (Path(__file__).parents[2] / "docs" / "invariant-sets.md").read_text(encoding="utf-8")
    (toml,), (python,) = (re.findall(rf"```{kind}\n(.*?)```", page, flags=re.DOTALL) for kind in ("toml", "python"))
    assert parse(toml, "docs").system.parameters == ("k",)
    exec(compile(python, "docs", "exec"), {})


@pytest.mark.parametrize("text", ["1e-999999999", "2.5E+1000000", "1e9999"])
def test_a_number_that_would_fill_the_memory_is_refused(text):
    with pytest.raises(ExpressionError, match="a power of ten"):
        as_written(text)


def test_numbers_and_fractions_alone():
    assert as_written("0.1") == Fraction(1, 10)
    assert as_written("1e-3") == Fraction(1, 1000)
    assert as_written("-2/6") == Fraction(-1, 3)
