"""Random numbers as a function of (seed, run, step, channel): no stream, so nothing depends on scheduling.

The bits are Threefry-2x64 with 20 rounds ("Parallel Random Numbers: As Easy as 1, 2, 3"); Gaussians come from the inverse
normal distribution (Wichura's algorithm AS 241), with a logarithm made of `+ - * /` and selects only, so that the floats,
every lane and exported code round alike.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from starhold.algebra.scalar import Scalar, compiled_as, equation, less, sqrt, where
from starhold.algebra.vector import Vector, scale

_MASK = 0xFFFFFFFFFFFFFFFF
_PARITY = 0x1BD11BDAA9FC1A22
_ROTATIONS = (16, 42, 12, 31, 16, 32, 24, 21)


def threefry(key: tuple[int, int], counter: tuple[int, int]) -> tuple[int, int]:
    """Two 64-bit words that look random, a bijection of the counter for each key."""
    keys = (key[0], key[1], key[0] ^ key[1] ^ _PARITY)
    a, b = (counter[0] + keys[0]) & _MASK, (counter[1] + keys[1]) & _MASK
    for i in range(20):
        turn = _ROTATIONS[i % 8]
        a = (a + b) & _MASK
        b = ((b << turn) | (b >> (64 - turn))) & _MASK
        b ^= a
        if i % 4 == 3:
            j = i // 4 + 1
            a, b = (a + keys[j % 3]) & _MASK, (b + keys[(j + 1) % 3] + j) & _MASK
    return a, b


def _written_rounds() -> Any:
    """The same rounds unrolled over unsigned words, for the compiler to vectorise."""
    lines = [
        "k0, k1 = uint64(key[0]), uint64(key[1])",
        "k2 = k0 ^ k1 ^ parity",
        "a, b = uint64(counter[0]) + k0, uint64(counter[1]) + k1",
    ]
    space: dict[str, Any] = {"uint64": np.uint64, "parity": np.uint64(_PARITY)}
    for turn in set(_ROTATIONS):
        space[f"left{turn}"], space[f"right{turn}"] = np.uint64(turn), np.uint64(64 - turn)
    for i in range(20):
        turn = _ROTATIONS[i % 8]
        lines += ["a = a + b", f"b = ((b << left{turn}) | (b >> right{turn})) ^ a"]
        if i % 4 == 3:
            j = i // 4 + 1
            space[f"n{j}"] = np.uint64(j)
            lines += [f"a = a + k{j % 3}", f"b = b + k{(j + 1) % 3} + n{j}"]
    exec("def rounds(key, counter):\n    " + "\n    ".join([*lines, "return (a, b)"]), space)
    return space["rounds"]


compiled_as(threefry)(lambda key, counter: _written_rounds())  # pyright: ignore


def to_unit(word: int) -> float:
    """A number strictly between 0 and 1 from the upper 52 bits of a word (with 53, the half would round, up to 1)."""
    return ((word >> 12) + 0.5) * 2.0**-52


@compiled_as(to_unit)
def _compiled_to_unit(word: Any) -> Any:
    shift = np.uint64(12)
    # Through a signed integer: the value fits, and its conversion to float is the one that vector units have.
    return lambda word: (np.int64(np.uint64(word) >> shift) + 0.5) * 2.0**-52  # pyright: ignore


@equation
def logarithm(x: Scalar) -> Scalar:
    """Natural logarithm for 2^-63 <= x <= 1, to a few units in the last place."""
    e = 0.0
    small = less(x, 2.0**-32)
    x, e = where(small, x * 2.0**32, x), where(small, e - 32.0, e)
    small = less(x, 2.0**-16)
    x, e = where(small, x * 2.0**16, x), where(small, e - 16.0, e)
    small = less(x, 2.0**-8)
    x, e = where(small, x * 2.0**8, x), where(small, e - 8.0, e)
    small = less(x, 2.0**-4)
    x, e = where(small, x * 2.0**4, x), where(small, e - 4.0, e)
    small = less(x, 2.0**-2)
    x, e = where(small, x * 2.0**2, x), where(small, e - 2.0, e)
    small = less(x, 2.0**-1)
    x, e = where(small, x * 2.0, x), where(small, e - 1.0, e)
    small = less(x, 0.7071067811865476)
    x, e = where(small, x * 2.0, x), where(small, e - 1.0, e)
    s = (x - 1.0) / (x + 1.0)
    z = s * s
    tail = 1.0 / 15.0 + z * (1.0 / 17.0 + z * (1.0 / 19.0 + z * (1.0 / 21.0)))
    series = 1.0 / 3.0 + z * (1.0 / 5.0 + z * (1.0 / 7.0 + z * (1.0 / 9.0 + z * (1.0 / 11.0 + z * (1.0 / 13.0 + z * tail)))))
    return e * 0.6931471805599453 + 2.0 * (s + s * z * series)


@equation
def inverse_normal(p: Scalar) -> Scalar:
    """The standard normal quantile of 0 < p < 1, relative accuracy about 1e-15 (AS 241, PPND16)."""
    q = p - 0.5
    r = 0.180625 - q * q
    num = ((((((2509.0809287301226727 * r + 33430.575583588128105) * r + 67265.770927008700853) * r
             + 45921.953931549871457) * r + 13731.693765509461125) * r + 1971.5909503065514427) * r
           + 133.14166789178437745) * r + 3.387132872796366608  # fmt: skip
    den = ((((((5226.495278852545925 * r + 28729.085735721942674) * r + 39307.89580009271061) * r
             + 21213.794301586595867) * r + 5394.1960214247511077) * r + 687.1870074920579083) * r
           + 42.313330701600911252) * r + 1.0  # fmt: skip
    centre = q * num / den
    lower = where(less(q, 0.0), p, 1.0 - p)
    t = sqrt(-logarithm(lower))
    r = t - 1.6
    num = ((((((7.7454501427834140764e-4 * r + 0.0227238449892691845833) * r + 0.24178072517745061177) * r
             + 1.27045825245236838258) * r + 3.64784832476320460504) * r + 5.7694972214606914055) * r
           + 4.6303378461565452959) * r + 1.42343711074968357734  # fmt: skip
    den = ((((((1.05075007164441684324e-9 * r + 5.475938084995344946e-4) * r + 0.0151986665636164571966) * r
             + 0.14810397642748007459) * r + 0.68976733498510000455) * r + 1.6763848301838038494) * r
           + 2.05319162663775882187) * r + 1.0  # fmt: skip
    near = num / den
    r = t - 5.0
    num = ((((((2.01033439929228813265e-7 * r + 2.71155556874348757815e-5) * r + 0.0012426609473880784386) * r
             + 0.026532189526576123093) * r + 0.29656057182850489123) * r + 1.7848265399172913358) * r
           + 5.4637849111641143699) * r + 6.6579046435011037772  # fmt: skip
    den = ((((((2.04426310338993978564e-15 * r + 1.4215117583164458887e-7) * r + 1.8463183175100546818e-5) * r
             + 7.868691311456132591e-4) * r + 0.0148753612908506148525) * r + 0.13692988092273580531) * r
           + 0.59983220655588793769) * r + 1.0  # fmt: skip
    far = num / den
    tail = where(less(t, 5.0), near, far)
    tail = where(less(q, 0.0), -tail, tail)
    return where(less(0.425, where(less(q, 0.0), -q, q)), tail, centre)


@equation
def normal_vector(seed: int, run: int, step: int, channel: int, deviation: Scalar) -> Vector:
    """Three independent Gaussians of the given standard deviation; channels are even, each uses two counters."""
    a, b = threefry((seed, run), (step, channel))
    c, _ = threefry((seed, run), (step, channel + 1))
    return scale(deviation, (inverse_normal(to_unit(a)), inverse_normal(to_unit(b)), inverse_normal(to_unit(c))))
