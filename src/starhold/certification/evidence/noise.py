"""Finds bounds of noise-driven errors: a covariance that bounds theirs, and radii that they rarely leave."""

from __future__ import annotations

from fractions import Fraction
from importlib import import_module
from math import log
from typing import Any

import numpy as np
from numpy.typing import NDArray

from starhold.certification.evidence.attitude import Loop
from starhold.certification.evidence.finding import floats
from starhold.certification.evidence.squares import rounded
from starhold.certification.unmodelled import driven_errors, measures_noisy_field, samples_of
from starhold.kernel.held import near_target
from starhold.kernel.loops import AttitudeLoop
from starhold.kernel.regions import RATE, TURN
from starhold.kernel.theorems.noise import BESIDE, CARRIED, CORRECTED, SHARE, driven, linear
from starhold.parts.contract import DEVIATIONS

linalg: Any = import_module("scipy.linalg")
Array = NDArray[np.float64]

RARELY = Fraction(27, 10_000)
"""The share of orbits in which errors may leave their radii."""
WIDER, LEAST, MORE, DIGITS = 1e-6, 1e-30, 1.0 + 1e-9, 9
"""The share by which the covariance is inflated at each step, and its minimum; the margin for rounding; and the digits of
covariances, because long numbers take long."""


SHARES = (0.05, 0.05, 0.05, 0.85)
"""The shares of the probability for the radii of attitude and rate errors of the measurement, and of the rate and the
rotation that they cause."""


def find_radii(loop: Loop, wired: AttitudeLoop) -> tuple[dict[str, Any], dict[str, Any]] | None:
    """Find the numbers of a claim about noise, and their evidence; None without noise, or where it drives errors or the loop
    without bound."""
    noise = driven_errors(loop.loop)
    if noise is None:
        return None
    near, every = near_target(wired, Fraction(loop.loop.period)), noise.recursion.every
    carried, corrected = (tuple(map(floats, driven(near, *linear(wired.claim, role)))) for role in (CARRIED, CORRECTED))
    steps = [carried] * (every - 1) + [corrected]
    size = len(carried[0][0])
    (whole, spread), shapes, widths = period(steps, size, 0.0 * np.eye(size)), list[Array](), [0.0] * 4
    if float(np.abs(np.linalg.eigvals(whole)).max()) >= 1.0 - 1e-9:
        return None
    more = np.diag(WIDER * np.diag(linalg.solve_discrete_lyapunov(whole, spread)) + LEAST)
    shape = linalg.solve_discrete_lyapunov(*period(steps, size, more))
    for A, B in steps:
        full = A @ shape @ A.T + B @ B.T
        told = [full[k, k] for k in (slice(size, size + 3), slice(size + 3, size + 6), RATE, TURN)]
        widths = [max(width, float(np.linalg.eigvalsh(own)[-1])) for width, own in zip(widths, told, strict=True)]
        shape = full[:size, :size] + more
        shapes.append((shape + shape.T) / 2.0)
    deviations = [(width + LEAST) ** 0.5 * MORE for width in widths]
    samples = samples_of(loop.loop)

    optimize: Any = import_module("scipy.optimize")

    def radius(width: float, share: float) -> float:
        # Less, for what noise of the magnetic field takes.
        rarely = log(float(RARELY) * (1.0 - 1e-5) * share / samples)

        def missed(k: float) -> float:
            return log(0.8 * (k + 1.0 / k)) - k * k / 2.0 - rarely

        return width * float(optimize.brentq(missed, 1.0, 12.0)) * MORE

    radii = [radius(width, share) for width, share in zip(deviations, SHARES, strict=True)]
    numbers = {SHARE: RARELY, "samples": samples, "every": every, "noise.attitude": radii[0], "noise.rate": radii[1]}
    numbers |= {BESIDE: DEVIATIONS} if measures_noisy_field(loop.loop) else {}
    evidence = {
        "covariances": [[[str(rounded(x, DIGITS)) for x in row] for row in own.tolist()] for own in shapes],
        "deviations": [str(Fraction(x)) for x in deviations],
        "swayed": [str(Fraction(x)) for x in radii[2:]],
    }
    return numbers, evidence


def period(steps: list[tuple[Array, ...]], size: int, more: Array) -> tuple[Array, Array]:
    """Return the factor of errors over all steps together, and the covariance that the steps add, each with a margin."""
    whole, spread = np.eye(size), np.zeros((size, size))
    for A, B in steps:
        own, noise = A[:size], B[:size]
        whole, spread = own @ whole, own @ spread @ own.T + noise @ noise.T + more
    return whole, spread
