"""Exact polynomials: what is done with them is done with their values, and bounds of them are kept, and closely."""

import random
from fractions import Fraction
from itertools import product

import pytest

from starhold.kernel.numbers import RefusedError
from starhold.kernel.polynomials import Poly, fastest, most, multiple, total

NAMES = ("q0", "q1", "w1", "w2")


def some(r, terms=6, degree=4):
    """A polynomial with fractions of all sizes."""
    coefficients = {}
    for _ in range(r.randrange(terms + 1)):
        m = tuple(sorted(r.choices(NAMES, k=r.randrange(degree))))
        coefficients[m] = Fraction(r.randrange(-99, 100), r.choice([1, 3, 7 * 2**40, 360, 10**20]))
    return Poly(coefficients)


def value(p, x):
    found = Fraction(0)
    for m, c in p.terms.items():
        for name in m:
            c *= x[name]
        found += c
    return found


@pytest.mark.parametrize("seed", range(12))
def test_what_is_done_with_polynomials_is_done_with_their_values(seed):
    r = random.Random(seed)
    p, q, s = some(r), some(r), some(r, 3, 3)
    x = {name: Fraction(r.randrange(-9, 10), r.randrange(1, 9)) for name in NAMES}
    number = Fraction(r.randrange(-9, 10), 7)
    assert value(p + q, x) == value(p, x) + value(q, x)
    assert value(p - q, x) == value(p, x) - value(q, x)
    assert value(p * q, x) == value(p, x) * value(q, x)
    assert value(number * p, x) == number * value(p, x)
    assert value(total([p, q, s, -p]), x) == value(q, x) + value(s, x)
    placed = {"w1": s, "q0": number, "w2": Poly({("w1",): Fraction(1)})}
    assert value(p.at(placed), x) == value(p, x | {"w1": value(s, x), "q0": number, "w2": x["w1"]})
    assert value(total(c * Poly({("w1",) * k: Fraction(1)}) for k, c in enumerate(p.powers("w1"))), x) == value(p, x)
    assert p.at(x).number == value(p, x)
    # (p(x + h) - p(x - h)) / 2h of a cube or less differs from the slope by its third derivative.
    h = Fraction(1, 7)
    third = p.slope("w1").slope("w1").slope("w1")
    step = (value(p, x | {"w1": x["w1"] + h}) - value(p, x | {"w1": x["w1"] - h})) / (2 * h)
    assert step == value(p.slope("w1"), x) + h * h / 6 * value(third, x)


@pytest.mark.parametrize("seed", range(12))
def test_a_polynomial_holds_no_zeros_and_no_factors_that_all_its_numbers_share(seed):
    r = random.Random(seed)
    p, q = some(r), some(r)
    for made in (p * q, p + q, (p + q) - q, p - p):
        assert all(made.upper.values())
        assert made.lower > 0
        assert made.terms == {m: Fraction(c, made.lower) for m, c in made.upper.items()}
    assert ((p + q) - q).terms == p.terms
    assert (p - p).terms == {}
    assert (p - p).lower == 1


@pytest.mark.parametrize("seed", range(12))
def test_bounds_are_kept_and_are_the_sums_of_sizes(seed):
    r = random.Random(seed)
    p = some(r, 8)
    sizes = {name: Fraction(r.randrange(4), r.choice([1, 3, 10**9])) for name in NAMES}
    speeds = {name: Fraction(r.randrange(5), r.choice([1, 7, 10**6])) for name in ("q0", "w1")}
    bound, fast = most(p, sizes), fastest(p, sizes, speeds)
    largest = sum((abs(c) * value(Poly({m: Fraction(1)}), sizes) for m, c in p.terms.items()), Fraction(0))
    assert largest <= bound <= largest * (1 + Fraction(1, 2**60))
    quickest = sum((most(p.slope(name), sizes) * speed for name, speed in speeds.items()), Fraction(0))
    assert quickest * (1 - Fraction(1, 2**60)) <= fast <= quickest * (1 + Fraction(1, 2**60))
    for signs in product((-1, 0, 1), repeat=len(NAMES)):
        x = {name: sign * sizes[name] for name, sign in zip(NAMES, signs, strict=True)}
        assert abs(value(p, x)) <= bound
        assert abs(sum(value(p.slope(name), x) * speed for name, speed in speeds.items())) <= fast


def test_a_multiple_is_told_and_a_number_without_variables_alone():
    p = Poly({("w1",): Fraction(1, 3), (): Fraction(2)})
    assert multiple(p * Fraction(-3, 7) + Fraction(5), p) == (Fraction(-3, 7), Fraction(5))
    with pytest.raises(RefusedError, match="depends on the state"):
        _ = p.number
