"""The matrix exponential, without SciPy: most commands would load `scipy.linalg` for it alone, which takes longer."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
BITS = 256
"""Working precision in bits: each squaring doubles the rounding error, once per binary digit of the norm."""


def exponential(a: Array) -> Array:
    """Return e^A (n, n) of a matrix (n, n); entries that overflow are not finite."""
    # Loaded here, because flights do not need it.
    from flint import arb_mat, ctx

    with ctx.workprec(BITS):
        return np.array([float(ball.mid()) for ball in arb_mat(a.tolist()).exp().entries()]).reshape(a.shape)
