"""Claims that the kernel has proved, as sentences, departures, trials and pages read them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from fractions import Fraction
from math import pi
from typing import Any

from flint import fmpq

from starhold.certification.certificate import (
    EXACT,
    EXACT_SIGN,
    LYAPUNOV,
    SQUARES,
    UNLIMITED,
    WHEELS,
    Claim,
    Obligation,
    Proof,
)
from starhold.certification.evidence.attitude import Loop
from starhold.certification.evidence.claims import find_claims
from starhold.certification.evidence.finding import certificate
from starhold.certification.subject import Subject, above, below
from starhold.kernel.check import Proved, check

HOW = {
    **dict.fromkeys(("Vanishes", "Solves"), EXACT),
    **dict.fromkeys(("Definite", "Exceeds"), EXACT_SIGN),
    **dict.fromkeys(("Squares", "Sum"), SQUARES),
    "Contracts": LYAPUNOV,
}
"""How each rule of the kernel shows what it shows."""
ASSUMPTIONS = {
    "rigid-body": "rigid body",
    "inertia-as-given": "inertia exactly as given",
    "exact-measurement": "exact measurement and ideal actuators",
    "ideal-actuators": "exact measurement and ideal actuators",
    "continuous-torque": "torque applied continuously",
    "unlimited-torque": UNLIMITED,
    "unlimited-wheels": WHEELS,
    "no-outside-torque": "no torque from outside",
    "known-outside-torque": "no torque from outside but what the law cancels",
    "bounded-outside-torque": "torque from outside bounded on each axis",
    "frictionless-wheels": "wheels without friction",
    "bounded-momentum": "total momentum at most as told",
    "linear-motion": "linear motion near rest on a target at rest",
}
"""What the kernel's identifiers are called."""
OF_A_LOOP = {"target-at-rest": "target at rest", "no-wheels": "no stored momentum"}
"""What a claim assumes only of a loop whose target moves, or that has wheels."""
IN_THE_LOOP = {"known-target", "bounded-target", "quaternion-as-fed", "sign-at-once"}
"""What every loop meets as it is composed: its law is told how the target moves, and how the quaternion's sign is chosen."""


def proved_claims(subject: Subject, turn: float | None = None) -> tuple[dict[str, Claim], dict[str, str]]:
    """Return the claims about a loop for which evidence was found and checked by the kernel, by their kinds, and why none was
    found for other theorems. turn: what the set within the limits is to hold (rad)."""
    found = find_claims(subject, turn)
    if not found.claims:
        return {}, found.failed
    content = certificate(found.programs, found.claims)
    claims = [made(proved, given, found) for proved, given in zip(check(json.dumps(content)), found.claims, strict=True)]
    return {claim.kind: claim for claim in reversed(claims)}, found.failed


def made(proved: Proved, given: Mapping[str, Any], loop: Loop) -> Claim:
    """Return a claim with the numbers, assumptions and obligations that the kernel tells of it."""
    label, numbers = proved.statement.label, proved.claim.numbers.content
    witness = loop.written_by.get(given["programs"].get("lyapunov", ""), {})
    told = _NUMBERS[label](numbers, loop)
    obligations = {(name.rstrip("+-0123456789 "), HOW[rule]): None for name, rule in proved.shown}
    programs = {name: loop.by_digest[name] for name in given["programs"].values()}
    return Claim(
        label,
        told,
        dict(witness),
        assumed(proved.statement.assumptions, loop),
        tuple(Obligation(name, how, "proved") for name, how in obligations),
        Proof(dict(given), programs),
    )


def assumed(identifiers: tuple[str, ...], loop: Loop) -> tuple[str, ...]:
    """Return what a claim assumes, once each."""
    own = {"target-at-rest": loop.known.moving, "no-wheels": loop.loop.wheels is not None}
    named = [
        ASSUMPTIONS[name] if name in ASSUMPTIONS else OF_A_LOOP[name]
        for name in identifiers
        if name not in IN_THE_LOOP and own.get(name, True)
    ]
    if loop.loop.wheels is not None and UNLIMITED in named:
        named = [WHEELS if name == UNLIMITED else name for name in named if name != "wheels without friction"]
    return tuple(dict.fromkeys(named))


def _set(numbers: Mapping[str, Fraction], loop: Loop) -> dict[str, Any]:
    """Return the numbers of the set that motions start from."""
    if "level" not in numbers:
        return {
            "level": None,
            "start": None,
            "everything": True,
            "slew_angle": 2.0 * pi,
            "rate": None,
            "rate_everywhere": None,
        }
    # Of an inertia that is not known no rate is told.
    level, angle, rate = (below(_exact(numbers[n])) if n in numbers else None for n in ("level", "angle", "rate"))
    return {"level": level, "start": level, "everything": False, "slew_angle": angle, "rate": rate, "rate_everywhere": None}


def _limit(numbers: Mapping[str, Fraction], loop: Loop) -> dict[str, Any]:
    kind = "axis" if "limit" in numbers else "norm"
    return _set(numbers, loop) | {"limit": float(numbers["limit" if kind == "axis" else "limit.norm"]), "kind": kind}


def _wheels(numbers: Mapping[str, Fraction], loop: Loop) -> dict[str, Any]:
    each = {
        name: [above(_exact(numbers[f"{key}.{k}"])) for k in range(len(loop.loop.rotors))]
        for name, key in (("motors", "motors"), ("wheel_momentum", "stored"))
    }
    return _set(numbers, loop) | {"momentum": float(numbers["momentum"])} | each


def _inertia(numbers: Mapping[str, Fraction], loop: Loop) -> dict[str, Any]:
    return {"tolerance": None} | {name: x for name, x in _set(numbers, loop).items() if name != "level"}


def _sampled(numbers: Mapping[str, Fraction], loop: Loop) -> dict[str, Any]:
    longest = numbers.get("longest", numbers.get("other"))
    return {
        "period": float(numbers["period"]),
        "radius": above(_exact(numbers["radius"])),
        "eigenvalues": loop.eigenvalues,
        "longest": None if longest is None else below(_exact(longest)),
        "every_shorter": "longest" in numbers,
    }


def _slid(numbers: Mapping[str, Fraction], loop: Loop) -> dict[str, Any]:
    def most(name: str) -> float:
        return above(_exact(numbers[name])) if name in numbers else 0.0

    begun = _set(numbers, loop)
    begun["rate_start"] = begun.pop("rate")
    ends = {name: most(key) for name, key in (("surface", "surface"), ("angle", "end.angle"), ("rate", "end.rate"))}
    return {"torque": [most(f"outside.{i}") for i in range(3)], **begun, **ends}


def _exact(x: Fraction) -> Any:
    return fmpq(x.numerator, x.denominator)


_NUMBERS = {
    "convergence": _set,
    "region": _set,
    "torque-limit": _limit,
    "wheels": _wheels,
    "inertia": _inertia,
    "sampling": _sampled,
    "sliding": _slid,
}
