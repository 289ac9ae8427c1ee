"""Looks for a V whose level set contains a start and demands little torque.

Among all V that decrease near the target, the energy with the law's own potential is not the one to begin with where the
torque is limited: its level sets contain rates that no motion from rest reaches. With a softer potential they contain lower
ones.
"""

from collections.abc import Sequence
from itertools import product
from math import inf, pi, sin
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.polynomial import exact
from starhold.certification.evidence.terms import valued
from starhold.certification.matrices import floats
from starhold.kernel.held import Held
from starhold.kernel.numbers import inverse
from starhold.kernel.regions import RATE, STATE, TURN
from starhold.kernel.theorems.limits import allocated

Array = NDArray[np.float64]

SOFT = (1.0, 0.85, 0.7, 0.6, 0.5, 0.42, 0.35, 0.29, 0.24, 0.2)
LEANS = (0.1, 0.18, 0.3, 0.45, 0.6, 0.75, 0.9)
"""The shares of the potential that are tried, and epsilon in sqrt(the potential's stiffness / the largest moment)."""
WITHIN = (0.98, 0.88, 0.75, 0.6)
"""Shares of a limit that are tried for the torque of the linear motion: nonlinear terms, momentum and errors add to it."""

STATES, AROUND = 2000, "erah"
"""At how many states of a set torque is examined, and what is around it: a torque that the law is given, the target's rate
and acceleration, and the wheels' momentum."""


class Shape(NamedTuple):
    """V = w.Mw/2 + epsilon q.Mw and a share of the potential; M is the inertia, or a moment about all axes."""

    epsilon: float
    soft: float = 1.0
    moment: float | None = None


def largest_in(motion: Held, angle: float, rate: float) -> float:
    """Return a bound of V over states turned by up to an angle (rad) at up to a rate (rad/s)."""
    return float(largest(floats(motion.form(motion.s / 2))[None], motion.even, angle, rate)[0])


def largest(P: Array, even: bool, angle: float, rate: float) -> Array:
    """Return, for matrices on (w, q) of V near the target, bounds of V at a start."""
    half = min(angle, np.pi) / 2.0
    away = sin(half) if even else 2.0 * sin(half / 2.0)
    wide, leant, stiff = (np.linalg.norm(P[:, a, b], 2, (1, 2)) for a, b in ((RATE, RATE), (RATE, TURN), (TURN, TURN)))
    return np.asarray(stiff * away**2 + wide * rate**2 + 2.0 * leant * rate * sin(half), dtype=np.float64)


def shares(motion: Held, limits: dict[str, Any]) -> Array:
    """Return rows whose products with the torque are shares of its limits."""
    rows = [np.zeros((0, 3))]
    rows += [np.eye(3) / x for name, x in limits.items() if name.startswith("limit")]
    count = next(k for k in range(1000) if f"wheel.{k}.axis.0" not in motion.loop.claim.subject)
    motors: list[Any] = [limits.get(f"motors.{k}") for k in range(count)]
    if any(motors):
        turned, _ = allocated(motion.loop, [None if x is None else exact(x) for x in motors])
        rows.append(np.array([row / x for row, x in zip(floats(turned), motors, strict=True) if x]))
    return np.concatenate(rows)


def falls(motion: Held, P: Array, acceleration: Array, q0: Array) -> tuple[Array, Array]:
    """Return, for matrices P of V, how definite -V' is, as a share of its diagonal, with the acceleration near the target
    and q turned to this q0, and by what share V decreases at least in a unit of time. The margin is for nonlinear terms,
    momentum and sampling."""
    bent = any("q0" in m and not m.isdisjoint(STATE[TURN]) for p in motion.u for m in map(frozenset, p.terms))
    flow, turned = np.zeros(P.shape), q0[:, None, None]
    flow[:, RATE, RATE], flow[:, RATE, TURN] = acceleration[:, RATE], acceleration[:, TURN] * (turned if bent else 1.0)
    flow[:, TURN, RATE] = np.eye(3) / 2.0 * turned
    slope = P @ flow
    if not motion.even:
        # 2 p (1 - q0) grows with q.w alone.
        slope[:, TURN, RATE] += P[:, TURN, TURN] * (1.0 - turned) / 2.0
    form = -(slope + slope.transpose(0, 2, 1))
    diagonal = np.einsum("nii->ni", form)
    # Where it is not positive, no scale makes the form definite.
    scale = np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    within = np.linalg.inv(np.linalg.cholesky(P))
    forms = form / scale[:, :, None] / scale[:, None, :], within @ form @ within.transpose(0, 2, 1)
    definite, pace = (np.asarray(np.linalg.eigvalsh(one)[:, 0], dtype=np.float64) for one in forms)
    return definite, pace


def soft(motion: Held, limits: dict[str, Any], angle: float, rate: float, others: Sequence[Shape]) -> list[Shape]:
    """Return shapes of V whose level set around a start demands about no more than the limits: for each of some shares the
    least softened ones, and of them the most definite; and others, if theirs does so. Those that decrease fastest near the
    target come first. motion: with the potential as it is."""
    J, torque = floats(motion.loop.given), floats(motion.near.torque)
    potential, used_by = floats(motion.form(motion.s / 2))[TURN, TURN], shares(motion, limits)
    loads = used_by @ torque
    stiff, moment = float(np.linalg.eigvalsh(potential)[-1]), float(np.trace(J)) / 3.0
    slow, inner = (stiff / float(np.linalg.eigvalsh(J)[-1])) ** 0.5, floats(inverse(motion.loop.given))
    shapes = [
        Shape(float(f"{lean * slow:.4g}"), share, about)
        for share, lean, about in product(SOFT, LEANS, (None, float(f"{moment:.4g}")))
    ]
    shapes = [*dict.fromkeys([*shapes, *others])]
    forms = np.zeros((len(shapes), 6, 6))
    for one, shape in zip(forms, shapes, strict=True):
        M = J if shape.moment is None else shape.moment * np.eye(3)
        one[RATE, RATE], one[TURN, TURN] = M / 2.0, shape.soft * potential
        one[RATE, TURN] = one[TURN, RATE] = shape.epsilon / 2.0 * M
    definite = np.linalg.eigvalsh(forms)[:, 0] > 0.0
    shapes, P = [s for s, d in zip(shapes, definite, strict=True) if d], forms[definite]
    level = largest(P, motion.even, angle, rate)
    used = np.sqrt(level * np.einsum("li,nij,lj->nl", loads, np.linalg.inv(P), loads).max(1, initial=0.0))
    # At rest, in each direction: the least V over the rates has this form in q.
    stiff = np.linalg.eigvalsh(P[:, TURN, TURN] - P[:, TURN, RATE] @ np.linalg.solve(P[:, RATE, RATE], P[:, RATE, TURN]))
    far = level / stiff[:, 0]
    least = np.sqrt(np.maximum(1.0 - far, 0.0)) if motion.even else 1.0 - far / 2.0
    margins, paces = map(np.minimum, *(falls(motion, P, inner @ torque, q0) for q0 in (np.ones(len(P)), least)))
    margins[least <= -(not motion.even)] = -np.inf
    softness, ball = np.array([s.soft for s in shapes]), np.array([s.moment is not None for s in shapes])
    chosen = {k for k, s in enumerate(shapes) if s in others and margins[k] > 0.0}
    for share, about in product(WITHIN, (False, True)):
        fit = (used < share) & (margins > 0.0) & (ball == about)
        # With one moment about all axes, the gyroscopic torque does work: there the most definite one is taken.
        fit &= about | (softness == softness[fit].max(initial=0.0))
        if fit.any():
            chosen.add(int(np.argmax(np.where(fit, margins, -np.inf))))
    longest, ordered = limits.get("limit.norm", inf), sorted(chosen, key=lambda k: -paces[k])
    return [shapes[k] for k in ordered if not asks_more(motion, P[k], level[k], used_by, longest)]


def asks_more(motion: Held, P: Array, level: float, used_by: Array, longest: float) -> bool:
    """Return whether the law commands more than its limits at some state of {V <= level} and of what is around it. P: the
    matrix of V near the target; used_by: the result of `shares`; longest: the limit of the torque's norm."""
    r = np.random.default_rng(1)
    along, axes, *around = (v / np.linalg.norm(v, axis=0) for v in r.normal(size=(2 + len(AROUND), 3, STATES)))
    x, inside = on_border(P, motion.even, level, along, axes, r.uniform(0.0, pi, STATES))
    rows = [(f"{letter}{k + 1}", v) for letter, one in zip(AROUND, around, strict=True) for k, v in enumerate(one)]
    x |= {name: float(motion.others[name]) * v for name, v in rows if name in motion.others}
    u = np.array([valued(p, x) + np.zeros(STATES) for p in motion.loop.u])
    used = np.abs(used_by @ u).max(axis=0, initial=0.0)
    used = np.maximum(used, np.linalg.norm(u, axis=0) / longest)
    return bool(used[inside].max(initial=0.0) > 1.0)


def on_border(
    P: Array, even: bool, level: float, along: Array, axes: Array, half: Array, slow: Array | None = None
) -> tuple[dict[str, Array], NDArray[np.bool_]]:
    """Return states turned by twice the angles `half` about axes, which turn as fast along directions as {V <= level} lets
    them, and where there are any. P: the matrix of V near the target; slow: x, where w.xw is at most 1."""
    q, far = np.sin(half) * axes, 1.0 - np.cos(half)
    # V is quadratic in the rate along each direction.
    a, b = (along * (P[RATE, RATE] @ along)).sum(0), (along * (P[RATE, TURN] @ q)).sum(0)
    turned = q if even else q * np.sqrt(2.0 * far) / np.maximum(np.sin(half), 1e-300)
    c = (turned * (P[TURN, TURN] @ turned)).sum(0) - level
    inside = b * b >= a * c
    fast = (np.sqrt(np.where(inside, b * b - a * c, 0.0)) - b) / a
    if slow is not None:
        fast = np.minimum(fast, 1.0 / np.sqrt((along * (slow @ along)).sum(0)))
    names: list[str] = ["q0", *STATE[TURN], *STATE[RATE]]
    return dict(zip(names, (np.cos(half), *q, *(fast * along)), strict=True)), inside
