"""The claim that a bounded torque from outside moves the end of every motion no further than a bound.

Where the torque is M at most, V + epsilon C falls outside {x.(Q - tau R)x <= M2/(4 tau)}, x = (w, q), for it does work of
at most tau x.Rx + M2/(4 tau). The largest V + epsilon C on that set bounds rate and attitude, and from there on smaller
ellipsoids do.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from flint import arb, fmpq
from numpy.typing import NDArray

from starhold.algebra.polynomial import exact
from starhold.certification.certificate import EXACT_SIGN, Claim, Obligation
from starhold.certification.convergence import ALMOST, Basin, assumed
from starhold.certification.ending import Nearby, ShrinkingStep
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
    block,
    definite,
    floats,
    greatest,
    identity,
    inverse,
    least,
    matmul,
    number,
    plus,
    root_above,
    root_below,
    symmetric_part,
    times,
    transpose,
)
from starhold.certification.motion import at_rest
from starhold.certification.subject import above, below

WIDE = 2.0
"""How many times the smallest angle that of a ball may be, for motions to start in a larger set, if steps then shrink it."""


@dataclass(frozen=True)
class EndBall:
    """The numbers of the first bound, and bounds of |w| and |q| in the end."""

    epsilon: Any
    rho: Any
    tau: Any
    beta: Any
    told: dict[str, Any]
    rate: Any
    turn: Any


def disturbance(basin: Basin) -> Claim | None:
    """The claim with the smallest angle that was found; None where no torque from outside is known or given."""
    motion, frame = basin.motion, basin.frame
    slope = motion.along(motion.lyapunov)  # type: ignore[arg-type]
    felt = abs(felt_share(at_rest(slope)[1]))
    torque = motion.subject.disturbance + felt * motion.subject.modelled_norm
    if torque == 0:
        return None
    torque = exact(above(torque))
    assumptions = assumed(motion.subject, outside=("unknown-outside-torque",))
    numbers: dict[str, Any] = {"torque": number(torque)}

    def refused(name: str, reason: str) -> Claim:
        return Claim(
            "disturbance", numbers, {}, assumptions, (Obligation(name, EXACT_SIGN, "undecided", {"reason": reason}),)
        )

    if frame.potential.even:
        return refused("descent", "V is even in q, for which no bound against torque is built")
    try:
        cross = take_cross(motion)
    except ShapeError as reason:
        return refused("descent", str(reason))
    rate_bound = _rate_bound(frame)
    if rate_bound is not None and rate_bound <= 0:
        return refused("descent", "V' keeps its form at no rate that floats tell from none")
    near = Nearby(motion, torque)
    end: End | None = None
    for guesses in _guesses(frame, cross, rate_bound):
        balls = (_ball(basin, cross, torque, rate_bound, *guess) for guess in guesses)
        ball = next((found for found in balls if found is not None), None)
        if ball is not None:
            end = _shrunk(near, ball)
            if end.steps:
                break
    if end is None:
        return refused("end", "this torque is too large for the bound")
    ball, steps, rate, turn = end
    angle = float((2 * arb(turn).asin()).upper().mid()) * (1.0 + 1e-15)
    stiffness = motion.stiffness
    witness = {
        "stiffness": None if stiffness is None else number(stiffness),
        "epsilon": number(ball.epsilon),
        "rho": number(ball.rho),
        "rate_bound": None if rate_bound is None else number(rate_bound),
        "tau": number(ball.tau),
        "beta": number(ball.beta),
        "shift": None if not steps or near.gyroscopic_torque.shift is None else number(near.gyroscopic_torque.shift),
        "steps": [{"form": floats(s.S).tolist(), "decay": number(s.decay), "spread": number(s.spread)} for s in steps],
    }
    proved = tuple(Obligation(name, EXACT_SIGN, "proved") for name in ("descent", "strict", "end", "start"))
    told = {**ball.told, "angle": angle, "rate": above(rate)}
    return Claim("disturbance", numbers | told, witness, assumptions, proved)


class End(NamedTuple):
    """A ball, the steps that make it smaller, and the bounds of |w| and |q| that they leave."""

    ball: EndBall
    steps: list[ShrinkingStep]
    rate: Any
    turn: Any


def _shrunk(near: Nearby, ball: EndBall) -> End:
    try:
        return End(ball, *near.steps(ball.rate, ball.turn))
    except ShapeError:
        # The ball is all there is.
        return End(ball, [], ball.rate, ball.turn)


def _rate_bound(frame: Frame) -> Any | None:
    """The rate up to which V' has the form that is used and keeps half of its damping."""
    bound = frame.reach
    if frame.K.terms:
        cubic = least(symmetric_part(frame.D)) / 2 / frame.cubic
        bound = cubic if bound is None else min(bound, cubic)
    return None if bound is None else exact(below(bound))


def _push(frame: Frame, epsilon: Any) -> Rows:
    """R with |W'w + epsilon q|2 = x.Rx, W'w + epsilon q being what a torque from outside does work on."""
    W = frame.W
    return block(matmul(W, transpose(W)), times(epsilon, W), identity(3, epsilon * epsilon))


def _size(frame: Frame, cross: Cross, epsilon: Any, share: Any) -> Rows:
    """H with x.Hx = w.Pw/2 + epsilon q.Jw + share s q2."""
    return block(times(fmpq(1, 2), frame.P), times(epsilon / 2, transpose(cross.J)), identity(3, share * frame.s))


def _guesses(frame: Frame, cross: Cross, bound: Any | None) -> Iterator[list[tuple[Any, Any, Any]]]:
    """epsilon, rho and tau of balls in floats: those with small rho, from which much is started, but an angle of at most
    `WIDE` times the smallest; then all by their angles."""
    size = math.sqrt(number(frame.s)) / float(
        np.linalg.norm(np.linalg.solve(np.linalg.cholesky(floats(frame.P)), floats(cross.J)), 2)
    )
    found: list[tuple[float, tuple[Any, Any, Any]]] = []
    for share in np.geomspace(1e-4, 0.6, 33):
        rho = exact(float(f"{share:.3g}"))
        epsilon = exact(float(f"{number(rho) * size * 0.999:.6g}"))
        Q, R = floats(decrease(frame, cross, epsilon, bound)), floats(_push(frame, epsilon))
        H = floats(_size(frame, cross, epsilon, fmpq(1, 2)))
        if np.linalg.eigvalsh(Q)[0] <= 0.0:
            continue
        try:
            most = 1.0 / float(_relative(R, Q)[-1])
            tries = [(float(_relative(Q - tau * R, H)[0]) * tau, tau) for tau in most * np.linspace(0.05, 0.95, 19)]
            fall, tau = max(tries)
        except np.linalg.LinAlgError:
            # Definite, but not in floats.
            continue
        if fall > 0.0:
            # The square of the angle, up to a factor.
            angle = 1.0 / (fall * (1.0 - share * share))
            found.append((angle, (epsilon, rho, exact(float(f"{tau:.6g}")))))
    smallest = min((angle for angle, _ in found), default=0.0)
    yield [guess for angle, guess in found if angle <= WIDE**2 * smallest]
    yield [guess for _, guess in sorted(found, key=lambda pair: pair[0])]


def _ball(basin: Basin, cross: Cross, torque: Any, bound: Any | None, epsilon: Any, rho: Any, tau: Any) -> EndBall | None:
    """The ball that these numbers show, if they show one."""
    frame, loop = basin.frame, basin.motion.subject.loop
    left = plus(decrease(frame, cross, epsilon, bound), _push(frame, epsilon), -tau)
    if not (definite(left) and definite(margin(frame, cross, epsilon, rho))):
        return None
    # All of |q| that V + epsilon C may rise at.
    room = torque * torque / (4 * tau)
    turn = root_above(room * greatest([row[3:] for row in inverse(left)[3:]]))
    width = exact(loop.hysteresis_width)
    if turn >= 1 or (loop.sign_policy == "hysteresis" and turn * turn >= 1 - width * width):
        return None
    # There s (1 - q0) = s q2/(1 + q0), for q0 < 0 is outside the level set.
    H = _size(frame, cross, epsilon, 1 / (1 + root_below(1 - turn * turn)))
    beta = _share(left, H)
    if beta is None:
        return None
    end = room / beta
    stay = None if bound is None else least(frame.P) * bound * bound / 2
    caps = {
        "shortest": frame.s * ALMOST,
        "as_published": frame.s * (2 - turn * turn) * ALMOST,
        "hysteresis": (1 + rho) * frame.s * width / rho * ALMOST,
    }
    level = exact(below(caps[loop.sign_policy] if stay is None else min(stay, caps[loop.sign_policy])))
    start = exact(below(level * (1 - rho) / (1 + rho)))
    # What V + epsilon C is at least: over every w (spring)(1 - q0), and over every q w.(lean)w/2.
    J, square = cross.J, epsilon * epsilon
    spring = frame.s - square * greatest(matmul(matmul(J, inverse(frame.P)), transpose(J)))
    lean = least(plus(frame.P, times(square / frame.s, matmul(transpose(J), J)), -1))
    if end >= (1 + rho) * start or end >= spring or lean <= 0:
        return None
    held = contents(start, frame.P, frame.potential)
    told = {
        "level": number(level),
        "start": number(start),
        "slew_angle": held["slew_angle"],
        "rate_start": held["rate"],
        "rate_everywhere": held["rate_everywhere"],
    }
    cosine = 1 - end / spring
    return EndBall(epsilon, rho, tau, beta, told, root_above(2 * end / lean), root_above(1 - cosine * cosine))


def _share(left: Rows, H: Rows) -> Any | None:
    """Nearly the largest beta with left - beta H positive definite; None where it is not positive."""
    guess = float(_relative(floats(left), floats(H))[0])
    for less in (1e-12, 1e-10, 1e-8, 1e-6, 1e-3):
        beta = exact(guess * (1.0 - less))
        if beta > 0 and definite(plus(left, H, -beta)):
            return beta
    return None


def _relative(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[Any]:
    """The eigenvalues of b^-1 a, b being positive definite."""
    root = np.linalg.inv(np.linalg.cholesky(b))
    return np.linalg.eigvalsh(root @ a @ root.T)
