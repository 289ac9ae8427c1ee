"""The matrix exponential against SciPy's and against solutions that are known."""

import subprocess
import sys

import numpy as np
import pytest
from scipy.linalg import expm

from starhold.algebra.exponential import exponential


@pytest.mark.parametrize("size", [1, 3, 7, 16])
def test_it_is_that_of_scipy(size):
    rng = np.random.default_rng(size)
    for norm in (1e-9, 0.1, 3.0, 20.0):
        a = rng.normal(size=(size, size)) * norm / size
        assert exponential(a) == pytest.approx(expm(a), rel=1e-10, abs=1e-12 * np.abs(expm(a)).max())


@pytest.mark.parametrize("rate", [1.0, 1e3, 1e6])
def test_fast_motions_keep_all_digits(rate):
    # An oscillation without damping for a thousand radians and more, in units that differ as much.
    turned = exponential(np.array([[0.0, 1.0], [-rate * rate, 0.0]]) * 1000.25 / 1e3)
    angle = rate * 1000.25 / 1e3
    assert turned == pytest.approx(
        np.array([[np.cos(angle), np.sin(angle) / rate], [-rate * np.sin(angle), np.cos(angle)]]), rel=1e-8
    )


def test_what_overflows_is_not_finite():
    assert not np.isfinite(exponential(np.array([[np.inf]]))).any()


def test_scipy_is_whole_after_a_proof_took_two_of_its_modules():
    code = """
import sys
import numpy as np
from starhold.certification.evidence import cones
cones._load()
assert "scipy.linalg" not in sys.modules and "scipy.linalg.cython_lapack" in sys.modules
import clarabel
assert "scipy.linalg" not in sys.modules
import scipy.linalg, scipy.optimize, scipy.sparse.linalg
from scipy.linalg import cython_blas
assert np.allclose(scipy.linalg.expm(np.eye(2)), np.e * np.eye(2))
assert scipy.optimize.brentq(lambda x: x - 1.0, 0.0, 3.0) == 1.0
"""
    subprocess.run([sys.executable, "-W", "error", "-c", code], check=True)
