"""Slopes of programs, against dual numbers, against formulas, and against central differences."""

import math

import numpy as np
import pytest

from starhold.algebra.circular import cosine_sine
from starhold.algebra.dual import differentiate, variables
from starhold.algebra.elementary import exp
from starhold.algebra.scalar import clip, less, sqrt, where
from starhold.algebra.structured import function, repeat, until, when
from starhold.algebra.words import bits_of, with_bits
from starhold.trace.calling import record_call
from starhold.trace.machine import aligned, load
from starhold.trace.tangent import tangent
from tests.algebra.smooth import EQUATIONS, POINT

WIDTH = 8


def slopes_of(equation, point):
    """The values of an equation of a tuple, and its slopes by the derivative of its program."""
    program, shape = record_call(lambda x: tuple(equation(x)), (tuple(point),))
    kernel = load(tangent(program, ("x", "y")), WIDTH)
    (x, dx), (y, dy) = ((aligned(n, WIDTH), aligned(n, WIDTH)) for n in (len(point), len(shape)))
    x[:], dx[:] = np.array(point)[:, None], np.eye(len(point), WIDTH)
    kernel(x.ctypes.data, y.ctypes.data, dx.ctypes.data, dy.ctypes.data, 1)
    return y[:, 0], dy[:, : len(point)]


@pytest.mark.parametrize("name", EQUATIONS)
def test_slopes_are_those_of_dual_numbers(name):
    found = slopes_of(EQUATIONS[name], POINT)[1]
    expected = differentiate(lambda: EQUATIONS[name](variables(POINT, 0, len(POINT))), len(POINT))
    np.testing.assert_allclose(found, expected, rtol=1e-14, atol=1e-15)


def test_rounding_has_no_slope():
    """Exponential and sine reduce their argument by a whole number, which does not change with it."""
    for x in (-3.3, 0.2, 7.9):
        (power, cosine, _), slopes = slopes_of(lambda x: (exp(x[0]), *cosine_sine(x[0])), (x,))
        sine = math.sin(math.tau * x)
        np.testing.assert_allclose(slopes[:, 0], [power, -math.tau * sine, math.tau * cosine], rtol=1e-12)


@function
def _limited(x, y):
    """A limited product."""
    return clip(x * y, 5.0), x


def loops(x):
    """A power in a loop, a root by Newton's steps, a branch and a called function."""
    (power,) = repeat(5, lambda _, p: (p * x[0],), 1.0)
    (root,) = until(lambda r: less(abs_of(r * r - x[1]), 1e-14), lambda r: (0.5 * (r + x[1] / r),), x[1], at_most=60)
    (chosen,) = when(less(x[0], x[1]), lambda c: (c * x[0],), x[1])
    limited, same = _limited(x[0], x[1])
    return power, root, chosen, limited, same


def abs_of(x):
    return where(less(x, 0.0), -x, x)


@pytest.mark.parametrize("point", [(1.1, 2.3), (2.3, 1.1), (2.5, 2.2)])
def test_loops_branches_and_functions(point):
    values, found = slopes_of(loops, point)
    step = 1e-6
    for k in range(2):
        ahead, behind = (np.array(loops([x + s * (i == k) for i, x in enumerate(point)])) for s in (step, -step))
        np.testing.assert_allclose(found[:, k], (ahead - behind) / (2.0 * step), rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(found[1], [0.0, 0.5 / math.sqrt(point[1])], rtol=1e-12)
    np.testing.assert_array_equal(values, loops(point))


def test_bits_have_no_slope():
    program, _ = record_call(lambda x: with_bits(bits_of(sqrt(x))), (2.0,))
    with pytest.raises(ValueError, match="bits of a number"):
        tangent(program, ("x", "y"))
    # Of what is not varied they may be read.
    tangent(program, ("y",))
