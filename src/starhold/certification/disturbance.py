"""The claim that a bounded torque from outside moves the end of every motion no further than a bound."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from flint import fmpq

from starhold.algebra.polynomial import exact
from starhold.certification.certificate import EXACT_SIGN, Claim, Obligation
from starhold.certification.convergence import ALMOST, Basin, assumed
from starhold.certification.frame import (
    Cross,
    Frame,
    ShapeError,
    contents,
    decrease,
    felt_share,
    margin,
    take_cross,
)
from starhold.certification.matrices import (
    Rows,
    blocks,
    definite,
    floats,
    greatest,
    identity,
    least,
    number,
    plus,
    root_above,
    scaled,
    spectral_norm_above,
    symmetric,
)
from starhold.certification.motion import at_rest
from starhold.certification.potential import turn_of
from starhold.certification.subject import above, below


def disturbance(basin: Basin) -> Claim | None:
    """The claim with the smallest angle that was found; None where no torque from outside is known or given."""
    motion, frame = basin.motion, basin.frame
    slope = motion.along(motion.lyapunov)  # type: ignore[arg-type]
    felt = abs(felt_share(at_rest(slope)[1]))
    torque = motion.subject.disturbance + felt * motion.subject.modelled_norm
    if torque == 0:
        return None
    torque = exact(above(torque))
    assumptions = assumed(motion.subject, outside=("torque from outside bounded in norm",))
    numbers: dict[str, Any] = {"torque": number(torque)}
    try:
        if frame.potential.even:
            raise ShapeError("V is even in q, for which no bound against torque is built")
        cross = take_cross(motion)
    except ShapeError as reason:
        refused = Obligation("descent", EXACT_SIGN, "undecided", {"reason": str(reason)})
        return Claim("disturbance", numbers, {}, assumptions, (refused,))
    best: Claim | None = None
    for epsilon, rho in _tries(frame, cross):
        found = _claim(basin, cross, torque, epsilon, rho, numbers, assumptions)
        if found is not None and (best is None or found.numbers["angle"] < best.numbers["angle"]):
            best = found
    if best is None:
        refused = Obligation("end", EXACT_SIGN, "undecided", {"reason": "this torque is too large for the bound"})
        return Claim("disturbance", numbers, {}, assumptions, (refused,))
    return best


def _tries(frame: Frame, cross: Cross) -> list[tuple[Any, Any]]:
    """Weights of the cross term, and what they cost in the comparison with V."""
    size = math.sqrt(number(least(frame.P) * frame.s)) / float(np.linalg.norm(floats(cross.J), 2))
    chosen = [exact(float(f"{share:.3g}")) for share in np.geomspace(1e-4, 0.6, 25)]
    return [(exact(float(f"{number(rho) * size * 0.999:.6g}")), rho) for rho in chosen]


def _claim(
    basin: Basin, cross: Cross, torque: Any, epsilon: Any, rho: Any, numbers: dict[str, Any], assumptions: tuple[str, ...]
) -> Claim | None:
    frame, loop = basin.frame, basin.motion.subject.loop
    bound = frame.reach
    if frame.K.terms:
        cubic = least(symmetric(frame.D)) / 2 / frame.cubic
        bound = cubic if bound is None else min(bound, cubic)
    bound = None if bound is None else exact(below(bound))
    Q = decrease(frame, cross, epsilon, bound)
    if not (definite(Q) and definite(margin(frame, cross, epsilon, rho))):
        return None
    q_rate, q_attitude = _shares(Q)
    W = spectral_norm_above(frame.W)
    rest = torque * torque * (W * W / (4 * q_rate) + epsilon * epsilon / (4 * q_attitude))
    rate = torque * W / (2 * q_rate) + root_above(rest / q_rate)
    turn = torque * epsilon / (2 * q_attitude) + root_above(rest / q_attitude)
    if turn >= 1:
        return None
    end = (1 + rho) / (1 - rho) * (greatest(frame.P) * rate * rate / 2 + frame.s * turn * turn)
    stay = None if bound is None else least(frame.P) * bound * bound / 2
    caps = {
        "shortest": frame.s * ALMOST,
        "as_published": frame.s * (2 - turn * turn) * ALMOST,
        "hysteresis": (1 + rho) * frame.s * exact(loop.hysteresis_width) / rho * ALMOST,
    }
    stay = caps[loop.cover] if stay is None else min(stay, caps[loop.cover])
    width = exact(loop.hysteresis_width)
    if loop.cover == "hysteresis" and turn * turn >= 1 - width * width:
        return None
    level = exact(below(stay))
    start = exact(below(level * (1 - rho) / (1 + rho)))
    if end >= start or end >= frame.s:
        return None
    angle = float(turn_of(end / frame.s).upper().mid()) * (1.0 + 1e-15)
    held = contents(start, frame.P, frame.potential)
    told = {
        "level": number(level),
        "start": number(start),
        "turn": held["turn"],
        "rate_start": held["rate"],
        "rate_everywhere": held["rate_everywhere"],
        "angle": angle,
        "rate": above(root_above(2 * end / least(frame.P))),
    }
    stiffness = basin.motion.stiffness
    witness = {
        "stiffness": None if stiffness is None else number(stiffness),
        "epsilon": number(epsilon),
        "rho": number(rho),
        "rate_bound": None if bound is None else number(bound),
        "q_rate": number(q_rate),
        "q_attitude": number(q_attitude),
    }
    proved = tuple(Obligation(name, EXACT_SIGN, "proved") for name in ("descent", "strict", "end", "start"))
    return Claim("disturbance", numbers | told, witness, assumptions, proved)


def _shares(Q: Rows) -> tuple[Any, Any]:
    """Large q_rate and q_attitude with Q - diag(q_rate I, q_attitude I) positive definite, in equal shares of the most
    that each block could give alone."""
    full = floats(Q)
    upper, side, lower = full[:3, :3], full[:3, 3:], full[3:, 3:]
    most_rate = float(np.linalg.eigvalsh(upper - side @ np.linalg.solve(lower, side.T))[0])
    most_attitude = float(np.linalg.eigvalsh(lower - side.T @ np.linalg.solve(upper, side))[0])
    zero = scaled(identity(3), 0)
    share = 1.0
    while True:
        share *= 0.9
        q_rate, q_attitude = exact(share * most_rate), exact(share * most_attitude)
        taken = blocks(identity(3, q_rate), zero, identity(3, q_attitude))
        if definite(plus(Q, taken, fmpq(-1))):
            return q_rate, q_attitude
