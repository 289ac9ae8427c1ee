"""The claim that the linear loop stays stable when the torque is held for a control period."""

from __future__ import annotations

from typing import Any

import numpy as np
from flint import arb, fmpq_mat

from starhold.algebra.polynomial import exact
from starhold.certification.assumptions import UNLIMITED, WHEELS
from starhold.certification.certificate import EXACT_SIGN, Claim, Obligation
from starhold.certification.matrices import (
    Rows,
    characteristic_roots,
    definite,
    floats,
    identity,
    inverse,
    matmul,
    number,
    plus,
    times,
    transpose,
)
from starhold.certification.motion import Motion, ShapeError
from starhold.certification.subject import above

ASSUMPTIONS = (
    "rigid-body",
    "inertia-as-given",
    "exact-measurement",
    "ideal-actuators",
    "linear-motion",
    UNLIMITED,
    "no-outside-torque",
)
STILL_WHEELS = "no-wheels"
ROOTS = "certified roots"
APART = "inertia, gains and period are too far apart in size"
MOST_BITS = 1_000
"""Most bits in the numbers of a characteristic polynomial whose roots are told apart: everyday ones have 500; gains of
1e-300 make 4000, which takes minutes."""


def sampling(motion: Motion) -> Claim | None:
    """The claim for the loop's own period, and the longest period; undecided for a law that switches at rest on target, None
    for another that is not linear there."""
    loop = motion.subject.loop
    assumptions = ASSUMPTIONS
    if loop.wheels is not None:
        assumptions = (*(WHEELS if a == UNLIMITED else a for a in ASSUMPTIONS), STILL_WHEELS)
    J, period = motion.subject.inertia, exact(loop.period)

    def undecided(reason: str) -> Claim:
        numbers = {"period": number(period), "longest": None, "every_shorter": False}
        found = Obligation("stable at the period", ROOTS, "undecided", {"reason": reason})
        return Claim("sampling", numbers, {}, assumptions, (found,))

    try:
        rate, attitude = motion.linear()
    except ShapeError as reason:
        return undecided(str(reason))
    except ArithmeticError:
        return None
    if _bits(stepped(J, rate, attitude, period)) > MOST_BITS:
        return undecided(f"{APART} for certified roots")
    roots = sampled_roots(J, rate, attitude, period)
    values = sorted(
        (complex(number(r.real), number(r.imag)) for r, n in roots for _ in range(n)), key=lambda z: (-abs(z), z.imag)
    )
    radius, stable = _radius(roots)
    numbers: dict[str, Any] = {
        "period": number(period),
        "radius": radius,
        "eigenvalues": [[z.real, z.imag] for z in values],
    }
    if not stable:
        worst = (
            {"eigenvalue": [values[0].real, values[0].imag]}
            if any(arb(abs(root)) >= 1 for root, _ in roots)
            else {"reason": "a root on the unit circle is not excluded"}
        )
        outcome = "refuted" if "eigenvalue" in worst else "undecided"
        refused = Obligation("stable at the period", ROOTS, outcome, worst)
        return Claim("sampling", numbers | {"longest": None, "every_shorter": False}, {}, assumptions, (refused,))
    longest = _longest(J, rate, attitude, period)
    between = dissipative(J, rate, attitude, longest)
    obligations = [Obligation("stable at the period", ROOTS, "proved"), Obligation("stable at the longest", ROOTS, "proved")]
    if between:
        obligations.append(Obligation("stable in between", EXACT_SIGN, "proved"))
    numbers |= {"longest": number(longest), "every_shorter": between}
    return Claim("sampling", numbers, {}, assumptions, tuple(obligations))


def stepped(J: Rows, rate: Rows, attitude: Rows, period: Any) -> Rows:
    """The matrix of a step: w+ = w + h J^-1 u, q+ = q + h w/2 + h2 J^-1 u/4 with u = -rate w - attitude q."""
    turn = inverse(J)
    pull = [[*a, *b] for a, b in zip(matmul(turn, rate), matmul(turn, attitude), strict=True)]
    still = [[*a, *b] for a, b in zip(identity(3, period / 2), identity(3), strict=True)]
    turning = [[*a, *b] for a, b in zip(identity(3), times(0, identity(3)), strict=True)]
    return [*plus(turning, pull, -period), *plus(still, pull, -period * period / 4)]


def sampled_roots(J: Rows, rate: Rows, attitude: Rows, period: Any) -> list[tuple[Any, int]]:
    """Enclosures of the eigenvalues of a step, with multiplicities."""
    return characteristic_roots(stepped(J, rate, attitude, period))


def _bits(step: Rows) -> int:
    """The length of the longest number of a matrix's characteristic polynomial."""
    found: Any = fmpq_mat(step).charpoly()
    return max(int(part).bit_length() for c in found.coeffs() for part in (c.p, c.q))


def _radius(roots: list[tuple[Any, int]]) -> tuple[float, bool]:
    """An upper bound of the spectral radius, and whether it is surely below 1."""
    sizes = [arb(abs(root)) for root, _ in roots]
    bound = max(above(exact(float(size.upper().mid()))) * (1.0 + 1e-14) for size in sizes)
    return bound, bound < 1.0


def _longest(J: Rows, rate: Rows, attitude: Rows, period: Any) -> Any:
    """The longest period, to nine digits, that is shown to keep the loop stable; every shorter one where the loop is
    dissipative, else only between the given period and the first that is not."""

    def good(h: float) -> bool:
        return _float_radius(J, rate, attitude, h) < 1.0

    low, high = number(period), 2.0 * number(period)
    while good(high):
        low, high = high, 2.0 * high
        if high > 1e12 * number(period):
            break
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if good(middle) else (low, middle)
    for less in (1e-9, 1e-7, 1e-5, 1e-3):
        found = exact(float(low * (1.0 - less)))
        if found > period and _radius(sampled_roots(J, rate, attitude, found))[1]:
            return found
    return period


def _float_radius(J: Rows, rate: Rows, attitude: Rows, h: float) -> float:
    turn = np.linalg.inv(floats(J))
    pull = np.hstack([turn @ floats(rate), turn @ floats(attitude)])
    step = np.block([[np.eye(3), np.zeros((3, 3))], [0.5 * h * np.eye(3), np.eye(3)]])
    step -= np.vstack([h * pull, 0.25 * h * h * pull])
    return float(np.abs(np.linalg.eigvals(step)).max())


def dissipative(J: Rows, rate: Rows, attitude: Rows, period: Any) -> bool:
    """Whether the loop is surely stable for every period up to this one: with z = (1 + x)/(1 - x) up to a factor it is
    (J - h rate/2) x2 + (rate - h attitude/4) x + attitude/2 = 0, whose coefficients are then symmetric and definite."""
    return (
        rate == transpose(rate)
        and attitude == transpose(attitude)
        and definite(attitude)
        and definite(plus(J, rate, -period / 2))
        and definite(plus(rate, attitude, -period / 4))
    )
