"""Finds bounds of noise-driven errors: a covariance that bounds theirs, and radii that they rarely leave."""

from __future__ import annotations

from fractions import Fraction
from importlib import import_module
from math import log
from typing import Any

import numpy as np
from numpy.typing import NDArray

from starhold.certification.evidence.attitude import Loop
from starhold.certification.evidence.lates import alike
from starhold.certification.matrices import floats
from starhold.certification.measured import driven_errors
from starhold.certification.unmodelled import gaussian_vectors, samples_of
from starhold.kernel.loops import AttitudeLoop
from starhold.kernel.near import near_target
from starhold.kernel.theorems.noise import (
    BESIDE,
    CARRIED,
    CORRECTED,
    DEVIATION,
    SHARE,
    VECTORS,
    driven,
    linear,
    parts_of,
    spins_of,
)
from starhold.parts.contract import DEVIATIONS

linalg: Any = import_module("scipy.linalg")
Array = NDArray[np.float64]

RARELY = Fraction(27, 10_000)
"""The share of orbits in which errors may leave their radii."""
WIDER, LEAST, MORE = 1e-6, 1e-30, 1.0 + 1e-9
"""The share by which the covariance is inflated at each step, and its minimum; and the margin for rounding."""


SHARES = (0.05, 0.05, 0.05, 0.8499, 1e-4)
"""The shares of the probability for the radii of attitude and rate errors of the measurement, and of the rate, the rotation
and of what lags the torque that they cause; with wheels a tenth of each is for what momentum makes of the last two."""


def find_radii(loop: Loop, wired: AttitudeLoop) -> tuple[dict[str, Any], dict[str, Any]] | None:
    """Find the numbers of a claim about noise, and their evidence; None without noise, or where it drives errors or the loop
    without bound."""
    noise = driven_errors(loop.loop)
    if noise is None:
        return None
    near, every, spins = near_target(wired, Fraction(loop.loop.period)), noise.recursion.every, spins_of(wired)
    late = loop.known.late
    if late is not None and late.moment is not None:
        near = near.lagging(Fraction(loop.loop.period), *(known[0] for known in alike(late)))
    errors = [linear(wired.claim, role) for role in (CARRIED, CORRECTED)]
    parts, shapes = parts_of(near, len(errors[0][0][0]), spins), list[Array]()
    widths = dict.fromkeys(parts, 0.0)
    for spin in spins:
        every_step = (driven(near, *pair, spin, Fraction(noise.torque)) for pair in errors)
        carried, corrected = (tuple(map(floats, step)) for step in every_step)
        steps = [carried] * (every - 1) + [corrected]
        size = len(carried[0][0])
        whole, spread = period(steps, size, 0.0 * np.eye(size))
        if float(np.abs(np.linalg.eigvals(whole)).max()) >= 1.0 - 1e-9:
            return None
        more = np.diag(WIDER * np.diag(linalg.solve_discrete_lyapunov(whole, spread)) + LEAST)
        shape = linalg.solve_discrete_lyapunov(*period(steps, size, more))
        for A, B in steps:
            full = A @ shape @ A.T + B @ B.T
            for name, places in parts.items():
                widths[name] = max(widths[name], *(float(np.linalg.eigvalsh(full[k, k])[-1]) for k in places))
            shape = full[:size, :size] + more
            shapes.append((shape + shape.T) / 2.0)
    deviations = [(width + LEAST) ** 0.5 * MORE for width in widths.values()]
    samples = samples_of(loop.loop)

    optimize: Any = import_module("scipy.optimize")

    def radius(width: float, share: float) -> float:
        # Less, for what noise of the magnetic field takes.
        rarely = log(float(RARELY) * (1.0 - 1e-5) * share / samples)

        def missed(k: float) -> float:
            return log(0.8 * (k + 1.0 / k)) - k * k / 2.0 - rarely

        return width * float(optimize.brentq(missed, 1.0, 12.0)) * MORE

    count = len(near.A) // 3
    shares = (
        SHARES[: 2 + count] if spins == [None] else (*(0.9 * x for x in SHARES[: 2 + count]), *(0.1 * SHARES[0],) * count)
    )
    # A random torque takes as much as an error.
    shares = [x * (1.0 - SHARES[0] * bool(noise.torque)) for x in shares]
    often = [len(spins) * len(pair) if k > 1 else 1 for k, pair in enumerate(parts.values())]
    radii = [radius(width, share / n) for width, share, n in zip(deviations, shares, often, strict=True)]
    numbers = {SHARE: RARELY, "samples": samples, "every": every, "noise.attitude": radii[0], "noise.rate": radii[1]}
    if noise.torque:
        numbers |= {DEVIATION: noise.torque, "noise.torque": radius(noise.torque, SHARES[0])}
    if vectors := gaussian_vectors(loop.loop):
        numbers |= {BESIDE: DEVIATIONS} | ({VECTORS: float(vectors)} if vectors > 1 else {})
    evidence = {
        "covariances": [[[float.hex(x) for x in row] for row in pair.tolist()] for pair in shapes],
        "deviations": [str(Fraction(x)) for x in deviations],
        "swayed": [str(Fraction(x)) for x in radii[2:]],
    }
    return numbers, evidence


def period(steps: list[tuple[Array, ...]], size: int, more: Array) -> tuple[Array, Array]:
    """Return the factor of errors over all steps together, and the covariance that the steps add, each with a margin."""
    whole, spread = np.eye(size), np.zeros((size, size))
    for A, B in steps:
        motion, noise = A[:size], B[:size]
        whole, spread = motion @ whole, motion @ spread @ motion.T + noise @ noise.T + more
    return whole, spread
