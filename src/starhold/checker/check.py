"""The check of a certificate file: the kernel decides every proof, and the rest of the file must not say more than the
proofs."""

import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypeAlias, cast

from starhold.errors import InputError
from starhold.kernel.check import Proved
from starhold.kernel.check import check as prove_all
from starhold.kernel.numbers import RefusedError
from starhold.kernel.reading import FORMAT
from starhold.kernel.sentences import ASSUMPTIONS

BYTES, DEEPEST, DIGITS = 2**26, 32, 1_000
"""The largest file (bytes); the deepest nesting of its objects and lists; the most digits of a number."""
FORMER = tuple(f"starhold {kind}certificate {version}" for kind in ("", "invariant ") for version in (1, 2))
"""Formats of earlier versions, whose keys had other names."""
ENDS = (
    "convergence", "region", "torque-limit", "wheels", "inertia", "pointing", "sliding", "circle", "equilibrium",
    "hand-over", "appendages",
)  # fmt: skip
"""Kinds of claims with an ultimate bound, one of which a certificate must contain to count as proved."""
BY_THE_KERNEL = "proved by the kernel"
"""The reason of findings about claims with a proof."""
Test: TypeAlias = Callable[[Any], bool]
Verdict: TypeAlias = Literal["holds", "fails", "not claimed"]


class CheckError(Exception):
    """Something in a certificate does not hold, or cannot be verified."""


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


# --- files ------------------------------------------------------------------------------------------------------------


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
    lists: list[Any] = [given.get("claims") for given in content["certificates"]]
    claims: Any = [claim for listed in lists if isinstance(listed, list) for claim in listed]  # pyright: ignore
    proofs: list[Any] = [claim["proof"] for claim in claims if isinstance(claim, dict) and "proof" in claim]
    demand(proofs == [*range(len(content["claims"]))], "the proofs are not those that the claims count")
    if not proofs:
        demand(not content["programs"], "there are programs without a proof")
        return []
    try:
        return prove_all(json.dumps(content))
    except RefusedError as fault:
        raise CheckError(f"refused by the kernel: {fault}") from None


# --- certificates -----------------------------------------------------------------------------------------------------


def _certificate(given: Any, proofs: Sequence[Proved]) -> Iterator[Finding]:
    name = str(given.get("name", ""))
    try:
        _whole(given)
    except CheckError as fault:
        yield Finding(name, "", "", "fails", str(fault))
        return
    for claim in given["claims"]:
        kind = str(claim.get("kind", ""))
        try:
            checked = _proved(proofs, claim) if "proof" in claim else _unproved(given["subject"], claim)
        except CheckError as fault:
            checked: list[tuple[str, Verdict, str]] = [("", "fails", str(fault))]
        yield from (Finding(name, kind, *one) for one in checked)
    if not given["claims"]:
        yield Finding(name, "", "", "not claimed", "there are no claims")


def _whole(given: Any) -> None:
    """Check that a certificate has its keys, the claims whose kinds it lists, and the outcome that follows from them. Its
    subject, which nothing is proved from, is for readers."""
    shaped(given, CERTIFICATE, "the certificate")
    kinds, outcomes = ([claim.get(key) for claim in given["claims"]] for key in ("kind", "outcome"))
    demand(given["kinds"] == kinds, f"the claims are not those listed: {', '.join(given['kinds']) or '(none)'}")
    demand(len(set(map(str, kinds))) == len(kinds), "two claims are of the same kind")
    demand("body" not in given["subject"] or not kinds, "it makes claims that are not available for this body")
    if ("pointing", "proved") in zip(kinds, outcomes, strict=True):
        # Undecided claims about an ideal loop do not count beside the loop that flies.
        outcomes = [outcome for outcome in outcomes if outcome != "undecided"]
    proved = bool(set(kinds) & set(ENDS)) and all(outcome == "proved" for outcome in outcomes)
    follows = "refuted" if "refuted" in outcomes else "proved" if proved else "undecided"
    demand(given["outcome"] == follows, "the outcome does not follow from the claims")


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
    absent = [f"without:{name}" for name in about.get("assumed_away") or ()]
    demand({*absent} <= {*claim["assumptions"]}, "a part that the claim leaves out is not named")
    named = [name for name in claim["assumptions"] if not name.startswith("without:")]
    demand({*named} <= {*ASSUMPTIONS, "unknown-outside-torque"}, "there is no such assumption")
    return [(o["name"], "not claimed", "undecided, the claim is not proved") for o in claim["obligations"]]


# --- shapes -----------------------------------------------------------------------------------------------------------


def demand(holds: bool, otherwise: str) -> None:
    """Raise a CheckError unless something holds."""
    if not holds:
        raise CheckError(otherwise)


def shaped(given: Any, shape: Mapping[str, Test], where: str) -> None:
    """Check that an object has exactly the keys of a shape, and values that their tests allow."""
    demand(isinstance(given, Mapping), f"{where} is not an object")
    demand(set(given) == set(shape), f"{where} must have the keys {', '.join(shape) or '(none)'}")
    for key, test in shape.items():
        demand(test(given[key]), f"{where} has a value that is not allowed under {key}")


def _text(x: Any) -> bool:
    """Return whether a text is printable: no lone surrogates, no terminal control characters."""
    return isinstance(x, str) and x.isprintable()


def _plain(x: Any) -> bool:
    """Return whether a value consists of finite numbers, printable texts, lists and objects."""
    if isinstance(x, Mapping):
        return all(isinstance(key, str) and _plain(value) for key, value in x.items())  # pyright: ignore
    if isinstance(x, list):
        return all(map(_plain, x))  # pyright: ignore
    return x is None or _text(x) or isinstance(x, int) or (isinstance(x, float) and math.isfinite(x))


def _object(x: Any) -> bool:
    return isinstance(x, dict) and _plain(x)


def _list(test: Test) -> Test:
    return lambda x: isinstance(x, list) and all(map(test, x))  # pyright: ignore


def _table(x: Any) -> bool:
    return isinstance(x, dict)


def _outcome(x: Any) -> bool:
    return x in ("proved", "refuted", "undecided")


def _subject(x: Any) -> bool:
    return _object(x) and _list(_text)(x.get("assumed_away", []))


FILE: dict[str, Test] = {
    **dict.fromkeys(("format", "scenario", "note"), _text),
    "versions": lambda x: _table(x) and all(map(_text, x.values())),
    "programs": _table,
    **dict.fromkeys(("claims", "certificates"), _list(_table)),
}
PROVED: dict[str, Test] = {"kind": _text, "outcome": _outcome, "proof": lambda x: type(x) is int and x >= 0}
"""A claim that the file has a proof of, by its place."""
CERTIFICATE: dict[str, Test] = {
    "name": lambda x: _text(x) and len(x) <= 1_000,
    "outcome": _outcome,
    "subject": _subject,
    "kinds": _list(_text),
    "claims": _list(_table),
}
CLAIM: dict[str, Test] = {
    "kind": _text,
    "outcome": _outcome,
    "numbers": _object,
    "witness": _object,
    "assumptions": _list(_text),
    "obligations": _list(_table),
}
OBLIGATION: dict[str, Test] = {"name": _text, "how": _text, "outcome": _outcome, "evidence": _object}
