"""The independent checker of stability certificates: it trusts nothing in a file but what is claimed, and derives every
number and condition anew from the law's and the models' equations, by other methods than the certifier's.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, cast

import numpy as np
from flint import ctx

from starhold.checker.claims import CLAIMS, UNLIMITED
from starhold.checker.exact import CheckError, Obligation, Verdict, demand, limited
from starhold.checker.reading import read_file, shallow
from starhold.checker.shapes import (
    CLAIM,
    FILE,
    HOWS,
    NUMBERS,
    OBLIGATION,
    PROVED,
    STATION,
    SUBJECT,
    UNKNOWN_BODY,
    WITNESS,
    certificate_shaped,
    outcome_of,
    shaped,
)
from starhold.checker.station import StationSubject, read_station, station_findings
from starhold.checker.subject import LoopSubject, read_subject
from starhold.checker.torque import never_beyond
from starhold.kernel.check import Proved
from starhold.kernel.check import check as prove_all
from starhold.kernel.numbers import RefusedError
from starhold.kernel.reading import FORMAT

FORMER = (
    "starhold certificate 1",
    "starhold certificate 2",
    "starhold invariant certificate 1",
    "starhold invariant certificate 2",
)
"""Formats of earlier versions, whose keys had other names."""
ENDS = (
    "convergence",
    "region",
    "torque-limit",
    "wheels",
    "inertia",
    "pointing",
    "sliding",
    "circle",
    "equilibrium",
    "hand-over",
)
"""Kinds of claims about where the motion ends, one of which a certificate that counts as proved must hold."""
BY_THE_KERNEL = "proved by the kernel"
"""The reason of findings about claims with a proof."""
READ_BY = {"disturbance": {"sliding"}, "switch": {"hand-over"}}
"""Entries of a subject that are allowed only beside a claim of one of these kinds, which alone read them."""
BITS = 192
"""Precision of balls: enough that they are far narrower than the margins of a certificate."""


@dataclass(frozen=True)
class Finding:
    """A verdict on one obligation of a claim; without an obligation, on the claim, certificate or file."""

    certificate: str
    claim: str
    obligation: str
    verdict: Verdict
    reason: str


def passed(findings: Sequence[Finding]) -> bool:
    """Whether all that is claimed to be proved was shown again. What is not claimed is not proved either."""
    return all(finding.verdict not in ("fails", "not checked") for finding in findings)


def check_file(path: Path | str) -> list[Finding]:
    """The findings about a certificate file; InputError where there is none that can be read."""
    content, faults = read_file(path)
    if isinstance(content, dict) and content.get("format") == FORMAT and "certificates" not in content:  # pyright: ignore
        try:
            proved = prove_all(Path(path).read_text(encoding="utf-8"))
        except RefusedError as reason:
            return [Finding("", "", "", "fails", str(reason))]
        return [Finding("", one.claim.theorem, one.statement.written(), "holds", "") for one in proved]
    return [*(Finding("", "", "", "fails", fault) for fault in faults), *check(content)]


def check(content: Any) -> list[Finding]:
    """The findings about the content of a certificate file."""
    # What overflows in a guess is caught where the guess is verified.
    with ctx.workprec(BITS), np.errstate(all="ignore"):
        try:
            shallow(content)
            _known(content)
            proofs = _proofs(content)
        except CheckError as fault:
            return [Finding("", "", "", "fails", str(fault))]
        return [finding for given in content["certificates"] for finding in _certificate(given, proofs)]


def _known(content: Any) -> None:
    """Refuse a file of another format, or one that lacks what a file of this format has."""
    table = cast(dict[str, Any], content if isinstance(content, dict) else {})
    given: Any = table.get("format")
    demand(given not in FORMER, f"the format is {given!r}, of an earlier version: certify again")
    shaped(content, FILE, "the file")
    demand(given == FORMAT, f"the format is not {FORMAT!r}")
    demand(len(table["certificates"]) > 0, "there are no certificates")


def _proofs(content: Any) -> list[Proved]:
    """Return what the kernel proves of a file, each claim of which has to be told of once, in order."""
    told: list[Any] = []
    for given in content["certificates"]:
        parts: list[Any] = [given.get(key) if isinstance(given.get(key), list) else [] for key in ("claims", "proof")]
        claims, own = parts
        told += [claim["proof"] for claim in claims if isinstance(claim, dict) and "proof" in claim] + own
    demand(told == [*range(len(content["claims"]))], "the proofs are not those that the claims count")
    if not told:
        demand(not content["programs"], "there are programs without a proof")
        return []
    try:
        return prove_all(json.dumps(content))
    except RefusedError as fault:
        raise CheckError(f"refused by the kernel: {fault}") from None


def _certificate(given: Mapping[str, Any], proofs: Sequence[Proved]) -> Iterator[Finding]:
    name = str(given.get("name", ""))
    about = given.get("subject")
    if isinstance(about, Mapping) and "body" in about:
        _, fault = _guarded(partial(_of_unknown_body, given))
        yield Finding(name, "", "", "fails" if fault else "not claimed", fault or "nothing is known of this body")
        return
    subject, fault = _guarded(partial(_subject, given))
    if subject is None:
        yield Finding(name, "", "", "fails", fault)
        return
    if isinstance(subject, StationSubject):
        found, fault = _guarded(partial(_of_station, name, subject, given, proofs))
        yield from found or []
        if fault:
            yield Finding(name, "", "", "fails", fault)
        elif not found:
            yield Finding(name, "", "", "not claimed", "there are no claims")
        return
    for claim in given["claims"]:
        kind = str(claim.get("kind", ""))
        work = partial(_proved, proofs, claim) if "proof" in claim else partial(_claim, subject, given["subject"], claim)
        found, fault = _guarded(work)
        if found is None:
            yield Finding(name, kind, "", "fails", fault)
            continue
        for obligation, verdict, reason in found:
            yield Finding(name, kind, obligation, verdict, reason)
    if not given["claims"]:
        yield Finding(name, "", "", "not claimed", "there are no claims")


def _guarded(work: Callable[[], Any]) -> tuple[Any, str]:
    """Do a piece of work: its result, or None and why it fails, for whatever goes wrong in a check fails it."""
    try:
        with limited():
            return work(), ""
    except CheckError as fault:
        return None, str(fault)
    except (ArithmeticError, AttributeError, LookupError, MemoryError, RecursionError, TypeError, ValueError) as error:
        return None, f"cannot be verified: {error}"


def _of_unknown_body(given: Any) -> None:
    certificate_shaped(given)
    shaped(given["subject"], UNKNOWN_BODY, "the subject")
    demand(not given["claims"] and given["outcome"] == "undecided", "it claims what is not known of this body")


def _of_station(name: str, subject: StationSubject, given: Any, proofs: Sequence[Proved]) -> list[Finding]:
    for claim in given["claims"]:
        shaped(claim, CLAIM, "the claim")
        for obligation in claim["obligations"]:
            shaped(obligation, OBLIGATION, "an obligation")
    absent = [f"without the {name}" for name in given["subject"]["assumed_away"]]
    demand(not any("proof" in claim for claim in given["claims"]), "a claim of a station tells of a proof")
    places: list[int] = given.get("proof", [])
    own = [proofs[place] for place in places]
    return [Finding(name, *one) for one in station_findings(subject, given, absent, own)]


def _subject(given: Any) -> LoopSubject | StationSubject:
    certificate_shaped(given)
    station = "plant" in given["subject"]
    shaped(given["subject"], STATION if station else SUBJECT, "the subject")
    outcomes = [claim.get("outcome") for claim in given["claims"]]
    follows = outcome_of(outcomes)
    kinds = [str(claim.get("kind")) for claim in given["claims"]]
    if follows == "proved" and not set(kinds) & set(ENDS):
        follows = "undecided"
    demand(given["outcome"] == follows, "the outcome does not follow from the claims")
    demand(len(set(kinds)) == len(kinds), "two claims are of one kind")
    for name, readers in READ_BY.items():
        demand(bool(given["subject"].get(name)) <= bool(readers & set(kinds)), f"no claim is about the {name}")
    return (read_station if station else read_subject)(given["subject"])


def _proved(proofs: Sequence[Proved], claim: Any) -> list[tuple[str, Verdict, str]]:
    """Return what the kernel found of a claim with a proof; numbers and assumptions are those of the proof alone."""
    shaped(claim, PROVED, "the claim")
    proved = proofs[int(claim["proof"])]
    demand(proved.statement.label == claim["kind"], f"the proof is of another kind of claim: {proved.statement.label}")
    refuted = proved.statement.refutes
    demand(claim["outcome"] == ("refuted" if refuted else "proved"), "the outcome is not that of the proof")
    if refuted:
        return [("", "not claimed", f"refuted by the kernel: {proved.statement.text}")]
    names = dict.fromkeys(name.rstrip("+-0123456789 ") for name, _ in proved.shown)
    return [(name, "holds", BY_THE_KERNEL) for name in names]


def _claim(subject: LoopSubject, about: Mapping[str, Any], claim: Any) -> list[tuple[str, Verdict, str]]:
    """Verdict and reason for each obligation of a claim without a proof, about a subject as the file tells it."""
    shaped(claim, CLAIM, "the claim")
    absent: list[str] = about["assumed_away"]
    demand(claim["kind"] in CLAIMS, f"there is no kind of claim {claim['kind']} about such a loop")
    for obligation in claim["obligations"]:
        shaped(obligation, OBLIGATION, "an obligation")
    outcomes = [obligation["outcome"] for obligation in claim["obligations"]]
    demand(claim["outcome"] == outcome_of(outcomes), "the outcome does not follow from the obligations")
    told, proofs = _obliges(subject, claim)
    # What the loop has beside what the claim is about is left out by name.
    told = [*told, *(f"without the {name}" for name in absent)]
    demand(claim["assumptions"] == told, "the assumptions are not those of such a claim")
    if claim["outcome"] != "proved":
        return _unproved(claim)
    shaped(claim["numbers"], NUMBERS[claim["kind"]], "the numbers")
    shaped(claim["witness"], WITNESS[claim["kind"]], "the witness")
    shown = proofs()
    found = [(o["name"], o["how"]) for o in claim["obligations"]]
    needed = [(name, how) for name, how, _ in shown if how]
    demand(found == needed, f"the obligations are not {', '.join(f'{name} ({how})' for name, how in needed)}")
    demand(not any(o["evidence"] for o in claim["obligations"]), "what is proved has no evidence against it")
    return [_verdict(proof) for proof in shown]


def _obliges(subject: LoopSubject, claim: Any) -> tuple[list[str], Callable[[], list[Obligation]]]:
    """The assumptions of a claim, and what makes the list of what has to be shown."""
    kind, wheels = CLAIMS[claim["kind"]], subject.wheels is not None
    demand(kind.wheels is None or kind.wheels == wheels, f"such a claim is {'not ' if wheels else ''}for loops with wheels")
    assumed = kind.assumptions(claim["numbers"], wheels)
    if UNLIMITED in assumed and UNLIMITED not in claim["assumptions"]:
        demand(never_beyond(subject), "the law may ask for more torque than its limit")
        assumed = [text for text in assumed if text != UNLIMITED]
    return assumed, partial(kind.proofs, subject, claim)


def _verdict(proof: Obligation) -> tuple[str, Verdict, str]:
    name, how, verify = proof
    reason, fault = _guarded(verify)
    return (name if how else "", "fails", fault) if reason is None else (name if how else "", "holds", reason)


def _unproved(claim: Mapping[str, Any]) -> list[tuple[str, Verdict, str]]:
    """Nothing of such a claim counts as proved; one that is refuted has a proof of that."""
    for part, shapes in (("numbers", NUMBERS), ("witness", WITNESS)):
        shape, given = shapes[claim["kind"]], claim[part]
        known = all(key in shape and (value is None or shape[key](value)) for key, value in given.items())
        demand(known, f"the {part} are not those of such a claim")
    names = [obligation["name"] for obligation in claim["obligations"]]
    demand(len(set(names)) == len(names), "an obligation is told of twice")
    for obligation in claim["obligations"]:
        how, proved = HOWS.get(obligation["name"], ()), obligation["outcome"] == "proved"
        demand(obligation["how"] in how, f"there is no obligation {obligation['name']} that is shown so")
        demand(not (proved and obligation["evidence"]), "what is proved has no evidence against it")
        demand(obligation["outcome"] != "refuted", "what is refuted comes without a proof")
    found: list[tuple[str, Verdict, str]] = []
    for obligation in claim["obligations"]:
        found.append((obligation["name"], "not claimed", f"{obligation['outcome']}, the claim is not proved"))
    return found
