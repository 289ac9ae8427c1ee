"""The independent checker of stability certificates: it trusts nothing in a file but what is claimed, and derives every
number and condition anew from the law's and the models' equations, by other methods than the certifier's.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np
from flint import ctx

from starhold.certification.checker.claims import CLAIMS
from starhold.certification.checker.exact import CheckError, Obligation, demand
from starhold.certification.checker.refutation import refutation
from starhold.certification.checker.subject import Subject, read_subject
from starhold.errors import InputError

FORMAT = "starhold certificate 1"
BITS = 192
"""Precision of balls: enough that they are far narrower than the margins of a certificate."""

Test: TypeAlias = Callable[[Any], bool]
Verdict: TypeAlias = Literal["holds", "fails", "not claimed"]


@dataclass(frozen=True)
class Finding:
    """What the check says of one obligation of a claim; without an obligation, of the claim, certificate or file."""

    certificate: str
    claim: str
    obligation: str
    verdict: Verdict
    reason: str


def passed(findings: Sequence[Finding]) -> bool:
    """Whether nothing fails. What is not claimed is not proved either."""
    return all(finding.verdict != "fails" for finding in findings)


def check_file(path: Path | str) -> list[Finding]:
    """The findings about a certificate file; InputError where there is none that can be read."""
    faults: list[str] = []

    def once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        if len({key for key, _ in pairs}) < len(pairs):
            faults.append("a key occurs twice in one object")
        return dict(pairs)

    def not_a_number(text: str) -> None:
        faults.append(f"{text} is not a number")

    try:
        text = Path(path).read_text(encoding="utf-8")
        content = json.loads(text, object_pairs_hook=once, parse_constant=not_a_number)
    except OSError as error:
        raise InputError(str(path), "", "", f"cannot be read: {error.strerror}") from None
    except (ValueError, RecursionError) as error:
        raise InputError(str(path), "", "", f"is not JSON: {error}") from None
    return [*(Finding("", "", "", "fails", fault) for fault in faults), *check(content)]


def check(content: Any) -> list[Finding]:
    """The findings about the content of a certificate file."""
    # What overflows in a guess is caught where the guess is verified.
    with ctx.workprec(BITS), np.errstate(all="ignore"):
        try:
            _shaped(content, FILE, "the file")
            demand(content["format"] == FORMAT, f"the format is not {FORMAT!r}")
            demand(len(content["certificates"]) > 0, "there are no certificates")
        except CheckError as fault:
            return [Finding("", "", "", "fails", str(fault))]
        return [finding for given in content["certificates"] for finding in _certificate(given)]


def _certificate(given: Mapping[str, Any]) -> Iterator[Finding]:
    name = str(given.get("name", ""))
    subject, fault = _guarded(partial(_subject, given))
    if subject is None:
        yield Finding(name, "", "", "fails", fault)
        return
    for claim in given["claims"]:
        kind = str(claim.get("kind", ""))
        proofs, fault = _guarded(partial(_claim, subject, claim))
        if proofs is None:
            yield Finding(name, kind, "", "fails", fault)
            continue
        for obligation, verdict, reason in proofs:
            yield Finding(name, kind, obligation, verdict, reason)
    if not given["claims"]:
        yield Finding(name, "", "", "not claimed", "there are no claims")


def _guarded(work: Callable[[], Any]) -> tuple[Any, str]:
    """What a piece of work gives, or None and why it fails: whatever goes wrong in a check fails it."""
    try:
        return work(), ""
    except CheckError as fault:
        return None, str(fault)
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        return None, f"cannot be verified: {error}"


def _subject(given: Any) -> Subject:
    _shaped(given, CERTIFICATE, "the certificate")
    _shaped(given["subject"], SUBJECT, "the subject")
    outcomes = [claim.get("outcome") for claim in given["claims"]]
    demand(given["outcome"] == _follows(outcomes), "the outcome does not follow from the claims")
    return read_subject(given["subject"])


def _claim(subject: Subject, claim: Any) -> list[tuple[str, Verdict, str]]:
    """Verdict and reason for each obligation of a claim."""
    _shaped(claim, CLAIM, "the claim")
    demand(claim["kind"] in CLAIMS, f"there is no kind of claim {claim['kind']}")
    for obligation in claim["obligations"]:
        _shaped(obligation, OBLIGATION, "an obligation")
    outcomes = [obligation["outcome"] for obligation in claim["obligations"]]
    demand(claim["outcome"] == _follows(outcomes), "the outcome does not follow from the obligations")
    kind = CLAIMS[claim["kind"]]
    wheels = subject.wheels is not None
    demand(kind.wheels is None or kind.wheels == wheels, f"such a claim is {'not ' if wheels else ''}for loops with wheels")
    told = kind.assumptions(claim["numbers"], wheels)
    demand(claim["assumptions"] == told, "the assumptions are not those of such a claim")
    if claim["outcome"] != "proved":
        return _unproved(subject, claim)
    _shaped(claim["numbers"], NUMBERS[claim["kind"]], "the numbers")
    _shaped(claim["witness"], WITNESS[claim["kind"]], "the witness")
    proofs = kind.proofs(subject, claim)
    found = [(o["name"], o["how"]) for o in claim["obligations"]]
    needed = [(name, how) for name, how, _ in proofs if how]
    demand(found == needed, f"the obligations are not {', '.join(f'{name} ({how})' for name, how in needed)}")
    demand(not any(o["evidence"] for o in claim["obligations"]), "what is proved has no evidence against it")
    return [_verdict(proof) for proof in proofs]


def _verdict(proof: Obligation) -> tuple[str, Verdict, str]:
    name, how, verify = proof
    reason, fault = _guarded(verify)
    return (name if how else "", "fails", fault) if reason is None else (name if how else "", "holds", reason)


def _unproved(subject: Subject, claim: Mapping[str, Any]) -> list[tuple[str, Verdict, str]]:
    """Nothing of such a claim counts as proved; a refutation must be one."""
    demand(set(claim["numbers"]) <= set(NUMBERS[claim["kind"]]), "the numbers are not those of such a claim")
    demand(set(claim["witness"]) <= set(WITNESS[claim["kind"]]), "the witness is not that of such a claim")
    found: list[tuple[str, Verdict, str]] = []
    for obligation in claim["obligations"]:
        name, verdict, reason = obligation["name"], "not claimed", f"{obligation['outcome']}, the claim is not proved"
        if obligation["outcome"] == "refuted":
            shown, fault = _guarded(partial(refutation, subject, claim, obligation["evidence"]))
            verdict, reason = ("fails", f"not refuted: {fault}") if shown is None else ("not claimed", f"refuted: {shown}")
        found.append((name, verdict, reason))
    return found


def _follows(outcomes: Sequence[Any]) -> str:
    if "refuted" in outcomes:
        return "refuted"
    return "proved" if outcomes and all(outcome == "proved" for outcome in outcomes) else "undecided"


# --- what may stand in the file ---------------------------------------------------------------------------------------


def _shaped(given: Any, shape: Mapping[str, Test], where: str) -> None:
    """That an object has exactly the keys of a shape, and under each what its test allows."""
    demand(isinstance(given, Mapping), f"{where} is not an object")
    demand(set(given) == set(shape), f"{where} has not the keys {', '.join(shape) or '(none)'}")
    for key, test in shape.items():
        demand(test(given[key]), f"{where} has something else than it may under {key}")


def _number(x: Any) -> bool:
    if isinstance(x, bool) or not isinstance(x, (int, float)):
        return False
    try:
        return math.isfinite(x) and float(x) == x
    except OverflowError:
        return False


def _text(x: Any) -> bool:
    return isinstance(x, str)


def _flag(x: Any) -> bool:
    return isinstance(x, bool)


def _object(x: Any) -> bool:
    return isinstance(x, Mapping)


def _plain(x: Any) -> bool:
    """Numbers, texts, lists and objects without an infinity in them."""
    if isinstance(x, Mapping):
        return all(isinstance(key, str) and _plain(value) for key, value in x.items())  # pyright: ignore
    return all(map(_plain, x)) if isinstance(x, list) else x is None or _flag(x) or _text(x) or _number(x)  # pyright: ignore


def _gain(x: Any) -> bool:
    return _text(x) or _number(x) or (isinstance(x, list) and all(map(_gain, x)))  # pyright: ignore


def _list(test: Test, count: int | None = None) -> Test:
    def holds(x: Any) -> bool:
        return isinstance(x, list) and (count is None or len(x) == count) and all(map(test, x))  # pyright: ignore

    return holds


def _one(*allowed: str) -> Test:
    return lambda x: isinstance(x, str) and x in allowed


def _or_none(test: Test) -> Test:
    return lambda x: x is None or test(x)


def _within(shape: Mapping[str, Test]) -> Test:
    return lambda x: isinstance(x, Mapping) and set(x) == set(shape) and all(shape[key](x[key]) for key in shape)  # pyright: ignore


_OUTCOME = _one("proved", "refuted", "undecided")
_VECTOR, _MAYBE = _list(_number, 3), _or_none(_number)
FILE: dict[str, Test] = {
    "format": _text,
    "scenario": _text,
    "versions": lambda x: _object(x) and all(map(_text, x.values())),
    "certificates": _list(_object),
}
CERTIFICATE: dict[str, Test] = {"name": _text, "outcome": _OUTCOME, "subject": _object, "claims": _list(_object)}
CLAIM: dict[str, Test] = {
    "kind": _text,
    "outcome": _OUTCOME,
    "numbers": lambda x: _object(x) and _plain(x),
    "witness": lambda x: _object(x) and _plain(x),
    "assumptions": _list(_text),
    "obligations": _list(_object),
}
OBLIGATION: dict[str, Test] = {
    "name": _text,
    "how": _text,
    "outcome": _OUTCOME,
    "evidence": lambda x: _object(x) and _plain(x),
}
_WHEELS: dict[str, Test] = {
    "axes": _list(_VECTOR),
    "torque_limit": _list(_MAYBE),
    "momentum_limit": _list(_MAYBE),
    "inertia": _list(_number),
    "least": _list(_VECTOR),
    "momentum": _list(_number),
    "allocation": _one("least-squares", "least-peak"),
    "total_momentum": _number,
}
SUBJECT: dict[str, Test] = {
    "law": _text,
    "gains": lambda x: _object(x) and all(map(_gain, x.values())),
    "double_cover": _one("as_published", "shortest", "hysteresis"),
    "hysteresis_width": _number,
    "inertia": _list(_VECTOR, 3),
    "limit": _one("axis", "norm", "none"),
    "torque_limit": _MAYBE,
    "orbit": _or_none(_within({"position": _VECTOR, "velocity": _VECTOR, "gravitational_parameter": _number})),
    "gravity_gradient": _flag,
    "target": _one("inertial", "orbital", "history"),
    "target_rate": _number,
    "target_acceleration": _number,
    "modelled_torque": _VECTOR,
    "modelled_torque_norm": _number,
    "disturbance": _number,
    "control_period": _number,
    "wheels": _or_none(_within(_WHEELS)),
}
_CONTENTS: dict[str, Test] = {
    "start": _MAYBE,
    "everything": _flag,
    "turn": _number,
    "rate": _MAYBE,
    "rate_everywhere": _MAYBE,
}
NUMBERS: dict[str, dict[str, Test]] = {
    "convergence": {"level": _MAYBE, **_CONTENTS},
    "torque-limit": {"level": _MAYBE, **_CONTENTS, "limit": _number, "kind": _one("axis", "norm")},
    "wheels": {
        "level": _MAYBE,
        **_CONTENTS,
        "momentum": _number,
        **dict.fromkeys(("motors", "stored"), _list(_number)),
    },
    "inertia": {"tolerance": _MAYBE, **_CONTENTS},
    "disturbance": {
        **dict.fromkeys(("torque", "start", "level", "turn", "rate_start", "angle", "rate"), _number),
        "rate_everywhere": _MAYBE,
    },
    "sampling": {
        **dict.fromkeys(("period", "radius", "longest"), _number),
        "every_shorter": _flag,
        "eigenvalues": _list(_list(_number, 2), 6),
    },
    "sliding": {
        "torque": _VECTOR,
        **dict.fromkeys(("margin", "surface", "angle", "rate", "turn"), _number),
        "everything": _flag,
        "start": _MAYBE,
        "rate_start": _MAYBE,
    },
    "region": dict.fromkeys(("level", "turn", "rate"), _number),
}
_PROOF: dict[str, Test] = {"stiffness": _MAYBE, "epsilon": _number, "rho": _number}
WITNESS: dict[str, dict[str, Test]] = {
    "convergence": {**_PROOF, "rate_bound": _MAYBE},
    "torque-limit": {**_PROOF, "rate_bound": _MAYBE},
    "wheels": {**_PROOF, "rate_bound": _MAYBE},
    "inertia": {**_PROOF, "level": _MAYBE},
    "disturbance": {**_PROOF, "rate_bound": _MAYBE, "q_rate": _number, "q_attitude": _number},
    "sampling": {},
    "sliding": {},
    "region": dict.fromkeys(("p", "c2", "g", "m"), _number),
}
