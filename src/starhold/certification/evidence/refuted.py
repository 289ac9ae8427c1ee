"""Finds, in floats, states at which a condition of a claim about an attitude loop fails, for the kernel to refute."""

from collections.abc import Iterator, Sequence
from fractions import Fraction
from itertools import product
from math import isfinite, isinf, pi, tan

import numpy as np
from numpy.typing import NDArray

from starhold.certification.evidence.attitude import CONVERGES, SAMPLED, SLIDING, Loop
from starhold.certification.evidence.finding import read
from starhold.certification.evidence.recorded import ASKED
from starhold.certification.evidence.terms import valued
from starhold.certification.matrices import number
from starhold.certification.subject import perigee
from starhold.kernel.loops import AttitudeLoop, around
from starhold.kernel.numbers import RefusedError
from starhold.kernel.polynomials import Poly
from starhold.kernel.theorems.refuted import State, slope
from starhold.parts.craft import tensor
from starhold.parts.environments.gravity_gradient import gravity_gradient

RISES, RISES_NEAR, NEGATIVE = "V rises", "V rises near the target", "V is negative"
EXCEEDS, UNSETTLED = "asks for more than the limit", "does not settle between samples"
PUSHED, AWAY = "is pushed off its surface", "turns away on its surface"
REFUTING = (RISES, RISES_NEAR, NEGATIVE, EXCEEDS, UNSETTLED, PUSHED, AWAY)
"""The theorems that refute."""
Floats = NDArray[np.float64]
VARIABLES = ("w1", "w2", "w3", "q1", "q2", "q3")
TRIES = 10_000
"""The number of states tried at each rate."""
PIECES = 64
"""The most pieces of V'."""


def find_refuted(loop: Loop, turn: float | None = None, rate: float | None = None) -> None:
    """Find what refutes the claims without evidence. turn: the rotation that the set within the limits should contain (rad);
    rate: up to which motions should converge from every attitude (rad/s, inf for any)."""
    flown, shown = loop.loop, [claim["theorem"] for claim in loop.claims]
    if flown.law.lyapunov is not None:
        ends = [claim for claim in loop.claims if claim["theorem"].startswith(CONVERGES)]
        if not ends or (rate is not None and all("level" in claim["numbers"] for claim in ends)):
            _ = against_near(loop) or (rate is not None and against_far(loop, rate))
        limited = [claim for claim in ends if {"limit", "limit.norm"} & claim["numbers"].keys()]
        if ends and turn is not None and not limited and flown.wheels is None:
            _ = against_limit(loop, loop.lyapunov(), turn) or against_limit(loop, ends[0]["programs"]["lyapunov"], turn)
    if hasattr(flown.law.module, "surface") and SLIDING not in shown and flown.wheels is None:
        against_surface(loop)
    against_sampling(loop)


def against_sampling(loop: Loop) -> None:
    """Show that the loop is unstable with the torque held between samples."""
    shown = any(claim["theorem"] == SAMPLED for claim in loop.claims)
    if not shown and any(abs(complex(*z)) > 1.0 for z in loop.eigenvalues):
        loop.try_to_show(loop.claim(UNSETTLED, [], None, period=loop.loop.period), {})


def state(t: Sequence[float] | Floats, w: Sequence[float] | Floats = (0.0, 0.0, 0.0)) -> dict[str, float]:
    """Return the numbers of a state, of few digits."""
    pairs = (*zip(("turn.0", "turn.1", "turn.2"), t, strict=True), *zip(("rate.0", "rate.1", "rate.2"), w, strict=True))
    return {name: float(f"{x:.9g}") for name, x in pairs}


def wired(loop: Loop, V: str) -> AttitudeLoop:
    """Return the loop as the kernel has it."""
    return AttitudeLoop(read(loop.claim(RISES, [], V), loop.by_digest))


# --- V ----------------------------------------------------------------------------------------------------------------


def against_near(loop: Loop) -> bool:
    """Show that V is negative, or increases, arbitrarily near the target."""
    V = loop.lyapunov()
    exact = wired(loop, V)
    try:
        theorems = [(NEGATIVE, -exact.lyapunov)]
        u = [around(cases, exact.on_target | exact.still).value for cases in exact.law]
        theorems.append((RISES_NEAR, slope(exact, u)))
    except RefusedError as reason:
        loop.failed[RISES_NEAR] = str(reason)
        return False
    return any(
        loop.try_to_show(loop.claim(theorem, [], V, **numbers), {}) for theorem, p in theorems for numbers in small_states(p)
    )


def small_states(p: Poly) -> Iterator[dict[str, float]]:
    """Yield states, from large to small, along which the quadratic part of p is largest, where it is positive: rates alone,
    rotations alone, both."""
    form = quadratic(p)
    for part in (slice(0, 3), slice(3, 6), slice(0, 6)):
        values, vectors = np.linalg.eigh(form[part, part])
        if values[-1] > 0.0:
            direction = np.zeros(6)
            direction[part] = vectors[:, -1]
            for size in 10.0 ** -np.arange(8.0):
                # Near the target the rotation is twice q.
                yield state(0.5 * size * direction[3:], size * direction[:3])


def quadratic(p: Poly) -> Floats:
    """Return the matrix of the quadratic part of p around rest on target, in (w, q)."""
    around = p.at({"q0": Poly({(): Fraction(1), **{(name, name): Fraction(-1, 2) for name in VARIABLES[3:]}})})
    slopes = [[around.slope(a).slope(b).terms.get((), 0) for b in VARIABLES] for a in VARIABLES]
    return 0.5 * np.array(slopes, dtype=np.float64)


def against_far(loop: Loop, rate: float) -> bool:
    """Find a state at which V increases, up to this rate: on target first, which is the clearest case."""
    V = loop.lyapunov()
    more = {} if isinf(rate) else {"fastest": rate}
    lengths = 10.0 ** np.array(sorted(range(-6, 19), key=abs))
    if more:
        lengths = rate * np.append(np.linspace(0.99999, 0.1, 10), np.logspace(-2, -6, 5))
    exact, random = wired(loop, V), np.random.default_rng(0)
    w, t = (random.normal(size=(3, TRIES)) for _ in range(2))
    w /= np.linalg.norm(w, axis=0)
    t *= random.uniform(size=TRIES) / np.linalg.norm(t, axis=0)
    try:
        sides = list(product(*exact.law))
        slopes = [slope(exact, [case.value for case in side]) for side in sides[:PIECES]]
    except RefusedError as reason:
        loop.failed[RISES] = str(reason)
        return False
    for turned, length in product((0.0 * t, t), lengths):
        values = named(turned, length * w)
        for side, p in zip(sides, slopes, strict=False):
            rises = valued(p, values)
            for condition, truth in {guard for case in side for guard in case.guards}:
                rises[(valued(Poly(dict(condition)), values) > 0.0) != truth] = 0.0
            place = int(np.argmax(rises))
            steepest = state(turned[:, place], length * w[:, place])
            if rises[place] > 0.0 and loop.try_to_show(loop.claim(RISES, [], V, **steepest, **more), {}):
                return True
    return False


def named(t: Floats, w: Floats) -> dict[str, Floats]:
    """Return many states (3, n) at once, by the names of their variables."""
    square = (t * t).sum(axis=0)
    q = np.vstack([1.0 - square, 2.0 * t]) / (1.0 + square)
    return dict(zip(("q0", "q1", "q2", "q3", "w1", "w2", "w3"), (*q, *w), strict=True))


# --- limits -----------------------------------------------------------------------------------------------------------


def against_limit(loop: Loop, V: str, turn: float) -> bool:
    """Find a state of the set of V that holds all rests turned so far, at which the torque exceeds its limit."""
    limit = loop.loop.craft.torque_limit
    exact = wired(loop, V)
    angle = min(turn, pi)
    # A state is sought along the slopes at rest, which say little of a law with cases.
    if loop.loop.limit == "none" or not isfinite(limit) or any(len(cases) > 1 for cases in exact.law):
        return False
    name = "limit" if loop.loop.limit == "axis" else "limit.norm"
    form = -quadratic(-exact.lyapunov)
    P = form[:3, :3]
    axis = np.linalg.eigh(form[3:, 3:])[1][:, -1]
    rest = tan(angle / 4.0) * (1.0 - 1e-9) * axis
    level = float(exact.lyapunov.at(at_rest(rest)).number)
    for u in exact.u:
        slopes = np.array([float(u.slope(v).at(exact.on_target | exact.still).number) for v in VARIABLES])
        damp, stiff = np.linalg.solve(P, slopes[:3]), slopes[3:] / max(float(np.linalg.norm(slopes[3:])), 1e-300)
        damp /= max(float(np.sqrt(damp @ P @ damp)), 1e-300)
        for share in np.linspace(0.0, 1.0, 201):
            t = tan(share * angle / 4.0) * stiff
            left = level - float(exact.lyapunov.at(at_rest(t)).number)
            if left < 0.0:
                continue
            beside = state(t, (1.0 - 1e-7) * np.sqrt(left) * damp)
            numbers = {name: limit, "angle": angle, **beside, **{f"rest.{k}": x for k, x in enumerate(rest)}}
            if loop.try_to_show(loop.claim(EXCEEDS, [], V, **numbers), {}):
                return True
    return False


def at_rest(t: Floats) -> dict[str, Fraction]:
    """Return rest after a turn, as the kernel has it."""
    return State([Fraction(float(x)) for x in t], [Fraction(0)] * 3).values


# --- a surface --------------------------------------------------------------------------------------------------------


def against_surface(loop: Loop) -> bool:
    """Find an external torque that exceeds the law's switching torque, or a motion on the surface away from the target."""
    roles, flown = loop.roles, loop.loop
    roles["surface"] = loop.add(flown.law.module.surface, measurement=ASKED, gains=flown.gains)
    try:
        for i, (most, place) in enumerate(pushes(loop)):
            beside = (1e-3 + 2.0 * float(getattr(flown.gains, "boundary_layer", 0.0))) * np.eye(3)[i]
            numbers = {f"outside.{i}": most, **state(np.zeros(3), beside)}
            if loop.try_to_show(loop.claim(PUSHED, [], None, **numbers), {}):
                loop.pushed_at = place
                return True
        K = tensor(flown.gains.surface_gain)
        axis = np.linalg.eigh(0.5 * (K + K.T))[1][:, 0]
        turned = {name: x for name, x in state(0.5 * axis).items() if name.startswith("turn")}
        return loop.try_to_show(loop.claim(AWAY, [], None, **turned), {})
    finally:
        del roles["surface"]


def pushes(loop: Loop) -> list[tuple[float, list[float] | None]]:
    """Return a torque about each axis from somewhere on the orbit, slightly less than the largest, and the position."""
    flown, most = loop.loop, number(loop.known.disturbance)
    if not flown.has("gravity-gradient"):
        return [(most, None)] * 3
    distance = float(perigee(flown)[0].mid())
    directions = np.random.default_rng(0).normal(size=(2000, 3))
    directions *= distance / np.linalg.norm(directions, axis=1, keepdims=True)
    strength = 3.0 * flown.craft.gravity / distance**5
    torques = np.array([gravity_gradient(tuple(d), strength, flown.craft) for d in directions.tolist()])
    # Floats found the position.
    return [
        ((most + float(along_axis.max())) * (1.0 - 1e-9), directions[int(np.argmax(along_axis))].tolist())
        for along_axis in torques.T
    ]
