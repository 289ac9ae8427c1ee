"""The elementary functions keep the errors that they state, at their ends too, and mean the same to every reader."""

import math
import re
from fractions import Fraction

import mpmath
import numpy as np
import pytest
import sympy

from starhold.algebra.dual import BorderError, Dual, differentiate
from starhold.algebra.elementary import FASTEST, atan2, cbrt, cos, exp, log, power, sin, tanh
from starhold.algebra.polynomial import Polynomial
from starhold.algebra.structured import repeat
from starhold.trace.program import Memory
from tests.algebra.readers import agree, bits
from tests.tiers import fewer
from tests.trace.machines import MACHINES, Job, Subject, need, on_lanes
from tests.trace.machines import agree as agree_with

FUNCTIONS = {exp: 1, log: 1, tanh: 1, cbrt: 1, sin: 1, cos: 1, atan2: 2, power: 2}
EXACT = {cbrt: lambda x: mpmath.sign(x) * mpmath.cbrt(abs(x))}
LONG = {atan2: np.arctan2, power: np.power}
EDGES = (0.0, -0.0, 5e-324, -5e-324, 2.2e-308, 1e308, -1e308, math.inf, -math.inf, math.nan, 0.5, -0.5, 1.0, -1.0, 3.0, 1e5)
RANDOM = np.random.default_rng(31)
COUNT = fewer(1_000_000)


def over(function, count):
    """The function of each row of its arguments, as a subject."""
    width = FUNCTIONS[function]

    def equation(given, out, *_):
        def turn(k):
            out[k] = function(*(given[width * k + i] for i in range(width)))

        repeat(count, turn)

    return Subject(equation, (Memory("given", False, False, width * count), Memory("out", True, True, count)), {})


def compiled(function, *columns):
    """The function of columns."""
    subject = over(function, len(columns[0]))
    given = {"given": np.stack(columns, 1).ravel(), "out": np.zeros(len(columns[0]))}
    return on_lanes(Job(subject.program(), given, {}))["out"]


def stated(function):
    """The error that its docstring states, in units in the last place."""
    return float(re.search(r"to ([\d.]+) units?", function.__doc__)[1])


def sizes(low, high, signs=(1.0, -1.0)):
    """Numbers of all sizes between powers of two."""
    return np.exp2(RANDOM.uniform(low, high, COUNT)) * RANDOM.choice(signs, COUNT)


def points(function):
    """Columns of arguments over its range, the denser where it is hard."""
    near_one = 1.0 + sizes(-52, -3)
    multiples = np.round(np.exp2(RANDOM.uniform(0, 29, COUNT))) * (np.pi / 2)
    return {
        exp: [(RANDOM.uniform(-745, 709.7, COUNT),), (sizes(-60, 3),)],
        log: [(sizes(-1074, 1023.9, (1.0,)),), (near_one,)],
        tanh: [(sizes(-1074, 5),), (RANDOM.uniform(-2, 2, COUNT),)],
        cbrt: [(sizes(-1074, 1023.9),), (RANDOM.uniform(0.4, 5, COUNT),)],
        sin: [(sizes(-1074, 30),), (multiples,), (RANDOM.uniform(-10, 10, COUNT),)],
        cos: [(sizes(-60, 30),), (multiples,), (RANDOM.uniform(-10, 10, COUNT),)],
        atan2: [(sizes(-1074, 1023.9), sizes(-1074, 1023.9)), (sizes(-3, 3), sizes(-3, 3))],
        power: [
            (sizes(-1074, 1023.9, (1.0,)), RANDOM.uniform(-1, 1, COUNT)),
            (sizes(-20, 20, (1.0,)), RANDOM.uniform(-30, 30, COUNT)),
            (near_one, sizes(0, 40)),
        ],
    }[function]


@pytest.mark.parametrize("function", FUNCTIONS, ids=lambda f: f.__name__)
def test_errors_against_longer_floats(function):
    if np.finfo(np.longdouble).nmant < 63:
        pytest.skip("no longer floats on this machine")
    for columns in points(function):
        found = compiled(function, *columns)
        with np.errstate(over="ignore", under="ignore"):
            exact = LONG.get(function, getattr(np, function.__name__, None))(*(x.astype(np.longdouble) for x in columns))
            near = exact.astype(float)
        kept = np.isfinite(near)
        assert np.array_equal(found[~kept], near[~kept])
        error = np.abs(found[kept].astype(np.longdouble) - exact[kept]) / np.spacing(np.abs(near[kept]))
        # Longer floats are off by a thousandth of a unit themselves.
        assert error.max() <= stated(function) + 0.01, (function, [x[kept][error.argmax()].hex() for x in columns])


@pytest.mark.parametrize("function", FUNCTIONS, ids=lambda f: f.__name__)
def test_errors_against_mpmath(function):
    given = [x for columns in points(function) for x in zip(*(column[:60].tolist() for column in columns), strict=True)]
    if function in (sin, cos):
        given += [(sign * x,) for x in closest() for sign in (1.0, -1.0)]
    with mpmath.workdps(60):
        for arguments in given:
            exact = EXACT.get(function, getattr(mpmath, function.__name__))(*map(mpmath.mpf, arguments))
            found = function(*arguments)
            if math.isfinite(found) and abs(exact) < 2**1023:
                assert abs(found - exact) <= stated(function) * math.ulp(float(exact)), (function, arguments)


def closest():
    """Floats that lie closest to whole multiples of a quarter turn: the best fractions of pi/2 over a power of two."""
    with mpmath.workdps(60):
        quarter = Fraction(int(mpmath.pi * 2**150), 2**151)
    best = [(n, (quarter * 2**n).limit_denominator(10**most).numerator) for n in range(24, 53) for most in range(1, 9)]
    return [math.ldexp(whole, -n) for n, whole in best if whole < 2**53 and math.ldexp(whole, -n) < FASTEST]


@pytest.mark.parametrize("machine", MACHINES)
def test_every_machine_gives_their_bits_at_every_edge(machine):
    need(machine)
    cases = []
    for function, width in FUNCTIONS.items():
        given = np.array(np.meshgrid(*[EDGES] * width)).reshape(width, -1).T
        subject = over(function, len(given))
        held = {"given": given.ravel(), "out": np.zeros((len(given), 16))}
        cases.append((subject, held, {}))
    agree_with(machine, *cases)


@pytest.mark.parametrize("function", [atan2, cbrt, exp, tanh, sin, cos], ids=lambda f: f.__name__)
def test_edges_are_those_of_c(function):
    for arguments in np.array(np.meshgrid(*[EDGES] * FUNCTIONS[function])).reshape(FUNCTIONS[function], -1).T.tolist():
        found = function(*arguments)
        if function in (sin, cos) and not abs(arguments[0]) <= FASTEST:
            assert math.isnan(found)
            continue
        with np.errstate(all="ignore"):
            libm = float(LONG.get(function, getattr(np, function.__name__, None))(*arguments))
        assert math.isnan(found) == math.isnan(libm)
        assert math.isnan(found) or (found == pytest.approx(libm, rel=1e-15, abs=5e-324)), (function, arguments)
        assert math.isnan(found) or math.copysign(1.0, found) == math.copysign(1.0, libm), (function, arguments)


def test_edges_of_logarithms_and_powers():
    assert [log(x) for x in (0.0, -0.0, math.inf, 1.0)] == [-math.inf, -math.inf, math.inf, 0.0]
    assert all(math.isnan(x) for x in (log(-1.0), power(-8.0, 2.0), power(math.nan, 2.0), power(0.0, math.nan)))
    assert bits(power(-0.0, 0.5)) == bits(0.0)
    for x in (x for x in EDGES if x >= 0.0):
        for p in (x for x in EDGES if x == x):
            with np.errstate(all="ignore"):
                assert power(x, p) == pytest.approx(float(np.power(abs(x), p)), rel=1e-15, abs=5e-324), (x, p)


@pytest.mark.parametrize("function", FUNCTIONS, ids=lambda f: f.__name__)
def test_every_reader_gives_the_same(function):
    for arguments in ((0.3, 1.7), (2.5, 0.4), (7.0, 3.0), (1e-3, 2.0)):
        agree(function, *arguments[: FUNCTIONS[function]])
    symbols = sympy.symbols("x y", positive=True)[: FUNCTIONS[function]]
    assert function(*symbols).subs(dict(zip(symbols, (0.3, 1.7), strict=False))) == pytest.approx(
        function(*(0.3, 1.7)[: len(symbols)])
    )
    assert function(*symbols).free_symbols == {*symbols}
    with pytest.raises(TypeError, match=f"a call of {function.__name__}: a polynomial has no {function.__name__}"):
        function(*map(Polynomial.variable, "xy"[: len(symbols)]))


@pytest.mark.parametrize("function", FUNCTIONS, ids=lambda f: f.__name__)
def test_slopes_are_those_of_mpmath(function):
    width = FUNCTIONS[function]
    for arguments in ((0.3, 1.7), (2.5, 0.4)):
        given = [Dual(x, np.eye(1, width, k)[0]) for k, x in enumerate(arguments[:width])]
        (slopes,) = differentiate(lambda given=given: (function(*given),), width)
        orders = np.eye(width, dtype=int).tolist()
        exact = getattr(mpmath, function.__name__)
        assert slopes == pytest.approx([float(mpmath.diff(exact, arguments[:width], tuple(n))) for n in orders], rel=1e-12)


def test_a_root_has_no_slope_at_zero():
    with pytest.raises(BorderError):
        differentiate(lambda: (cbrt(Dual(0.0, np.array([1.0]))),), 1)


def test_known_values():
    assert [cbrt(x) for x in (27.0, -8.0, 1e-300)] == [3.0, -2.0, 1e-100]
    assert (exp(0.0), power(2.0, 10.0), power(9.0, 0.5), tanh(50.0), tanh(-math.inf)) == (1.0, 1024.0, 3.0, 1.0, -1.0)
