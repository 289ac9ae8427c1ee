"""Operations on 64-bit words, of which random numbers are made, and conversions to numbers and loop indices.

In plain Python a word is an int from 0 to 2^64 - 1. JavaScript has no such integers: there a word is two signed ones of 32
bits, and texts refer to these halves as {0h} and {0l}. An operation that gives a word has a text for each half; the low
half is computed first, and the text of the high half may refer to it as {low}.
"""

from __future__ import annotations

import struct
from typing import Any

from starhold.algebra.operations import operation
from starhold.algebra.scalar import Scalar, Truth

MASK = 0xFFFFFFFFFFFFFFFF


def _rotated(count: int) -> tuple[str, str]:
    """Return both halves of a word rotated left by `count` bits, in JavaScript."""
    high, low = ("{0l}", "{0h}") if count >= 32 else ("{0h}", "{0l}")
    count %= 32
    if count == 0:
        return high, low
    rest = 32 - count
    return f"{high} << {count} ^ {low} >>> {rest}", f"{low} << {count} ^ {high} >>> {rest}"


def _shifted(count: int) -> tuple[str, str]:
    """Return both halves of a word shifted right by `count` bits, in JavaScript."""
    if count >= 32:
        return "0", f"{{0h}} >>> {count - 32} ^ 0"
    return f"{{0h}} >>> {count}", f"{{0l}} >>> {count} ^ {{0h}} << {32 - count}"


@operation("word word", "word", llvm="add {word} {0}, {1}", c="{0} + {1}",
           javascript=("{0h} + {1h} + (({low} >>> 0) < ({0l} >>> 0) ? 1 : 0) ^ 0", "{0l} + {1l} ^ 0"))  # fmt: skip
def word_add(a: int, b: int) -> int:
    """Return a + b modulo 2^64."""
    return (a + b) & MASK


@operation("word word", "word", llvm="xor {word} {0}, {1}", c="{0} ^ {1}", javascript=("{0h} ^ {1h}", "{0l} ^ {1l}"))
def word_xor(a: int, b: int) -> int:
    """Return the exclusive or, bit by bit."""
    return (a ^ b) & MASK


@operation("word word", "word", llvm="and {word} {0}, {1}", c="{0} & {1}", javascript=("{0h} & {1h}", "{0l} & {1l}"))
def word_and(a: int, b: int) -> int:
    """Return the and, bit by bit."""
    return a & b


@operation("word word", "word", llvm="or {word} {0}, {1}", c="{0} | {1}", javascript=("{0h} | {1h}", "{0l} | {1l}"))
def word_or(a: int, b: int) -> int:
    """Return the or, bit by bit."""
    return (a | b) & MASK


@operation("word static", "word", llvm="call {word} @llvm.fshl.{words}({word} {0}, {word} {0}, {word} {1})",
           c="({0} << {1}) | ({0} >> (64 - {1}))", javascript=_rotated)  # fmt: skip
def rotate_left(a: int, count: int) -> int:
    """Return the bits rotated left by 0 < count < 64 places."""
    return ((a << count) | (a >> (64 - count))) & MASK


@operation("word static", "word", llvm="lshr {word} {0}, {1}", c="{0} >> {1}", javascript=_shifted)
def shift_right(a: int, count: int) -> int:
    """Return the bits shifted right by 0 < count < 64 places, filled with zeros."""
    return a >> count


@operation("word", "truth", llvm="trunc {word} {0} to {truth}", c="({0} & 1) != 0", javascript="({0l} & 1) !== 0")
def lowest_bit(a: int) -> Truth:
    """Tell whether the lowest bit is set."""
    return bool(a & 1)


@operation("number", "word", llvm="bitcast {number} {0} to {word}", c="bits_of({0})",
           javascript=("high_bits({0})", "low_bits({0})"))  # fmt: skip
def bits_of(x: Scalar) -> int:
    """Return the bits of an IEEE double; those of a NaN depend on the machine."""
    return int(struct.unpack("<Q", struct.pack("<d", x))[0])


@operation("word", "number", llvm="bitcast {word} {0} to {number}", c="with_bits({0})", javascript="with_bits({0h}, {0l})")
def with_bits(a: int) -> Scalar:
    """Return the IEEE double with these bits."""
    return float(struct.unpack("<d", struct.pack("<Q", a))[0])


@operation("index index", "index", llvm="add i64 {0}, {1}", c="{0} + {1}", javascript="{0} + {1}")
def index_plus(a: int, b: int) -> int:
    """Return a + b, as `+` between indices."""
    return a + b


@operation("index index", "index", llvm="sub i64 {0}, {1}", c="{0} - {1}", javascript="{0} - {1}")
def index_minus(a: int, b: int) -> int:
    """Return a - b, as `-` between indices."""
    return a - b


@operation("index index", "index", llvm="mul i64 {0}, {1}", c="{0} * {1}", javascript="{0} * {1}")
def index_product(a: int, b: int) -> int:
    """Return a b, as `*` between indices."""
    return a * b


@operation("index index", "uniform", llvm="icmp eq i64 {0}, {1}", c="{0} == {1}", javascript="{0} === {1}")
def same_index(a: int, b: int) -> Truth:
    """Tell whether two indices are equal; for `when` and `unless`."""
    return a == b


# In JavaScript an index is a double: 0 times -1 is a zero with a sign.
@operation("index", "number", llvm="sitofp i64 {0} to double", c="(double){0}", javascript="{0} + 0")
def number_of(index: int) -> Scalar:
    """Return an index as a number."""
    return float(index)


@operation("index", "word", llvm="add i64 {0}, 0", c="(uint64_t){0}",
           javascript=("Math.floor({0} / 4294967296) ^ 0", "{0} ^ 0"))  # fmt: skip
def word_of(index: int) -> int:
    """Return an index as a word."""
    return index & MASK


def whole_word(number: Any) -> Any:
    """Return an integer from 0 to 2^52 as a word, without conversion instructions, which vector units lack for 64 bits."""
    return word_and(bits_of(number + 4503599627370496.0), 0x000FFFFFFFFFFFFF)


def number_in(word: Any) -> Any:
    """Return a word below 2^52 as a number."""
    return with_bits(word_or(word, 0x4330000000000000)) - 4503599627370496.0


@operation("", "word", llvm="add {word} {lanes}, {zero}", c="UINT64_C(0)", javascript=("0", "0"))
def lane() -> int:
    """Return the number of the lane, from 0; recorded by `Recorder.lane`."""
    return 0
