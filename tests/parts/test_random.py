"""Counter-based random numbers: published answers, compiled code bit for bit, stated errors, the right distribution."""

import itertools
import math
import struct

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import kstest, norm

from starhold.algebra.words import bits_of, with_bits
from starhold.parts.random import (
    Dice,
    Silent,
    _joined,
    _reduced,
    cosine_and_sine,
    normals,
    threefry,
    to_angle,
    to_unit,
    transform,
)
from starhold.trace.calling import Compiled
from starhold.trace.program import Call, Op
from starhold.trace.rows import RowRecorder

ONES = 2**64 - 1
FRACTION = 2**52 - 1
words = st.integers(0, ONES)
fractions = st.one_of(
    st.integers(0, FRACTION), st.integers(0, 51).map(lambda e: 2**e), st.integers(0, 51).map(lambda e: FRACTION - 2**e)
)
telling = st.builds(lambda top, fraction: top << 52 | fraction, st.integers(0, 2**12 - 1), fractions)
"""Words whose uniform number is often next to 0, 1 or the middle."""

KNOWN = [
    # Counter, key, answer: the known answers published with the generator, Threefry-2x64 with 20 rounds.
    ((0, 0), (0, 0), (0xC2B6E3A8C2C69865, 0x6F81ED42F350084D)),
    ((ONES, ONES), (ONES, ONES), (0xE02CB7C4D95D277A, 0xD06633D0893B8B68)),
    (
        (0x243F6A8885A308D3, 0x13198A2E03707344),
        (0xA4093822299F31D0, 0x082EFA98EC4E6C89),
        (0x263C7D30BB0F0AF1, 0x56BE8361D3311526),
    ),
]


def on_bits(function):
    """The function of words as one of the doubles with the same bits, which compiled code is called with."""

    def equation(*doubles):
        return function(*(bits_of(x) for x in doubles))

    return equation


def doubles(*columns):
    """Columns of words as columns of doubles with the same bits."""
    return np.array([np.array([w & ONES for w in column], dtype=np.uint64) for column in columns]).view(np.float64)


def same_bits(found, wanted):
    return [struct.pack("<d", x) for x in found] == [struct.pack("<d", x) for x in wanted]


def shown(function):
    """The words that a function of words gives, as the doubles with their bits."""
    return lambda *given: tuple(with_bits(w) for w in function(*given))


def squared_radius(x):
    return _joined(*_reduced(x))


FOUR, TWO = (0.0,) * 4, (0.0,) * 2
THREEFRY = Compiled(on_bits(shown(lambda k0, k1, c0, c1: threefry((k0, k1), (c0, c1))[0])), *FOUR)
UNIFORM = Compiled(on_bits(lambda word: (to_unit(word), to_angle(word))), 0.0)
TRANSFORM = Compiled(on_bits(transform), *TWO)
NINE = Compiled(on_bits(lambda seed, run, step: normals((seed, run), step, 0, 9)), *(0.0,) * 3)
SQUARED_RADIUS, COSINE_AND_SINE = Compiled(squared_radius, 1.0), Compiled(cosine_and_sine, 1.0)


def fast_threefry(key, counter):
    """The compiled generator on one lane, on words."""
    return tuple(bits_of(x) for x in THREEFRY(*(with_bits(w & ONES) for w in (*key, *counter))))


@pytest.mark.parametrize(("counter", "key", "answer"), KNOWN)
def test_known_answers(counter, key, answer):
    assert threefry(key, counter) == (answer,)
    assert fast_threefry(key, counter) == answer
    on_lanes = THREEFRY.over(doubles(*([w] * 9 for w in (*key, *counter)))).view(np.uint64)
    assert [tuple(map(int, lane)) for lane in on_lanes.T] == [answer] * 9


@given(*[st.integers(-(2**70), 2**70)] * 4)
def test_any_integer_stands_for_a_word_in_compiled_code_too(k0, k1, c0, c1):
    (found,) = threefry((k0, k1), (c0, c1))
    assert (found,) == threefry((k0 & ONES, k1 & ONES), (c0 & ONES, c1 & ONES))
    assert found == fast_threefry((k0, k1), (c0, c1))
    assert all(0 <= word <= ONES for word in found)


@pytest.mark.parametrize("seed", [-1, 2**63, -(2**63), 2**200 + 7, 1 - 2**64])
def test_a_seed_that_is_no_word_may_be_a_constant_of_compiled_code(seed):
    def constant(key):
        return Compiled(lambda step: normals(key, bits_of(step), 0, 2), 0.0)

    found, wanted = constant((seed, -seed)), constant((seed & ONES, -seed & ONES))
    # Languages write constants of 64 bits only: it is the remainder that is recorded.
    assert found.program == wanted.program
    assert same_bits(found(with_bits(5)), normals((seed, -seed), 5, 0, 2))


@given(words | telling | st.sampled_from((0, ONES, FRACTION, 2**52, 2**51, 2**51 - 1)))
def test_uniform_numbers_are_exact(word):
    k = word & FRACTION
    unit, angle = to_unit(word), to_angle(word)
    assert unit.as_integer_ratio() == ((2 * k + 1), 2**53)
    assert 0.0 < unit < 1.0
    assert angle == math.ldexp(k - 2**51, -52)
    assert -0.5 <= angle < 0.5
    # Symmetric: the complement of the bits is the complement of the number.
    assert to_unit(word ^ ONES) == 1.0 - unit
    assert same_bits(UNIFORM(with_bits(word)), (unit, angle))


def relative(found, exact):
    return float(abs((mpmath.mpf(found) - exact) / exact))


ROOT = math.sqrt(0.5)
EDGES = [x * 2.0**-e for e in range(54) for x in (1.0, ROOT)]
NEAR = [x for edge in EDGES for x in (math.nextafter(edge, 0.0), edge, math.nextafter(edge, 2.0)) if 2.0**-53 <= x < 1.0]


def test_squared_radius_has_its_stated_error_at_the_edges_of_its_pieces_too():
    # The largest error is that of the polynomial: where the fraction comes to the square root of 1/2, and x to 1.
    worst = 0.0
    for x in NEAR + np.linspace(ROOT, 1.0, 400)[:-1].tolist():
        with mpmath.workdps(40):
            worst = max(worst, relative(squared_radius(x), -2 * mpmath.log(mpmath.mpf(x))))
        assert same_bits([SQUARED_RADIUS(x)], [squared_radius(x)])
    assert 2.5e-14 < worst < 2.8e-14
    assert squared_radius(1.0) == 0.0


def check_cosine_and_sine(x):
    c, s = cosine_and_sine(x)
    with mpmath.workdps(40):
        angle = mpmath.mpf(x) * mpmath.pi / 2
        assert relative(c, mpmath.cos(angle)) < 6.7e-14
        assert s == 0.0 if x == 0.0 else relative(s, mpmath.sin(angle)) < 5e-15
    assert same_bits(COSINE_AND_SINE(x), (c, s))


def test_cosine_and_sine_over_their_range():
    # The smallest angle on the grid is 2^-52; what underflows is not met.
    for x in (*(k / 512 for k in range(257)), math.nextafter(0.5, 0.0), *(2.0**-e for e in range(10, 53, 6))):
        check_cosine_and_sine(x)
        check_cosine_and_sine(-x)


def exact_transform(a, b):
    """The transform of Box and Muller of the numbers that two words stand for, and the largest part that either can be."""
    with mpmath.workdps(40):
        unit = (mpmath.mpf(a & FRACTION) + mpmath.mpf(1) / 2) / 2**52
        angle = (mpmath.mpf(b & FRACTION) / 2**52 - mpmath.mpf(1) / 2) * mpmath.pi / 2
        radius = mpmath.sqrt(-2 * mpmath.log(unit)) * (-1 if a >> 63 else 1)
        pair = radius * mpmath.cos(angle), radius * mpmath.sin(angle)
    return pair[::-1] if b >> 63 else pair


def check_transform(a, b):
    pair = transform(a, b)
    for found, exact in zip(pair, exact_transform(a, b), strict=True):
        assert found == 0.0 if exact == 0 else relative(found, exact) < 8.1e-14
    assert same_bits(TRANSFORM(with_bits(a), with_bits(b)), pair)


@settings(max_examples=200)
@given(words | telling, words | telling)
def test_transform(a, b):
    check_transform(a, b)
    # Bits 52 to 62 of either word do not matter.
    assert transform(a, b) == transform(a | 0x7FF << 52, b | 0x7FF << 52)


# Smallest and largest uniform number, both sides of the middle, each with both choices of a bit of the quarter.
EXTREMES = [top | k for top in (0, 1 << 63) for k in (0, 1, 2**51 - 1, 2**51, 2**51 + 1, FRACTION - 1, FRACTION)]


@pytest.mark.parametrize("a", EXTREMES)
def test_transform_at_the_extremes_and_the_edges_of_all_quarters(a):
    for b in EXTREMES:
        check_transform(a, b)


COUNT = 20000


def nine(seed, run):
    """The nine Gaussians of each of many steps, (9, steps)."""
    return NINE.over(doubles([seed] * COUNT, [run] * COUNT, range(COUNT)))


SAMPLE = nine(1, 0)


def test_numbers_of_an_array_are_those_of_plain_python():
    for step in (0, 1, 2, 7, 8, 9, 999, COUNT - 1):
        assert same_bits(SAMPLE[:, step], normals((1, 0), step, 0, 9))


def test_a_number_does_not_depend_on_what_else_is_drawn():
    for first, count in itertools.product(range(7), repeat=2):
        assert normals((1, 2), 3, first, count) == normals((1, 2), 3, 0, 20)[first : first + count]


def test_a_number_is_one_of_the_two_of_its_call():
    for number in range(10):
        assert normals((4, 5), 6, number, 1) == transform(*threefry((4, 5), (6, number // 2))[0])[number % 2 :][:1]


def test_deviation_scales():
    dice = Dice((1, 2), 3, 4)
    whole = dice.vector(2, 1.0)
    assert whole == normals((1, 2), 3, 6, 3)
    assert dice.vector(2, 0.3) == tuple(0.3 * x for x in whole)
    assert dice.vector(2, 0.0) == (0.0, 0.0, 0.0)


def test_vectors_together_are_those_one_by_one():
    dice = Dice((1, 2), 3, 4)
    assert dice.vectors(1, 0.5, 2.0, 3.0) == (dice.vector(1, 0.5), dice.vector(4, 2.0), dice.vector(7, 3.0))
    assert Silent().vectors(1, 0.5, 2.0) == ((0.0,) * 3,) * 2


def test_vectors_together_cost_three_calls_side_by_side_and_one_transform():
    recorder = RowRecorder()
    with recorder.recording():
        given, out = recorder.memory("given"), recorder.memory("out", writable=True)
        key = (recorder.input("seed", "word"), recorder.input("run", "word"))
        first, second = Dice(key, 3, 0).vectors(0, given[0], given[1])
        for place, number in enumerate((*first, *second)):
            out[place] = number
    body = recorder.program("draws").main.body
    rounds = [s for s in body if isinstance(s, Op) and s.operation.name == "rotate_left"]
    assert [s.args[1] for s in rounds[::3]] == [s.args[1] for s in rounds[2::3]]
    assert len(rounds) == 3 * 20
    assert [s.rows for s in body if isinstance(s, Call)] == [3]


def test_distribution():
    # A wrong deviation or mean by two per cent is seen in all numbers together.
    for x in (*SAMPLE, SAMPLE.ravel()):
        assert kstest(x, "norm").pvalue > 1e-3
    assert kstest(1.02 * SAMPLE.ravel(), "norm").pvalue < 1e-3
    assert kstest(SAMPLE.ravel() + 0.02, "norm").pvalue < 1e-3
    # Beyond three deviations: 0.27 per cent, within four standard errors of a count.
    found, p = np.count_nonzero(np.abs(SAMPLE) > 3.0), 2.0 * norm.cdf(-3.0)
    assert abs(found - p * SAMPLE.size) < 4.0 * math.sqrt(p * SAMPLE.size)


def test_independence():
    # Numbers, runs, seeds and successive steps: no two series are correlated, and no number comes twice.
    series = np.vstack([SAMPLE, nine(1, 1), nine(2, 0), nine(0, 1)])
    bound = 5.0 / math.sqrt(COUNT)
    for power in (series, series**2 - 1.0, np.abs(series)):
        assert np.abs(np.corrcoef(power) - np.eye(len(series))).max() < bound
    for x in series:
        assert abs(np.mean(x[1:] * x[:-1])) < bound
    assert len(np.unique(series)) == series.size
