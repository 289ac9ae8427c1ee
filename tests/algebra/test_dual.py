"""Dual numbers differentiate equations: against finite differences, and they refuse where there is no slope."""

import numpy as np
import pytest

from starhold.algebra.dual import BorderError, Dual, differentiate, variables
from starhold.algebra.scalar import absolute, maximum, sign, sqrt, where
from tests.algebra.smooth import EQUATIONS, POINT


@pytest.mark.parametrize("name", EQUATIONS)
def test_slopes_are_those_of_finite_differences(name):
    equation, count, step = EQUATIONS[name], len(POINT), 1e-6
    found = differentiate(lambda: equation(variables(POINT, 0, count)), count)
    for k in range(count):
        ahead, behind = (np.array(equation([x + s * (i == k) for i, x in enumerate(POINT)])) for s in (step, -step))
        np.testing.assert_allclose(found[:, k], (ahead - behind) / (2 * step), atol=2e-8)


def test_slopes_that_agree_on_both_sides_of_a_border_are_taken():
    # The largest of three sizes is 0 here, and the limit of 1 is far off.
    def equation():
        x = variables((0.0, 0.0, 0.0), 0, 3)
        size = maximum(absolute(x[0]), maximum(absolute(x[1]), absolute(x[2])))
        return [where(size > 1.0 if not isinstance(size, Dual) else size.value > 1.0, size, x[0] + 2.0 * x[1])]

    np.testing.assert_array_equal(differentiate(equation, 3), [[1.0, 2.0, 0.0]])


@pytest.mark.parametrize("equation", [sign, absolute, lambda x: sqrt(absolute(x)), lambda x: sqrt(x * x), lambda x: 1.0 / x])
def test_what_has_no_slope_is_refused(equation):
    with np.errstate(all="ignore"), pytest.raises(BorderError):
        differentiate(lambda: [equation(*variables((0.0,), 0, 1))], 1)
