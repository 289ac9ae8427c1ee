"""Programs evaluated over Taylor models: polynomials of low degree in the inputs, each on a box, with bounds of how far
programs are from them there.

An input is its bound times a number between -1 and 1, and polynomials are in these numbers: none exceeds the sum of its
coefficients' sizes. Coefficients are whole multiples of 2^-PLACES; rounding errors and omitted terms go to the radius. A
condition has to be decided on the whole box, so that a program is one smooth function there. Docs/kernel.md, 12.
"""

from __future__ import annotations

import operator as op
from collections.abc import Callable, Iterator, Mapping, Sequence
from fractions import Fraction
from functools import partial
from math import isqrt, lcm
from typing import Any, NamedTuple, TypeAlias

from .numbers import Account, demand, up
from .programs import Program

PLACES, DEGREE, BITS = 100, 3, 4
ONE, FIRST = 1 << PLACES, (1 << BITS) - 1
Terms: TypeAlias = dict[int, int]
"""Coefficients by monomials: the degree, and then the exponent of each input, each take BITS of a whole number."""


class Model(NamedTuple):
    """A polynomial and a radius: the modelled function is within that distance of the polynomial on the box."""

    terms: Terms
    radius: int

    @property
    def size(self) -> int:
        """Return a bound of the polynomial."""
        return sum(map(abs, self.terms.values()))

    @property
    def constant(self) -> int:
        """Return the polynomial's value at zero."""
        return self.terms.get(0, 0)

    @property
    def spread(self) -> int:
        """Return the largest distance of the function, on the box, from the polynomial's value at zero."""
        return self.size - abs(self.constant) + self.radius


Value: TypeAlias = Model | bool


def number(x: Fraction) -> Model:
    """Return a number that depends on no input."""
    whole, rest = divmod(x.numerator << PLACES, x.denominator)
    return Model({0: whole} if whole else {}, int(rest > 0))


def multiple(size: Fraction) -> int:
    """Return the least multiple not below a size."""
    return -((-size.numerator << PLACES) // size.denominator)


def linear(place: int) -> int:
    """Return the monomial of an input."""
    return 1 | 1 << BITS * (place + 1)


def within(size: Fraction, place: int) -> Model:
    """Return the input in a place, with this bound."""
    return Model({linear(place): multiple(size)}, 0)


def add(x: Model, y: Model) -> Model:
    """Return a sum."""
    Account.spend(2 + len(y.terms), PLACES)
    both = dict(x.terms)
    for m, c in y.terms.items():
        both[m] = both.get(m, 0) + c
    return Model(both, x.radius + y.radius)


def negative(x: Model) -> Model:
    """Return the negative."""
    Account.spend(len(x.terms), PLACES)
    return Model({m: -c for m, c in x.terms.items()}, x.radius)


def subtract(x: Model, y: Model) -> Model:
    """Return a difference."""
    return add(x, negative(y))


def multiply(x: Model, y: Model) -> Model:
    """Return a product; terms of higher degree go to the radius."""
    for a, b in ((x, y), (y, x)):
        if not a.radius and a.terms.keys() <= {0}:
            return multiplied(b, a.constant)
    Account.spend(4 + len(x.terms) * len(y.terms), PLACES)
    product, higher = dict[int, int](), 0
    for m, c in x.terms.items():
        room = DEGREE - (m & FIRST)
        for n, d in y.terms.items():
            if n & FIRST <= room:
                product[m + n] = product.get(m + n, 0) + c * d
            else:
                higher += abs(c * d)
    # A model's size is at most that of its polynomial and its radius.
    apart = higher + x.radius * (y.size + y.radius) + x.size * y.radius
    return rounded({m: c for m, c in product.items() if c}, apart)


def multiplied(x: Model, c: int) -> Model:
    """Return a model times a number of multiples."""
    Account.spend(2 + len(x.terms), PLACES)
    return rounded({m: c * d for m, d in x.terms.items()} if c else {}, abs(c) * x.radius)


def rounded(products: Terms, apart: int) -> Model:
    """Return a model from twice as many places: rounding changes a coefficient by less than one, which the radius holds."""
    return Model(
        {m: c >> PLACES for m, c in products.items()},
        sum([c & (ONE - 1) > 0 for c in products.values()]) - (-apart >> PLACES),
    )


def series(x: Model, coefficients: Sequence[Fraction], rest: Fraction) -> Model:
    """Return a polynomial of a model without a constant, with an error of at most `rest`."""
    value = number(coefficients[-1])
    for c in coefficients[-2::-1]:
        value = add(multiply(value, x), number(c))
    return Model(value.terms, value.radius - (-rest.numerator << PLACES) // rest.denominator)


def relative(y: Model) -> tuple[Fraction, Model, Fraction]:
    """Return a model's constant, the remaining model relative to it, and the size of that, which is less than 1."""
    demand(y.spread < abs(y.constant), "a program divides by what may be zero, or takes a root of it")
    c = Fraction(y.constant, ONE)
    beside = multiply(add(y, number(-c)), number(1 / c))
    size = Fraction(beside.spread + abs(beside.constant), ONE)
    demand(size < 1, "a program divides by what may be zero, or takes a root of it")
    return c, beside, size


def inverse(y: Model) -> Model:
    """Return 1 / y: 1 / (1 + x) = 1 - x + x^2 - ..."""
    c, x, size = relative(y)
    terms = [Fraction((-1) ** k) for k in range(DEGREE + 1)]
    return multiply(series(x, terms, size ** (DEGREE + 1) / (1 - size)), number(1 / c))


def divide(x: Model, y: Model) -> Model:
    """Return a quotient."""
    return multiply(x, inverse(y))


def root(y: Model) -> Model:
    """Return the root of a positive model: (1 + x)^(1/2) = 1 + x/2 - x^2/8 + ..., with ever smaller coefficients."""
    c, x, size = relative(y)
    demand(c > 0, "a program takes a root of what is negative")
    terms = [Fraction(1)]
    for k in range(DEGREE + 1):
        terms.append(terms[-1] * (Fraction(1, 2) - k) / (k + 1))
    whole = c * ONE * ONE
    low = isqrt(whole.numerator // whole.denominator)
    # The root of the constant lies between this and the next multiple.
    constant = number(Fraction(low, ONE))._replace(radius=2)
    return multiply(series(x, terms[:-1], abs(terms[-1]) * size ** (DEGREE + 1) / (1 - size)), constant)


def is_less(x: Model, y: Model, strictly: bool = True) -> bool:
    """Tell whether x < y, or whether x <= y, on the whole box."""
    gap = subtract(y, x)
    low, high = gap.constant - gap.spread, gap.constant + gap.spread
    demand(low > 0 or high < 0 or low == high, "a program switches on the box")
    return low > 0 or (low == high == 0 and not strictly)


def select(truth: bool, x: Model, y: Model) -> Model:
    """Return the value chosen by a condition that is decided."""
    return x if truth else y


OPERATIONS: dict[str, Callable[..., Value]] = {
    "plus": add,
    "minus": subtract,
    "product": multiply,
    "divide": divide,
    "negative": negative,
    "sqrt": root,
    "less": is_less,
    "less_equal": partial(is_less, strictly=False),
    "select": select,
    "both": bool.__and__,
    "either": bool.__or__,
    "opposite": op.not_,
}


def run(program: Program, given: Mapping[str, Model], count: int) -> list[Model]:
    """Return models of a program's outputs, which must be so many."""
    demand(len(program.outputs) == count, f"a program has {len(program.outputs)} outputs and not {count}")
    demand(all(name in given for name in program.inputs), "a program asks for what nothing gives")
    values: list[Any] = [given[name] for name in program.inputs]
    for operation, operands in program.steps:
        if operation == "constant":
            values.append(number(operands))
            continue
        Account.spend(2, PLACES)
        values.append(OPERATIONS[operation](*[values[k] for k in operands]))
    return [values[k] for k in program.outputs]


def slope(model: Model, size: Fraction, place: int) -> Fraction:
    """Return the approximate slope at zero in the input of a place."""
    return Fraction(model.terms.get(linear(place), 0), multiple(size))


def beyond(model: Model, sizes: Sequence[Fraction], row: Sequence[Fraction]) -> tuple[list[Fraction], Fraction]:
    """Return D and c: on the box of these sizes a model differs from row.z by at most D.|z| + c. A monomial is shared among
    its inputs; none of them exceeds its size."""
    wide, among = [Fraction(multiple(size), ONE) for size in sizes], lcm(*range(2, DEGREE + 1))
    shares = [0] * len(sizes)
    for m, c in model.terms.items():
        for place in places(m >> BITS) if m & FIRST > 1 else ():
            shares[place] += abs(c) * (among // (m & FIRST))
    steep = [
        up(abs(slope(model, x, k) - entry) + Fraction(share, among * ONE) / x)
        for k, (x, entry, share) in enumerate(zip(wide, row, shares, strict=True))
    ]
    return steep, Fraction(abs(model.constant) + model.radius, ONE)


def places(m: int) -> Iterator[int]:
    """Yield the places of a monomial's inputs, each as often as it occurs."""
    place = 0
    while m:
        yield from [place] * (m & FIRST)
        m, place = m >> BITS, place + 1
