import mpmath
import numpy as np

from starhold.algebra.circular import cosine_sine, nearest
from starhold.algebra.dual import Dual, differentiate


def test_cosine_and_sine_against_mpmath():
    # Every quarter and eighth of a turn and their neighbours, and angles from tiny to what a flight of years comes to.
    eighths = [k / 8.0 for k in range(-33, 34)]
    turns = [near for x in eighths for near in (x, np.nextafter(x, -np.inf), np.nextafter(x, np.inf))]
    turns += [float(x) for scale in (1e-9, 1e-3, 1.0, 1e4) for x in np.random.default_rng(3).normal(scale=scale, size=1000)]
    with mpmath.workdps(40):
        worst = 0.0
        for x in turns:
            angle = 2 * mpmath.pi * mpmath.mpf(x)
            cosine, sine = cosine_sine(float(x))
            worst = max(worst, float(abs(cosine - mpmath.cos(angle))), float(abs(sine - mpmath.sin(angle))))
    assert worst < 3e-16


def test_quarters_are_exact():
    assert [cosine_sine(k / 4.0) for k in range(4)] == [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)]


def test_rounding_as_python_does():
    for x in (0.5, 1.5, 2.5, -0.5, -1.5, 0.49999999999999994, 7.3, -123456.7):
        assert nearest(x) == round(x)


def test_their_slopes_are_those_of_cosine_and_sine():
    for x in (-3.3, 0.1, 0.37, 12.6):
        slopes = differentiate(lambda x=x: cosine_sine(Dual(x, np.array([1.0]))), 1)  # pyright: ignore
        cosine, sine = cosine_sine(x)
        assert np.allclose(slopes[:, 0], [-2 * np.pi * sine, 2 * np.pi * cosine], rtol=1e-13)
