import mpmath
import numpy as np

from starhold.algebra.quaternion import multiply
from starhold.algebra.rotation import rotation_vector, short_turn


def test_short_turn_against_mpmath():
    for size in (0.0, 1e-9, 1e-3, 0.02, 0.1, 0.3):
        half = np.random.default_rng(2).normal(size=3)
        half = tuple((size * half / np.linalg.norm(half)).tolist())
        with mpmath.workdps(40):
            length = mpmath.sqrt(sum(mpmath.mpf(x) ** 2 for x in half))
            exact = [mpmath.cos(length), *(mpmath.sinc(length) * mpmath.mpf(x) for x in half)]
            worst = max(float(abs(a - e)) for a, e in zip(short_turn(half), exact, strict=True))
        assert worst < size**7 / 5000.0 + 2e-16


def test_short_turns_and_rotation_vectors_are_inverse():
    half = (0.004, -0.011, 0.007)
    assert np.abs(np.subtract(rotation_vector(short_turn(half)), [2.0 * x for x in half])).max() < 1e-16
    twice = multiply(short_turn(half), short_turn(half))
    assert np.abs(np.subtract(twice, short_turn(tuple(2.0 * x for x in half)))).max() < 2e-14
