"""Claims that the kernel has proved, in the form that sentences, departures, trials and pages use."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from math import asin, pi, sqrt
from typing import Any

from starhold.certification.assumptions import FRICTIONLESS, UNLIMITED, WHEELS
from starhold.certification.certificate import EXACT, EXACT_SIGN, LYAPUNOV, SQUARES, Claim, Obligation, Proof
from starhold.certification.evidence.appendages import find_appended
from starhold.certification.evidence.attitude import ANY_ANGLE, Loop
from starhold.certification.evidence.claims import find_claims, find_taken_over
from starhold.certification.evidence.detumbling import DETUMBLES, find_detumbling
from starhold.certification.evidence.finding import certificate, obligations
from starhold.certification.evidence.recorded import RecordedLoop
from starhold.certification.evidence.refuted import (
    AWAY,
    EXCEEDS,
    NEGATIVE,
    PUSHED,
    RISES,
    RISES_NEAR,
    UNSETTLED,
    find_refuted,
)
from starhold.certification.evidence.starts import POINTS
from starhold.certification.matrices import above, below
from starhold.certification.subject import Subject
from starhold.certification.unmodelled import GROWING, grows
from starhold.kernel.check import Proved, check
from starhold.kernel.numbers import Account, RefusedError
from starhold.kernel.rules import Exceeds
from starhold.kernel.theorems.refuted import State

HOW = {
    "Vanishes": EXACT,
    **dict.fromkeys(("Definite", "Exceeds"), EXACT_SIGN),
    **dict.fromkeys(("Squares", "Sum"), SQUARES),
    **dict.fromkeys(("Contracts", "Persists"), LYAPUNOV),
}
"""The method of each rule of the kernel, in words."""
IN_THE_LOOP = {"known-target", "quaternion-as-fed", "sign-at-once"}
"""Assumptions that every loop meets by composition: its law knows the target's motion, and how the quaternion's sign is
chosen."""


HELD_AND_PUSHED = ("rigid-body", "inertia-as-given", "bounded-push", "held-torque")
"""The assumptions of a pointing claim about unknown quantities."""


def proved_claims(
    subject: Subject,
    turn: float | None = None,
    rate: float | None = None,
    tolerance: float | None = None,
    pointing: bool = False,
    begun: float | None = None,
) -> tuple[dict[str, Claim], dict[str, str]]:
    """Return the claims about a loop for which evidence was found and checked by the kernel, by their kinds: proved ones,
    and refuted ones among the others; and why no evidence was found for other theorems. turn: the rotation that the set
    within limits must contain (rad); rate: up to which motions should converge from every attitude (rad/s, inf for any);
    tolerance: of the inertia, by default the largest, in the pointing bound none; pointing: whether to find the pointing
    bound of the loop as it flies, of motions that begin at the rate `begun` (rad/s)."""
    loop = find_claims(subject, turn, tolerance)
    if pointing and not subject.loop.remembers:
        _find_pointed(loop, None, begun, tolerance)
        find_appended(loop)
    find_refuted(loop, turn, rate)
    claims = met(checked(loop))
    # The refuted claim is the requested one; a weaker one may be proved.
    against = [claim for claim in claims if claim.outcome == "refuted"]
    return {claim.kind: claim for claim in (*reversed(claims), *against)}, loop.failed


def pointed(
    subject: Subject, like: Claim | None = None, begun: float | None = None, tolerance: float | None = None
) -> tuple[Claim | None, str]:
    """Return the pointing claim of a loop as it flies, or why no evidence was found. like: the claim of another loop, for
    the same start set, limits and tolerance; begun: the rate (rad/s) at which motions begin; tolerance: of the inertia."""
    loop = Loop(subject)
    numbers = None if like is None or like.proof is None else like.proof.claim["numbers"]
    _find_pointed(loop, numbers, begun, tolerance)
    return next(iter(checked(loop)), None), loop.failed.get(POINTS, "no proof was found")


def appended(subject: Subject) -> list[Claim]:
    """Return the claim about pointing with appendages, if there are any and evidence was found."""
    loop = Loop(subject)
    find_appended(loop)
    return checked(loop)


def _find_pointed(loop: Loop, like: Mapping[str, Any] | None, begun: float | None, tolerance: float | None) -> None:
    """Find the pointing bound with the tolerance of the inertia, or without if none is proved with it."""
    # Loaded here, because its matrices need a large library.
    from starhold.certification.evidence.pointing import find_pointed

    if like is not None:
        tolerance = float(Fraction(like["tolerance"])) if "tolerance" in like else None
    late = {"late.torque.mean", *GROWING}
    loop.known = replace(loop.known, tolerance=tolerance, lags=like is None or not late.isdisjoint(like))
    if find_pointed(loop, like, begun):
        return
    if like is None and (loop.known.late or grows(loop.loop)):
        why = loop.failed.get(POINTS, "no proof was found")
        loop.known = replace(loop.known, lags=False)
        if find_pointed(loop, like, begun):
            loop.failed[POINTS] = f"with what is late: {why}"
            return
    if tolerance is None or like is not None:
        return
    why = loop.failed.get(POINTS, "no proof was found")
    loop.known = replace(loop.known, tolerance=None)
    if find_pointed(loop, like, begun):
        loop.failed[POINTS] = f"with the inertia's tolerance: {why}"


def taken_over(subject: Subject, rate: float | None, angle: float | None) -> tuple[dict[str, Claim], dict[str, str]] | None:
    """Return the claim that motions which begin at up to a rate (rad/s) and an angle (rad, None for no bounds) converge to
    the target, if proved, and the one about torque held between samples, by their kinds, and why others were not found; None
    where no region of attraction is known, or where it is bounded and nothing bounds the rate."""
    loop = find_taken_over(subject, rate, angle)
    return None if loop is None else ({claim.kind: claim for claim in checked(loop)}, loop.failed)


def detumbled(subject: Subject) -> tuple[Claim | None, str]:
    """Return the claim about detumbling of a loop whose law opposes the change of the magnetic field, or why no evidence was
    found."""
    loop = find_detumbling(subject)
    return next(iter(checked(loop)), None), loop.failed.get(DETUMBLES, "no proof was found")


def checked(loop: RecordedLoop) -> list[Claim]:
    """Return the claims found, as the kernel reports them, except those whose check exceeds its work limit."""
    claims = list[Claim]()
    for given in loop.claims:
        try:
            (proved,) = check(json.dumps(certificate(loop.programs, [given])))
        except RefusedError as reason:
            if Account.left >= 0:
                raise
            loop.failed[given["theorem"]] = str(reason)
            continue
        claims.append(made(proved, given, loop))
    return claims


def met(claims: list[Claim]) -> list[Claim]:
    """Return claims without the assumption of unlimited torque, where one of them shows that the law keeps within its limit
    in every state; they then share its assumptions about disturbances."""
    kept = next((c for c in claims if c.kind == "torque-limit" and c.outcome == "proved" and c.numbers["everything"]), None)
    if kept is None:
        return claims
    bounds = tuple(name for name in kept.assumptions if name.startswith("bounded-"))
    premises = [tuple(name for name in claim.assumptions if name != UNLIMITED) for claim in claims]
    return [
        claim if names == claim.assumptions else replace(claim, assumptions=tuple(dict.fromkeys(names + bounds)))
        for claim, names in zip(claims, premises, strict=True)
    ]


def steps_of(proved: Proved) -> list[Obligation]:
    """Return the obligations that the kernel checked, those of one name once."""
    steps = dict.fromkeys((name.rstrip("+-0123456789 "), HOW[rule]) for name, rule in proved.shown)
    return [Obligation(name, how, "proved") for name, how in steps]


def made(proved: Proved, given: Mapping[str, Any], loop: RecordedLoop) -> Claim:
    """Return a claim with the numbers, assumptions and obligations that the kernel reports."""
    label, numbers = proved.statement.label, proved.claim.numbers.content
    witness = loop.written_by.get(given["programs"].get("lyapunov", ""), {})
    shown = steps_of(proved)
    if proved.statement.refutes:
        name, details, against = refutation(proved, given, loop)
        shown = [Obligation(name, next(step.how for step in shown if step.name == name), "refuted", against)]
    else:
        details = _NUMBERS[label](numbers, loop)
        if proved.statement.within:
            details["funnel"] = _funnel(proved.statement.within, details["settling"], details["angle"])
    programs = {name: loop.by_digest[name] for name in given["programs"].values()}
    return Claim(
        label,
        details,
        dict(witness),
        # Wheels have no limits other than those that the claim states.
        tuple(x for x in assumed(proved.statement.assumptions, loop) if (x, label) != (WHEELS, "wheels")),
        tuple(shown),
        Proof(dict(given), programs),
    )


def assumed(identifiers: tuple[str, ...], loop: RecordedLoop) -> tuple[str, ...]:
    """Return the assumptions of a claim beyond those that its loop meets by composition."""
    wheeled = loop.loop.wheels is not None
    satisfied = {"target-at-rest": loop.known.moving, "no-wheels": wheeled} | dict.fromkeys(IN_THE_LOOP, False)
    named = [name for name in identifiers if satisfied.get(name, True)]
    if wheeled and UNLIMITED in named:
        # Without friction, too.
        named = [WHEELS if name == UNLIMITED else name for name in named if name != FRICTIONLESS]
    return tuple(named)


def _set(numbers: Mapping[str, Fraction], loop: RecordedLoop) -> dict[str, Any]:
    """Return the numbers of the start set."""
    if "level" not in numbers:
        nothing = dict.fromkeys(("level", "start", "rate", "rate_everywhere"))
        return nothing | {"everything": True, "slew_angle": 2.0 * pi}
    # For an unknown inertia no rate is stated.
    level, angle, rate = (below(numbers[n]) if n in numbers else None for n in ("level", "angle", "rate"))
    whole = numbers.get("start.angle") == ANY_ANGLE
    everywhere = below(numbers["start.rate"]) if whole else None
    begun = {"slew_angle": angle, "rate": rate, "rate_everywhere": everywhere}
    return {"level": level, "start": level, "everything": False, **begun}


def _limit(numbers: Mapping[str, Fraction], loop: RecordedLoop) -> dict[str, Any]:
    kind = "axis" if "limit" in numbers else "norm"
    return _set(numbers, loop) | {"limit": float(numbers["limit" if kind == "axis" else "limit.norm"]), "kind": kind}


def _wheels(numbers: Mapping[str, Fraction], loop: RecordedLoop) -> dict[str, Any]:
    each = {
        name: [above(numbers[at]) if (at := f"{key}.{k}") in numbers else None for k in range(len(loop.loop.rotors))]
        for name, key in (("motors", "motors"), ("wheel_momentum", "stored"))
    }
    limits = {name: values for name, values in each.items() if any(x is not None for x in values)}
    return _set(numbers, loop) | {"momentum": float(numbers["momentum"])} | limits


def _inertia(numbers: Mapping[str, Fraction], loop: RecordedLoop) -> dict[str, Any]:
    tolerance = {"tolerance": below(numbers["tolerance"]) if "tolerance" in numbers else None}
    return tolerance | {name: x for name, x in _set(numbers, loop).items() if name != "level"}


def _handed(numbers: Mapping[str, Fraction], loop: RecordedLoop) -> dict[str, Any]:
    begun = _set(numbers, loop)
    angle = numbers.get("start.angle", Fraction(ANY_ANGLE))
    bounds = {
        "rate": below(numbers["start.rate"]) if "start.rate" in numbers else None,
        "angle": below(angle) if angle < ANY_ANGLE else None,
    }
    return {name: begun[name] for name in ("level", "start", "everything")} | bounds


def _sampled(numbers: Mapping[str, Fraction], loop: RecordedLoop) -> dict[str, Any]:
    longest = numbers.get("longest", numbers.get("other"))
    return {
        "period": float(numbers["period"]),
        "radius": above(numbers["radius"]),
        "eigenvalues": loop.eigenvalues,
        "longest": None if longest is None else below(longest),
        "every_shorter": "longest" in numbers,
    }


def _slid(numbers: Mapping[str, Fraction], loop: RecordedLoop) -> dict[str, Any]:
    def most(name: str) -> float:
        return above(numbers[name]) if name in numbers else 0.0

    begun = _set(numbers, loop)
    begun["rate_start"] = begun.pop("rate")
    ends = {name: most(key) for name, key in (("surface", "surface"), ("angle", "end.angle"), ("rate", "end.rate"))}
    return {"torque": [most(f"outside.{i}") for i in range(3)], **begun, **ends}


def _pointed(numbers: Mapping[str, Fraction], loop: RecordedLoop) -> dict[str, Any]:
    angle, rate = (below(numbers.get(f"start.{name}", numbers.get(name, Fraction(0)))) for name in ("angle", "rate"))
    most = {"torque": "outside", "error": "error", "torque_per_rate": "outside.per.rate", "error_per_rate": "error.per.rate"}
    errors = {
        f"{name}_error": sum(float(numbers.get(f"{kind}.{name}", 0)) for kind in ("error", "noise"))
        for name in ("attitude", "rate")
    }
    behind = (
        numbers["late.torque.weight"] * numbers["late.torque.begun"] ** 2 if "late.torque.mean" in numbers else Fraction(0)
    )
    ends = {"level": "highest", "settling": "settling", "angle": "end.angle", "rate": "end.rate"}
    grown = [float(numbers.get(name, 0)) for name in GROWING]
    return {
        "period": float(numbers["period"]),
        "slew_angle": angle,
        "rate_start": rate,
        **{name: float(numbers.get(key, Fraction(0))) for name, key in most.items()},
        **errors,
        **({"random_torque": float(numbers["noise.torque"])} if "noise.torque" in numbers else {}),
        "told": "outside.0" in numbers,
        **({"tolerance": below(numbers["tolerance"])} if "tolerance" in numbers else {}),
        "share": below(1 - numbers["share"]) if "share" in numbers else None,
        "samples": int(numbers.get("samples", 0)),
        **{name: float(numbers[name]) for name in ("momentum", "memory") if name in numbers},
        **({"plan_error": above(numbers["plan.error"])} if "plan.error" in numbers else {}),
        **({"late_torque": below(numbers["late.torque.begun"])} if "late.torque.begun" in numbers else {}),
        **({"told_growth": grown} if any(grown) else {}),
        "start": above(numbers["level"] - behind),
        **({"kinetic": below(numbers["kinetic"])} if "kinetic" in numbers else {}),
        **(_asked(numbers, loop) if "asked" in numbers else {}),
        **{name: above(numbers[key]) for name, key in ends.items()},
    }


def _asked(numbers: Mapping[str, Fraction], loop: RecordedLoop) -> dict[str, Any]:
    """Return what the law may ask for because of state and momentum alone: about each axis, and of each motor (N m)."""
    share, motors = numbers["asked"], [numbers.get(f"motors.{k}") for k in range(len(loop.loop.rotors))]
    bounds = [None if x is None else below(share * x) for x in motors]
    axis = {"asked_torque": below(share * numbers["limit"])} if "limit" in numbers else {}
    return axis | ({"asked_motors": bounds} if any(motors) else {})


def _appended(numbers: Mapping[str, Fraction], loop: RecordedLoop) -> dict[str, Any]:
    begun = [below(numbers[f"begun.{k}"]) for k in range(len(numbers)) if f"begun.{k}" in numbers]
    return _pointed(numbers, loop) | {"begun": begun}


def _detumbled(numbers: Mapping[str, Fraction], loop: RecordedLoop) -> dict[str, Any]:
    def each(name: str, side: Callable[[Any], float]) -> list[float]:
        return [side(x) for k in range(len(numbers)) if (x := numbers.get(f"{name}.{k}")) is not None]

    rates, falls, rises = (each(name, below) for name in ("rate", "fall", "rise"))
    high = above(numbers["inertia.high"])
    keys = {"torque": "outside", "torque_across": "outside.across", "dipole": "dipole.limit", "field_change": "field.change"}
    return {
        "period": loop.loop.period,
        "rates": rates,
        "turning": each("above", above),
        "rise": each("rise", above),
        "often": each("often", above),
        # A margin, because these are computed in floats.
        "spell": [0.5 * high * w * w / (x + y) * (1.0 + 1e-9) for w, x, y in zip(rates, falls, rises, strict=True)],
        "shares": [y / (x + y) * (1.0 + 1e-9) for x, y in zip(falls, rises, strict=True)],
        **{name: below(numbers[key]) for name, key in keys.items()},
        "field": above(numbers["field.least"]),
        **({"stored": below(numbers["stored"])} if "stored" in numbers else {}),
    }


def _funnel(within: Sequence[tuple[Fraction, Fraction]], settling: float, angle: float) -> list[tuple[float, float]]:
    """Return times (s), each with the angle (rad) that motions do not exceed from then on; the ultimate bound is last."""
    # A margin, because the angle is computed in floats.
    bounds = [(above(time), 2.0 * asin(min(float(sine), 1.0)) * (1.0 + 1e-9)) for time, sine in within]
    return [*((time, most) for time, most in bounds if time < settling and most > angle), (settling, angle)]


_NUMBERS = {
    "convergence": _set,
    "hand-over": _handed,
    "region": _set,
    "torque-limit": _limit,
    "wheels": _wheels,
    "inertia": _inertia,
    "sampling": _sampled,
    "sliding": _slid,
    "pointing": _pointed,
    "appendages": _appended,
    "detumbling": _detumbled,
}


def refutation(proved: Proved, given: Mapping[str, Any], loop: RecordedLoop) -> tuple[str, dict[str, Any], dict[str, Any]]:
    """Return the obligation that fails, the numbers of the claim that needs it, and the counterexample."""
    numbers, theorem = proved.claim.numbers.content, proved.claim.theorem
    compared = {name: o for name, o in obligations(given, loop.by_digest)[0].items() if isinstance(o, Exceeds)}

    def values(name: str) -> tuple[float, float]:
        return float(compared[name].large), float(compared[name].small)

    def state(turn: str = "turn") -> dict[str, Any]:
        read = State(*([numbers.get(f"{name}.{k}", Fraction(0)) for k in range(3)] for name in (turn, "rate")))
        x = [float(x) for x in read.values.values()]
        return {"state": {"attitude": x[:4], "rate": x[4:]}}

    if theorem in (RISES, RISES_NEAR):
        fastest = numbers.get("fastest")
        rate = None if fastest is None else float(fastest)
        details = {"rate_everywhere": rate, "everything": rate is None} if theorem == RISES else {}
        return "V is non-increasing", details, state() | {"V'": values("V is non-increasing")[0]}
    if theorem == NEGATIVE:
        return "V is least on target", {}, state() | {"V": -values("V is least on target")[0]}
    if theorem == EXCEEDS:
        kind, angle = "axis" if "limit" in numbers else "norm", float(numbers["angle"])
        begun = {"everything": False, "slew_angle": angle, "rate": None, "rate_everywhere": None}
        limit = {"limit": float(numbers["limit" if kind == "axis" else "limit.norm"]), "kind": kind}
        return "torque", begun | limit, state() | {"torque": sqrt(values("torque")[0])}
    if theorem == UNSETTLED:
        size = abs(complex(*loop.eigenvalues[0]))
        described = {"period": float(numbers["period"]), "radius": size, "eigenvalues": loop.eigenvalues}
        return "step", described | {"longest": None, "every_shorter": False}, {"eigenvalue": loop.eigenvalues[0]}
    torque = [float(numbers.get(f"outside.{k}", 0)) for k in range(3)]
    if theorem == PUSHED:
        place = torque.index(max(torque))
        large, small = values(f"reach {place}")
        where = {} if loop.pushed_at is None else {"position": loop.pushed_at}
        return "reach", {"torque": torque}, {"axis": place + 1, "reach": small, "torque": large, **where, **state()}
    assert theorem == AWAY
    axis = state()["state"]["attitude"][1:]
    return "q0 grows on the surface", {"torque": torque}, {"axis": axis, "q.Kq": -values("q0 grows on the surface")[0]}
