import mpmath
import numpy as np

from starhold.algebra.exponential import exponential


def test_exponential_against_mpmath():
    points = [float(x) for scale in (1e-6, 1.0, 30.0, 200.0) for x in np.random.default_rng(5).normal(scale=scale, size=500)]
    with mpmath.workdps(40):
        exact = [mpmath.exp(mpmath.mpf(x)) for x in points if abs(x) < 700.0]
        found = [exponential(x) for x in points if abs(x) < 700.0]
        assert max(float(abs(y / e - 1)) for y, e in zip(found, exact, strict=True)) < 4e-16


def test_ends():
    assert exponential(0.0) == 1.0
    assert exponential(1e9) == exponential(700.0) < np.inf
    assert exponential(-1e9) == exponential(-700.0) > 0.0
