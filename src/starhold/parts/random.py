"""Random numbers as a function of (seed, run, step, number): there is no stream, so nothing depends on scheduling.

The bits are Threefry-2x64 with 20 rounds ("Parallel Random Numbers: As Easy as 1, 2, 3"). Each call gives two words, and
from these two Gaussians by the Box-Muller transform, which uses only `+ - * /`, a square root and operations on words, so
that floats, every lane and exported code round alike. The relative difference from the exact transform of the same words is
below 9e-14.
"""

from __future__ import annotations

from typing import Any, TypeAlias

from starhold.algebra.scalar import Scalar, sqrt, where
from starhold.algebra.several import each
from starhold.algebra.vector import Vector, scale
from starhold.algebra.words import (
    MASK,
    bits_of,
    lowest_bit,
    rotate_left,
    shift_right,
    with_bits,
    word_add,
    word_and,
    word_or,
    word_xor,
)

Word: TypeAlias = Any
"""A 64-bit word: a recorded one, or a Python int, which stands for its remainder modulo 2^64."""

_PARITY = 0x1BD11BDAA9FC1A22
_ROTATIONS = (16, 42, 12, 31, 16, 32, 24, 21)
_SIGN, _ONE, _FRACTION = 1 << 63, 0x3FF << 52, (1 << 52) - 1
"""Bits of -0.0, of 1.0, and of a double's fraction."""
_ROOT = 0x3FE6A09E667F3BCD
"""Bits of the square root of 1/2."""

# Polynomials of six terms with the least relative error: (2 / s) log((1 - s) / (1 + s)) in s^2 up to 0.0295 (error 2.7e-14),
# cos(x pi / 2) and sin(x pi / 2) / x in x^2 up to 1/4 (6.6e-14 and 4.6e-15).
_LOGARITHM = (
    -3.9999999999998934,
    -1.333333333593029,
    -0.7999998974436293,
    -0.5714433603383152,
    -0.4434835442907887,
    -0.39218168054929886,
)
_COSINE = (
    0.9999999999999344,
    -1.2337005501181886,
    0.253669507091481,
    -0.020863467311969534,
    0.0009191586039813276,
    -2.4845978560265747e-05,
)
_SINE = (
    1.5707963267948895,
    -0.6459640975042396,
    0.07969262615353433,
    -0.004681752566774908,
    0.00016042915250727994,
    -3.5562065731921854e-06,
)


def threefry(key: tuple[Word, Word], *counters: tuple[Word, Word]) -> tuple[tuple[Word, Word], ...]:
    """Return two pseudo-random 64-bit words for each counter, a bijection of it for each key.

    Each round waits for the one before, so all counters are processed together."""
    k0, k1 = map(_word, key)
    keys = (k0, k1, word_xor(word_xor(k0, k1), _PARITY))
    pairs = [(word_add(_word(c0), k0), word_add(_word(c1), k1)) for c0, c1 in counters]
    for i in range(20):
        sums = [word_add(a, b) for a, b in pairs]
        pairs = [(a, word_xor(rotate_left(b, _ROTATIONS[i % 8]), a)) for a, (_, b) in zip(sums, pairs, strict=True)]
        if i % 4 == 3:
            j = i // 4 + 1
            # The sum in parentheses is the same at every step.
            pairs = [(word_add(a, keys[j % 3]), word_add(b, word_add(keys[(j + 1) % 3], j))) for a, b in pairs]
    return tuple(pairs)


def _word(word: Word) -> Word:
    return word & MASK if isinstance(word, int) else word


def _one_to_two(word: Word) -> Scalar:
    """Return 1 + k 2^-52, with k the lowest 52 bits of a word; vector units convert no 64-bit integers."""
    return with_bits(word_or(word_and(word, _FRACTION), _ONE))


def to_unit(word: Word) -> Scalar:
    """Return (k + 1/2) 2^-52 exactly, with k the lowest 52 bits of a word: strictly between 0 and 1."""
    return _one_to_two(word) - (1.0 - 2.0**-53)


def to_angle(word: Word) -> Scalar:
    """Return k 2^-52 - 1/2 exactly, with k the lowest 52 bits of a word: an angle in quarter turns, up to 1/2."""
    return _one_to_two(word) - 1.5


def _series(c: tuple[float, ...], x: Scalar) -> Scalar:
    """Return c[0] + c[1] x + ... + c[5] x^5, computed in pairs of terms that do not wait for each other."""
    square = x * x
    return square * (square * (c[4] + c[5] * x) + (c[2] + c[3] * x)) + (c[0] + c[1] * x)


def _reduced(x: Scalar) -> tuple[Scalar, Scalar]:
    """Return e and (m - 1) / (m + 1) where x = m 2^e, sqrt(1/2) <= m < sqrt(2)."""
    # Shifted so that the bits of the exponent change where the fraction passes the square root.
    moved = word_add(bits_of(x), _ONE - _ROOT)
    m = with_bits(word_add(word_and(moved, _FRACTION), _ROOT))
    s = (m - 1.0) / (m + 1.0)
    return with_bits(word_or(shift_right(moved, 52), 0x433 << 52)) - (2.0**52 + 1023.0), s


def _joined(e: Scalar, s: Scalar) -> Scalar:
    """Return -2 log(x) from its reduced form."""
    return e * -1.3862943611198906 + s * _series(_LOGARITHM, s * s)


def cosine_and_sine(x: Scalar) -> tuple[Scalar, Scalar]:
    """Return cos(x pi / 2) and sin(x pi / 2) for -1/2 <= x <= 1/2, with relative errors below 7e-14 and 6e-15."""
    square = x * x
    return _series(_COSINE, square), x * _series(_SINE, square)


def transform(a: Word, b: Word) -> tuple[Scalar, Scalar]:
    """Return two independent Gaussians from two words, of which bits 0 to 51 and the highest are used."""
    unit, angle = to_unit(a), to_angle(b)
    # The division begins first, and the angle is computed meanwhile.
    e, s = _reduced(unit)
    cosine, sine = cosine_and_sine(angle)
    radius = sqrt(_joined(e, s))
    # A sign for both and whether they are exchanged: the quarter of the turn.
    radius = with_bits(word_xor(bits_of(radius), word_and(a, _SIGN)))
    x, y = radius * cosine, radius * sine
    exchanged = lowest_bit(shift_right(b, 63))
    return where(exchanged, y, x), where(exchanged, x, y)


def normals(key: tuple[Word, Word], step: Word, first: int, count: int) -> tuple[Scalar, ...]:
    """Return the Gaussians with the numbers `first` to `first` + `count` - 1 of a step, independent of each other and of
    those of any other step, run or seed; key: (seed, run). Each depends on its number alone; 2 n and 2 n + 1 share a
    call."""
    words = threefry(key, *((step, call) for call in range(first // 2, (first + count + 1) // 2)))
    pairs = each(transform, tuple(zip(*words, strict=True)))
    return tuple(x for pair in pairs for x in pair)[first % 2 :][:count]


class Dice:
    """The random numbers of a part at a control step: functions of (seed, run, step, number), in the part's own range."""

    def __init__(self, key: tuple[Word, Word], step: Word, first: int) -> None:
        self._key, self._step, self._first = key, step, first

    def vector(self, place: int, deviation: Scalar) -> Vector:
        """Return three independent Gaussians of this standard deviation: the part's numbers `place` to `place` + 2."""
        return self.vectors(place, deviation)[0]

    def vectors(self, place: int, *deviations: Scalar) -> tuple[Vector, ...]:
        """Return vectors of these standard deviations, the part's numbers from `place` on; faster than one by one."""
        numbers = self.normals(place, 3 * len(deviations))
        triples = zip(numbers[::3], numbers[1::3], numbers[2::3], strict=True)
        return tuple(map(scale, deviations, triples))

    def normals(self, place: int, count: int) -> tuple[Scalar, ...]:
        """Return independent standard Gaussians: the part's numbers from `place` on."""
        return normals(self._key, self._step, self._first + place, count)


class Silent(Dice):
    """Random numbers that are all 0, for readings without noise."""

    def __init__(self, *_: Any) -> None:
        super().__init__((0, 0), 0, 0)

    def vectors(self, place: int, *deviations: Scalar) -> tuple[Vector, ...]:
        """Return a zero vector for each."""
        return ((0.0, 0.0, 0.0),) * len(deviations)

    def normals(self, place: int, count: int) -> tuple[Scalar, ...]:
        """Return `count` zeros."""
        return (0.0,) * count


RANGE = 64
"""Number of random numbers that a part may use at a control step."""
