"""The check of a certificate file: the kernel decides every proof, and the rest of the file must not say more than the
proofs."""

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, cast

from starhold.checker.shapes import (
    CLAIM,
    FILE,
    OBLIGATION,
    PROVED,
    STATION,
    SUBJECT,
    UNKNOWN_BODY,
    CheckError,
    StationSubject,
    Verdict,
    certificate_shaped,
    demand,
    outcome_of,
    read_station,
    shaped,
    station_findings,
)
from starhold.errors import InputError
from starhold.kernel.check import Proved
from starhold.kernel.check import check as prove_all
from starhold.kernel.numbers import RefusedError
from starhold.kernel.reading import FORMAT
from starhold.kernel.sentences import ASSUMPTIONS

BYTES, DEEPEST, DIGITS = 2**26, 32, 1_000
"""The largest file (bytes); the deepest nesting of its objects and lists; the most digits of a number."""


def read_file(path: Path | str) -> tuple[Any, list[str]]:
    """Return the content of a JSON file, and faults that parsing ignores; InputError where it cannot be read."""
    faults: list[str] = []

    def once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        if len({key for key, _ in pairs}) < len(pairs):
            faults.append("a key occurs twice in one object")
        return dict(pairs)

    def not_a_number(text: str) -> None:
        faults.append(f"{text} is not a number")

    def whole(text: str) -> int:
        if len(text) > DIGITS:
            raise InputError(str(path), "", "", f"holds a number of more than {DIGITS} digits")
        return int(text)

    try:
        with open(path, "rb") as file:
            raw = file.read(BYTES + 1)
        if len(raw) > BYTES:
            raise InputError(str(path), "", "", f"is larger than {BYTES // 2**20} MiB")
        text = raw.decode("utf-8")
        return json.loads(text, object_pairs_hook=once, parse_constant=not_a_number, parse_int=whole), faults
    except OSError as error:
        raise InputError(str(path), "", "", f"cannot be read: {error.strerror}") from None
    except RecursionError:
        raise InputError(str(path), "", "", f"is nested more than {DEEPEST} deep") from None
    except ValueError as error:
        raise InputError(str(path), "", "", f"is not JSON: {error}") from None


def shallow(content: Any) -> None:
    """Raise a CheckError where objects and lists are nested too deeply."""
    inner: list[Any] = [content]
    for _ in range(DEEPEST):
        inner = [x for part in inner for x in _within(part)]
        if not inner:
            return
    raise CheckError(f"the file is nested more than {DEEPEST} deep")


def _within(part: Any) -> Iterable[Any]:
    if isinstance(part, dict):
        return cast("dict[Any, Any]", part).values()
    return cast("list[Any]", part) if isinstance(part, list) else ()


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
"""Kinds of claims with an ultimate bound, one of which a certificate must contain to count as proved."""
BY_THE_KERNEL = "proved by the kernel"
"""The reason of findings about claims with a proof."""


@dataclass(frozen=True)
class Finding:
    """A verdict on one obligation of a claim; without an obligation, on the claim, certificate or file."""

    certificate: str
    claim: str
    obligation: str
    verdict: Verdict
    reason: str


def passed(findings: Sequence[Finding]) -> bool:
    """Whether all that is claimed to be proved was verified. A file without claims is not proved."""
    return all(finding.verdict != "fails" for finding in findings)


def check_file(path: Path | str) -> list[Finding]:
    """Return the findings about a certificate file; InputError where it cannot be read."""
    content, faults = read_file(path)
    if isinstance(content, dict) and content.get("format") == FORMAT and "certificates" not in content:  # pyright: ignore
        try:
            proved = prove_all(Path(path).read_text(encoding="utf-8"))
        except RefusedError as reason:
            return [Finding("", "", "", "fails", str(reason))]
        return [Finding("", one.claim.theorem, one.statement.written(), "holds", "") for one in proved]
    return [*(Finding("", "", "", "fails", fault) for fault in faults), *check(content)]


def check(content: Any) -> list[Finding]:
    """Return the findings about the content of a certificate file."""
    try:
        shallow(content)
        _known(content)
        proofs = _proofs(content)
    except CheckError as fault:
        return [Finding("", "", "", "fails", str(fault))]
    return [finding for given in content["certificates"] for finding in _certificate(given, proofs)]


def _known(content: Any) -> None:
    """Refuse a file of another format, or one that lacks what a file of this format has."""
    table = cast("dict[str, Any]", content if isinstance(content, dict) else {})
    given: Any = table.get("format")
    demand(given not in FORMER, f"the format is {given!r}, of an earlier version: certify again")
    shaped(content, FILE, "the file")
    demand(given == FORMAT, f"the format is not {FORMAT!r}")
    demand(len(table["certificates"]) > 0, "there are no certificates")


def _proofs(content: Any) -> list[Proved]:
    """Return what the kernel proves of a file, in which each claim must occur once, in order."""
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
        work = partial(_proved, proofs, claim) if "proof" in claim else partial(_unproved, given["subject"], claim)
        found, fault = _guarded(work)
        if found is None:
            yield Finding(name, kind, "", "fails", fault)
            continue
        for obligation, verdict, reason in found:
            yield Finding(name, kind, obligation, verdict, reason)
    if not given["claims"]:
        yield Finding(name, "", "", "not claimed", "there are no claims")


def _guarded(work: Callable[[], Any]) -> tuple[Any, str]:
    """Run a piece of work: return its result, or None and why it fails, because any error in a check fails it."""
    try:
        return work(), ""
    except CheckError as fault:
        return None, str(fault)
    except (ArithmeticError, AttributeError, LookupError, MemoryError, RecursionError, TypeError, ValueError) as error:
        return None, f"cannot be verified: {error}"


def _of_unknown_body(given: Any) -> None:
    certificate_shaped(given)
    shaped(given["subject"], UNKNOWN_BODY, "the subject")
    demand(not given["claims"] and given["outcome"] == "undecided", "it makes claims that are not available for this body")


def _of_station(name: str, subject: StationSubject, given: Any, proofs: Sequence[Proved]) -> list[Finding]:
    for claim in given["claims"]:
        shaped(claim, CLAIM, "the claim")
        for obligation in claim["obligations"]:
            shaped(obligation, OBLIGATION, "an obligation")
    absent = [f"without:{name}" for name in given["subject"]["assumed_away"]]
    demand(not any("proof" in claim for claim in given["claims"]), "a claim of a station tells of a proof")
    places: list[int] = given.get("proof", [])
    own = [proofs[place] for place in places]
    return [Finding(name, *one) for one in station_findings(subject, given, absent, own)]


def _subject(given: Any) -> StationSubject | Mapping[str, Any]:
    certificate_shaped(given)
    station = "plant" in given["subject"]
    shaped(given["subject"], STATION if station else SUBJECT, "the subject")
    outcomes = [claim.get("outcome") for claim in given["claims"]]
    kinds = [str(claim.get("kind")) for claim in given["claims"]]
    if ("pointing", "proved") in zip(kinds, outcomes, strict=True):
        # Undecided claims about an ideal loop do not count beside the loop that flies.
        outcomes = [outcome for outcome in outcomes if outcome != "undecided"]
    follows = outcome_of(outcomes)
    if follows == "proved" and not set(kinds) & set(ENDS):
        follows = "undecided"
    demand(given["outcome"] == follows, "the outcome does not follow from the claims")
    demand(len(set(kinds)) == len(kinds), "two claims are of the same kind")
    return read_station(given["subject"]) if station else given["subject"]


def _proved(proofs: Sequence[Proved], claim: Any) -> list[tuple[str, Verdict, str]]:
    """Return the kernel's findings about a claim with a proof; numbers and assumptions are only those of the proof."""
    shaped(claim, PROVED, "the claim")
    proved = proofs[int(claim["proof"])]
    demand(proved.statement.label == claim["kind"], f"the proof is of another kind of claim: {proved.statement.label}")
    refuted = proved.statement.refutes
    demand(claim["outcome"] == ("refuted" if refuted else "proved"), "the outcome is not that of the proof")
    if refuted:
        return [("", "not claimed", f"refuted by the kernel: {proved.statement.text}")]
    names = dict.fromkeys(name.rstrip("+-0123456789 ") for name, _ in proved.shown)
    return [(name, "holds", BY_THE_KERNEL) for name in names]


def _unproved(about: Mapping[str, Any], claim: Any) -> list[tuple[str, Verdict, str]]:
    """Return what is left open of a claim without a proof, which says neither that it is proved nor that it is refuted."""
    shaped(claim, CLAIM, "the claim")
    for obligation in claim["obligations"]:
        shaped(obligation, OBLIGATION, "an obligation")
    demand(claim["outcome"] == "undecided", "such a claim needs a proof, or is undecided")
    outcomes = {obligation["outcome"] for obligation in claim["obligations"]}
    demand(outcomes == {"undecided"} and not claim["witness"], "an undecided claim needs a reason, and has no proof")
    absent = [f"without:{name}" for name in about["assumed_away"]]
    demand({*absent} <= {*claim["assumptions"]}, "a part that the claim leaves out is not named")
    named = [name for name in claim["assumptions"] if not name.startswith("without:")]
    demand({*named} <= {*ASSUMPTIONS, "unknown-outside-torque"}, "there is no such assumption")
    return [(o["name"], "not claimed", "undecided, the claim is not proved") for o in claim["obligations"]]
