"""Finds all claims about an attitude loop that the kernel can check; here those near rest and on sliding surfaces."""

from dataclasses import replace
from fractions import Fraction
from math import asin, floor, log10, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from starhold.certification.evidence.attitude import (
    ANY_ANGLE,
    CONVERGES,
    EVENLY,
    NEARBY,
    SAMPLED,
    SLIDING,
    STRICTLY,
    Loop,
    descent,
)
from starhold.certification.evidence.finding import obligations
from starhold.certification.evidence.isotropic import find_isotropic
from starhold.certification.evidence.recorded import ASKED, sign_words
from starhold.certification.evidence.refuted import against_sampling
from starhold.certification.evidence.squares import combined, largest_number, posed, rounded, settled, solved
from starhold.certification.matrices import floats, fraction
from starhold.certification.subject import Subject
from starhold.kernel.loops import HANDED, HYSTERESIS, MOVING, OUTSIDE, SHORTEST, WHEELS
from starhold.kernel.numbers import RefusedError, plus, scalar, times
from starhold.kernel.rules import Contracts, Definite, Squares
from starhold.parts.craft import tensor

ENDING = (CONVERGES, EVENLY, STRICTLY)
"""Theorems about ultimate bounds for the given body."""
LIMITS = {"limit", "limit.norm", "motors.0"}


def find_claims(subject: Subject, turn: float | None = None, tolerance: float | None = None) -> Loop:
    """Find the claims that can be proved: the ultimate bound, for other inertias, within limits, between samples. turn: the
    rotation that the set within the limits must contain (rad); tolerance: of the inertia, by default the largest."""
    loop, flown = Loop(subject), subject.loop
    if not flown.remembers:
        if flown.law.lyapunov is not None:
            loop.show_end(turn)
            if not any("whatever" in claim["theorem"] for claim in loop.claims):
                find_near(loop, tolerance)
        if hasattr(flown.law.module, "single_root"):
            find_isotropic(loop)
        if hasattr(flown.law.module, "surface"):
            find_sliding(loop)
        find_sampled(loop)
    return loop


def find_taken_over(subject: Subject, rate: float | None, angle: float | None) -> Loop | None:
    """Find the claim that motions which begin at up to a rate (rad/s) and an angle (rad, None for no bounds) converge to the
    target, and the one between samples; None where no region of attraction is known, or where it needs a bound of the rate.
    """
    loop = Loop(subject, alone=True)
    loop.show_end()
    ending = next((c for c in loop.claims if c["theorem"] in ENDING and not LIMITS & c["numbers"].keys()), None)
    if ending is None or (rate is None and "level" in ending["numbers"]):
        return None
    numbers, taken = dict(ending["numbers"]), [*ending["taken"], HANDED]
    if "level" in numbers and rate is not None:
        # For the other theorems it matters which of its quaternions describes an attitude.
        either = ending["theorem"] == EVENLY or SHORTEST in taken
        numbers |= {"start.rate": rate, "start.angle": angle if angle is not None and either else float(ANY_ANGLE)}
    loop.claims.clear()
    V = ending["programs"]["lyapunov"]
    loop.try_to_show(loop.claim(ending["theorem"], taken, V, **numbers), loop.scales(V))
    find_sampled(loop)
    against_sampling(loop)
    return loop


def find_sampled(loop: Loop) -> None:
    """Find the claim about the torque held between samples."""
    h = Fraction(loop.loop.period)
    try:
        wanted, _ = obligations(
            loop.claim(SAMPLED, [], None, period=h, radius=Fraction(1, 2), longest=2 * h), loop.by_digest
        )
    except RefusedError as reason:
        loop.failed[SAMPLED] = str(reason)
        return
    step = wanted["step"]
    assert isinstance(step, Contracts)
    # Those of J - hC and C - hK/2 were made for twice the period.
    inertia, less_damped, less_stiff = (
        o.a
        for o in (wanted["inertia"], wanted["inertia outweighs damping"], wanted["damping outweighs stiffness"])
        if isinstance(o, Definite)
    )
    damping = times(scalar(1 / h), plus(inertia, less_damped, -1))
    stiffness = times(scalar(2 / h), plus(damping, less_stiff, -1))
    roots: Any = np.linalg.eigvals(floats(step.A))
    radius = float(np.abs(roots).max())
    ordered = sorted(map(complex, roots), key=lambda z: (-abs(z), z.imag))
    loop.eigenvalues = [[z.real, z.imag] for z in ordered]
    numbers = {"period": h, "radius": rounded(radius + 1e-4 * (1.0 - radius), 9)}
    with np.errstate(all="ignore"):
        longest = min(2.0 / largest_ratio(damping, inertia), 4.0 / largest_ratio(stiffness, damping))
    if longest > float(h) and loop.try_to_show(
        loop.claim(SAMPLED, [], None, **numbers, longest=rounded(longest * (1.0 - 1e-9), 15)), {}
    ):
        return
    if radius >= 1.0:
        loop.failed[SAMPLED] = "the control period is too long"
        return
    other = longest_stable(floats(inertia), floats(damping), floats(stiffness), float(h))
    for share in (1e-9, 1e-7, 1e-5, 1e-3):
        if loop.try_to_show(loop.claim(SAMPLED, [], None, **numbers, other=other * (1.0 - share)), {}):
            return
    loop.try_to_show(loop.claim(SAMPLED, [], None, **numbers), {})


def longest_stable(J: NDArray[np.float64], C: NDArray[np.float64], K: NDArray[np.float64], period: float) -> float:
    """Return a period near the longest up to which, from a stable one on, floats find all periods stable."""
    pull = np.asarray(np.linalg.solve(J, np.hstack([C, K])), dtype=np.float64)
    low, high = period, 2.0 * period
    while settles(pull, high) and high < 1e12 * period:
        low, high = high, 2.0 * high
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if settles(pull, middle) else (low, middle)
    return low


def settles(pull: NDArray[np.float64], h: float) -> bool:
    """Whether floats find stable near rest the acceleration -pull (w, q) that is held for h."""
    one, none = np.eye(3), np.zeros((3, 3))
    step = np.block([[one, none], [0.5 * h * one, one]]) - np.vstack([h * pull, 0.25 * h * h * pull])
    return float(np.abs(np.linalg.eigvals(step)).max()) < 1.0


def find_sliding(loop: Loop) -> None:
    """Find the claim that the surface is reached."""
    roles, flown = loop.roles, loop.loop
    roles["surface"] = loop.add(flown.law.module.surface, measurement=ASKED, gains=flown.gains)
    m = [fraction(x + loop.known.disturbance) for x in loop.known.modelled]
    numbers: dict[str, Any] = {f"outside.{k}": x for k, x in enumerate(m)} if any(m) else {}
    words = [*([OUTSIDE] if any(m) else []), *([MOVING] if MOVING in loop.words else [])]
    layer = float(getattr(flown.gains, "boundary_layer", 0.0))
    if layer > 0.0 and any(m):
        numbers |= in_layer(loop, layer, list(map(float, m)))
    if signs := sign_words(flown):
        numbers |= signed(loop, numbers)
    loop.try_to_show(loop.claim(SLIDING, [*words, *signs], None, **numbers), {})
    del roles["surface"]


def signed(loop: Loop, numbers: dict[str, Any]) -> dict[str, Any]:
    """Return the numbers of the set from which the quaternion's sign never changes."""
    J, K = tensor(loop.loop.craft.inertia), tensor(loop.loop.gains.surface_gain)
    low = numbers.get("inertia.low", float(np.linalg.eigvalsh(J)[0]) * (1.0 - 1e-6))
    k = numbers.get("surface.low", float(np.linalg.eigvalsh(0.5 * (K + K.T))[0]) * (1.0 - 1e-6))
    level, moments = 0.5 * low * k * k * (1.0 - 1e-6), np.linalg.eigvalsh(J)
    sine = np.sqrt(2.0 * level / np.linalg.eigvalsh(K.T @ J @ K)[-1])
    contained = {
        "angle": 2.0 * asin(min(sine, 1.0)) * (1.0 - 1e-7),
        "rate": np.sqrt(2.0 * level / moments[-1]) * (1.0 - 1e-7),
    }
    return {"inertia.low": low, "surface.low": k, "level": level, **contained}


def in_layer(loop: Loop, layer: float, m: list[float]) -> dict[str, Any]:
    """Return the numbers of the ultimate bound in a boundary layer."""
    J, K, more = tensor(loop.loop.craft.inertia), tensor(loop.loop.gains.surface_gain), 1.0 + 1e-6
    reach = np.array(loop.loop.gains.switching_gain)
    slope, bound = reach / layer, np.array(m)
    total = float((bound**2 / (4.0 * slope)).sum())
    far = np.maximum(total / (reach - bound), (bound + np.sqrt(bound**2 + 4.0 * slope * total)) / (2.0 * slope)) * more
    moments, steep = np.linalg.eigvalsh(J), float(np.linalg.norm(K, 2)) * more
    low, high = float(moments[0]) / more, float(moments[-1]) * more
    k, size = float(np.linalg.eigvalsh(0.5 * (K + K.T))[0]) / more, float(np.sqrt(high / low * (far**2).sum())) * more
    numbers: dict[str, Any] = {f"far.{i}": float(x) for i, x in enumerate(far)} | {"inertia.low": low, "inertia.high": high}
    numbers |= {"surface.low": k, "surface.high": steep, "surface": size, "end.rate": (size + steep * size / k) * more}
    return numbers | {"end.angle": 2.0 * asin(min(size / k, 1.0)) * more}


def largest_ratio(a: Any, b: Any) -> float:
    """Return the largest eigenvalue of b^-1 a."""
    eigenvalues: Any = np.linalg.eigvals(np.linalg.solve(floats(b), floats(a)))
    return float(eigenvalues.real.max())


KNOWN = 18
"""The number of monomials of V' that suffice."""
LESS = (1e-3, 3e-3, 1e-2)
"""Shares by which the largest tolerance is reduced."""
CALM = (0.5, 0.25, 0.12, 0.06, 0.03)
"""Shares of the cross term in V that are tried."""


def find_near(loop: Loop, tolerance: float | None = None) -> None:
    """Find the claim for the largest tolerance, at most 1, or for the one that is asked for. V = w.Jw/2 + 2 s (1 - q0) +
    epsilon q.Jw, of which V' is linear in s, epsilon and epsilon times the tolerance."""
    words = [word for word in loop.words if word == WHEELS]
    corners = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 1.0, 1.0))
    try:
        base, stiff, leaning, shifted = (falling(loop, words, *each) for each in corners)
    except RefusedError as reason:
        loop.failed[NEARBY] = str(reason)
        return
    A, B, D = stiff.p - base.p, leaning.p - base.p, leaning.p - shifted.p
    others = combined(base, base.p, KNOWN)
    z, J = base.z[:KNOWN], tensor(loop.loop.craft.inertia)
    unit = sqrt(float(abs(A.terms[("q1", "w1")]) / J.max())) if A.terms else 1.0
    scales = {f"w{k}": unit for k in (1, 2, 3)}
    # Divided by epsilon it is linear in the tolerance.
    largest = largest_number(posed(B, [-base.p, -A], others, z), scales, D) or 0.0
    if largest <= 0.0:
        loop.failed[NEARBY] = "not shown for any tolerance"
        return
    tried = [1.0] if largest > 1.0 else [three_digits(largest * (1.0 - share)) for share in LESS]
    for t in tried if tolerance is None else [tolerance] * (tolerance <= tried[0]):
        mixed = B - D * Fraction(t)
        solution = solved(posed(base.p, [-A, -mixed], others, z), scales)
        pairs = [] if solution is None else [(solution[0], solution[1])]
        if pairs and HYSTERESIS in sign_words(loop.loop):
            # With a smaller cross term the set is larger.
            for epsilon in (share * pairs[0][1] for share in CALM):
                solution = solved(posed(base.p + mixed * Fraction(epsilon), [-A], others, z), scales)
                pairs += [] if solution is None else [(solution[0], epsilon)]
        choices = [made(loop, t, *(float(f"{x:.4g}") for x in pair)) for pair in pairs]
        choices.sort(key=lambda choice: choice[1].get("level", 0), reverse=True)
        for V, numbers in choices:
            if loop.try_to_show(loop.claim(NEARBY, [*words, *sign_words(loop.loop)], V, **numbers), loop.scales(V)):
                return
    loop.failed[NEARBY] = f"shown up to {100.0 * tried[0]:.3g} %"


def three_digits(x: float) -> float:
    """Return a number rounded down to three digits."""
    unit = 10.0 ** (floor(log10(x)) - 2)
    return float(f"{floor(x / unit) * unit:.3g}")


def falling(loop: Loop, words: list[str], s: float, epsilon: float, tolerance: float) -> Squares:
    """Return the obligation about V', less what is known of the inertia."""
    more = {"tolerance": tolerance, "lean": epsilon, "inertia.most": 1}
    claim = loop.claim(NEARBY, words, loop.crossed(s, epsilon), **more)
    obligation = descent(obligations(claim, loop.by_digest)[0])
    return replace(obligation, p=settled(obligation)[0], known=())


def made(loop: Loop, tolerance: float, s: float, epsilon: float) -> tuple[str, dict[str, Any]]:
    """Return V with stiffness s and cross term epsilon, and the numbers of a claim that uses it: a level set, and the
    starts in it, for laws that choose the quaternion's sign."""
    J, V, signs = tensor(loop.loop.craft.inertia), loop.crossed(s, epsilon), sign_words(loop.loop)
    most = (float(np.linalg.eigvalsh(J)[-1]) + tolerance * float(np.trace(J))) * (1.0 + 1e-9)
    numbers: dict[str, Any] = {"tolerance": tolerance, "lean": epsilon, "inertia.most": most}
    if not signs:
        return V, numbers
    # V where the sign of the quaternion changes, at least.
    level = 2.0 * s - 0.5 * epsilon**2 * most
    if HYSTERESIS in signs:
        h = loop.loop.hysteresis_width
        lost = epsilon**2 * most * (1.0 - h * h)
        x = max(s * h / lost - 0.5, 1e-3)
        level = 4.0 * s * h * x + 2.0 * s * (1.0 + h) - lost * (0.5 + 2.0 * x + 2.0 * x * x)
        numbers |= {"hysteresis": h, "jump.lean": 2.0 * epsilon * x}
    level *= 1.0 - 1e-6
    if level <= 0.0:
        return V, numbers
    angle = loop.contents(loop.form(V), Fraction(level))["angle"]
    numbers |= {"level": level, "angle": angle, "rate": sqrt(2.0 * level / most) * (1.0 - 1e-7)}
    everywhere = sqrt(2.0 * max(level - 4.0 * s, 0.0) / most) - epsilon
    return V, numbers | ({"start.angle": ANY_ANGLE, "start.rate": everywhere * (1.0 - 1e-6)} if everywhere > 0.0 else {})
