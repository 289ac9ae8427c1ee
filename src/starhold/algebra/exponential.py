"""The matrix exponential. SciPy's would be all that most commands load `scipy.linalg` for, which takes them longer."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
BITS = 256
"""The working precision: squaring doubles what rounding leaves, once for each binary digit of the matrix's size."""


def exponential(a: Array) -> Array:
    """Return e^A of a matrix (n, n); what overflows is not finite."""
    # Loaded here, because loops are flown without it.
    from flint import arb_mat, ctx

    with ctx.workprec(BITS):
        return np.array([float(ball.mid()) for ball in arb_mat(a.tolist()).exp().entries()]).reshape(a.shape)
