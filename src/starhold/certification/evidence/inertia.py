"""Finds the claim about bodies whose inertia is near the one that the law was designed for."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from math import floor, log10, sqrt
from typing import Any

import numpy as np

from starhold.certification.evidence.attitude import ANY_ANGLE, NEARBY, Loop, descent
from starhold.certification.evidence.finding import obligations
from starhold.certification.evidence.recorded import sign_words
from starhold.certification.evidence.squares import cofactors, largest_number, posed, settled, solved
from starhold.kernel.loops import HYSTERESIS, WHEELS
from starhold.kernel.numbers import RefusedError
from starhold.kernel.rules import Squares
from starhold.parts.craft import tensor

KNOWN = 18
"""So many of the monomials of V' are enough."""
LESS = (1e-3, 3e-3, 1e-2)
"""Shares of the largest tolerance that are given away."""
CALM = (0.5, 0.25, 0.12, 0.06, 0.03)
"""Shares of the mixed term in V that are tried."""


def find_near(loop: Loop, tolerance: float | None = None) -> None:
    """Find the claim for the largest tolerance, at most 1, or for the one that is asked for. V = w.Jw/2 + 2 s (1 - q0) +
    epsilon q.Jw, of which V' is linear in s, epsilon and epsilon times the tolerance."""
    words = [word for word in loop.words if word == WHEELS]
    told = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 1.0, 1.0))
    try:
        base, stiff, leaning, shifted = (falling(loop, words, *each) for each in told)
    except RefusedError as reason:
        loop.failed[NEARBY] = str(reason)
        return
    A, B, D = stiff.p - base.p, leaning.p - base.p, leaning.p - shifted.p
    others = [c * r for r, parts in zip(base.modulo, cofactors(base, base.p, KNOWN), strict=True) for c in parts]
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
        found = solved(posed(base.p, [-A, -mixed], others, z), scales)
        pairs = [] if found is None else [(found[0], found[1])]
        if pairs and HYSTERESIS in sign_words(loop.loop):
            # With less of the mixed term the set is larger.
            for epsilon in (share * pairs[0][1] for share in CALM):
                found = solved(posed(base.p + mixed * Fraction(epsilon), [-A], others, z), scales)
                pairs += [] if found is None else [(found[0], epsilon)]
        choices = [made(loop, t, *(float(f"{x:.4g}") for x in pair)) for pair in pairs]
        choices.sort(key=lambda told: told[1].get("level", 0), reverse=True)
        for V, told in choices:
            if loop.try_to_show(loop.claim(NEARBY, [*words, *sign_words(loop.loop)], V, **told), loop.scales(V)):
                return
    loop.failed[NEARBY] = f"shown up to {100.0 * tried[0]:.3g} %"


def three_digits(x: float) -> float:
    """Return a number rounded down to three digits."""
    unit = 10.0 ** (floor(log10(x)) - 2)
    return float(f"{floor(x / unit) * unit:.3g}")


def falling(loop: Loop, words: list[str], s: float, epsilon: float, tolerance: float) -> Squares:
    """Return what has to be shown of V', less what is known of the inertia."""
    more = {"tolerance": tolerance, "lean": epsilon, "inertia.most": 1}
    claim = loop.claim(NEARBY, words, loop.crossed(s, epsilon), **more)
    found = descent(obligations(claim, loop.by_digest)[0])
    return replace(found, p=settled(found)[0], known=())


def made(loop: Loop, tolerance: float, s: float, epsilon: float) -> tuple[str, dict[str, Any]]:
    """Return this V, and the numbers of the claim with it."""
    J, V, signs = tensor(loop.loop.craft.inertia), loop.crossed(s, epsilon), sign_words(loop.loop)
    most = (float(np.linalg.eigvalsh(J)[-1]) + tolerance * float(np.trace(J))) * (1.0 + 1e-9)
    told: dict[str, Any] = {"tolerance": tolerance, "lean": epsilon, "inertia.most": most}
    if not signs:
        return V, told
    # V where the sign of the quaternion changes, at least.
    level = 2.0 * s - 0.5 * epsilon**2 * most
    if HYSTERESIS in signs:
        h = loop.loop.hysteresis_width
        lost = epsilon**2 * most * (1.0 - h * h)
        x = max(s * h / lost - 0.5, 1e-3)
        level = 4.0 * s * h * x + 2.0 * s * (1.0 + h) - lost * (0.5 + 2.0 * x + 2.0 * x * x)
        told |= {"hysteresis": h, "jump.lean": 2.0 * epsilon * x}
    level *= 1.0 - 1e-6
    if level <= 0.0:
        return V, told
    angle = loop.contents(loop.form(V), Fraction(level))["angle"]
    told |= {"level": level, "angle": angle, "rate": sqrt(2.0 * level / most) * (1.0 - 1e-7)}
    everywhere = sqrt(2.0 * max(level - 4.0 * s, 0.0) / most) - epsilon
    return V, told | ({"start.angle": ANY_ANGLE, "start.rate": everywhere * (1.0 - 1e-6)} if everywhere > 0.0 else {})
