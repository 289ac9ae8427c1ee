"""A certificate holds its loop, claims as numbers, and for each claim the obligations and their proofs. Sentences are made
from the numbers when they are displayed (`wording`), so that nothing in the file can say more than the independent checker
verifies."""

from __future__ import annotations

import io
import json
import platform
import zipfile
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field
from importlib import metadata
from itertools import count
from math import inf
from pathlib import Path
from typing import Any, Literal

from starhold import kernel
from starhold.version import __version__

FORMAT = "starhold certificate 3"
FILE, KERNEL = "certificate.json", "kernel.pyz"
NOTE = (
    "A number under 'proof' is the index, from 0, of a claim below, which kernel.pyz checks by itself. Any other claim "
    "carries no proof, and is undecided."
)
Outcome = Literal["proved", "refuted", "undecided"]
EXACT, BALLS = "exact identity", "ball arithmetic"
EXACT_SIGN = "exact inequality"
SQUARES, LYAPUNOV = "sum of squares", "Lyapunov's inequality"


@dataclass(frozen=True)
class Obligation:
    """One condition to be shown. `how`: the kind of rule; `evidence`: where it is refuted, the state (or inertia, or
    eigenvalue) that refutes it, else why it is undecided."""

    name: str
    how: str
    outcome: Outcome
    evidence: dict[str, Any] = field(default_factory=dict[str, Any])


@dataclass(frozen=True)
class Proof:
    """A proof as the kernel checks it: the claim with its evidence, and its programs by their digests."""

    claim: dict[str, Any]
    programs: dict[str, Any]

    @property
    def roles(self) -> dict[str, Any]:
        """Return the programs by their roles."""
        return {role: self.programs[name] for role, name in self.claim["programs"].items()}


@dataclass(frozen=True, repr=False)
class Claim:
    """`kind` names the claim, `numbers` quantify it, in SI units; None means unbounded. `witness`: numbers of the proof that
    a checker needs. `proof`: the proof that the kernel has checked; without one nothing is decided."""

    kind: str
    numbers: dict[str, Any]
    witness: dict[str, Any]
    assumptions: tuple[str, ...]
    obligations: tuple[Obligation, ...]
    proof: Proof | None = None

    def __repr__(self) -> str:
        return f"<Claim {self.kind}: {self.outcome}; {len(self.obligations)} obligations>"

    @property
    def outcome(self) -> Outcome:
        """Refuted if an obligation is, else undecided if one is."""
        outcomes = {obligation.outcome for obligation in self.obligations}
        if "refuted" in outcomes:
            return "refuted"
        return "proved" if outcomes == {"proved"} else "undecided"

    @property
    def programs(self) -> dict[str, Any]:
        """The programs of its proof, by their roles; none without a proof."""
        return {} if self.proof is None else self.proof.roles

    @property
    def left_out(self) -> list[str]:
        """The parts of the loop that it leaves out, each as role and name."""
        return [name.removeprefix(WITHOUT) for name in self.assumptions if name.startswith(WITHOUT)]

    def numbers_of(self, prefix: str) -> list[float]:
        """The numbers of the assumptions whose identifiers begin so."""
        return [float(name.removeprefix(prefix)) for name in self.assumptions if name.startswith(prefix)]

    def limited_to(self, until: float) -> str:
        """Return the conditions under which it is about a flight up to a time (s); empty where there are none."""
        end = min(self.numbers_of(UNTIL), default=inf)
        about = [f"the flight lasts {end:.6g} s at most"] * (end < until)
        about += ["directions give an attitude all the time"] * bool(self.numbers_of(FRESH))
        return " and ".join(["the target does not jump"] * (STEADY in self.assumptions) + about)

    def angle_from(self, time: float) -> float:
        """Return the angle (rad) that a claim about the loop as it flies bounds from this time (s) on."""
        return min(most for begin, most in self.numbers["funnel"] if begin <= time)

    def refutation(self) -> Obligation | None:
        """The first obligation that is refuted."""
        return next((o for o in self.obligations if o.outcome == "refuted"), None)


WITHOUT, ORBIT, UNTIL, LATE, FRESH, EVEN = "without:", "orbit-within:", "until:", "late:", "fresh:", "even:"
"""The prefixes of the identifiers of assumptions: that a part, role and name, is absent; that forces move the orbit by at
most a share; that a flight has not lasted longer (s); that the torque is at first no further from the command (N m);
that directions gave an attitude no longer ago (s); and that an estimate is off by no more (rad) because the body turns
otherwise than at the mean of two readings of its gyro."""
STEADY = "steady-target"
"""The assumption that the target does not jump."""
BESIDE = ("sampling", "control-limit", "saturated-axis", "detumbling")
"""Kinds of claims about a control loop that state no ultimate bound, and accompany one that does."""
NOT_SOUGHT = "not sought"
"""Why a certificate lacks the claim about the loop as it flies, where none was sought."""


@dataclass(frozen=True, repr=False)
class Certificate:
    """Claims about one closed loop; `subject` holds the loop, as plain numbers and names."""

    name: str
    subject: dict[str, Any]
    claims: tuple[Claim, ...]

    def __repr__(self) -> str:
        claims = ", ".join(f"{claim.kind} {claim.outcome}" for claim in self.claims)
        return f"<Certificate {self.name}: {claims or 'no claims'}>"

    @property
    def outcome(self) -> Outcome:
        """Refuted if a claim is; undecided if one is, or if none states an ultimate bound. Where the pointing bound of the
        loop as it flies is proved, undecided claims about an ideal loop do not count."""
        flown = any(claim.kind == "pointing" and claim.outcome == "proved" for claim in self.claims)
        decided = [claim for claim in self.claims if claim.outcome != "undecided" or not flown]
        outcomes = {claim.outcome for claim in decided}
        if "refuted" in outcomes:
            return "refuted"
        ends = any(claim.kind not in BESIDE for claim in decided)
        return "proved" if ends and outcomes == {"proved"} else "undecided"

    @property
    def unflown(self) -> str:
        """Why no claim is about the loop as it flies: `NOT_SOUGHT`, or why none was proved; empty where there is such a
        claim, or none could be expected."""
        return str(self.subject.get("no_pointing", ""))

    @property
    def no_larger_start(self) -> str:
        """Why the claim about the loop as it flies has no larger start set; empty where the largest one tried is in it."""
        return str(self.subject.get("no_larger_start", ""))

    @property
    def proofs(self) -> list[Proof]:
        """Return the proofs in the order of the file."""
        return [claim.proof for claim in self.claims if claim.proof is not None]

    @property
    def law(self) -> str:
        """Return the digest of the law's program that the proofs are about; empty where none is about the one that flies."""
        flown = [proof.claim for proof in self.proofs if {"memory", "plan"}.isdisjoint(proof.claim["taken"])]
        return next((claim["programs"]["law"] for claim in flown if "law" in claim["programs"]), "")

    def claim(self, kind: str) -> Claim | None:
        """Return the claim of this kind, or None."""
        return next((claim for claim in self.claims if claim.kind == kind), None)


def write(certificates: Sequence[Certificate], scenario: str, path: Path) -> None:
    """Write the certificates of a scenario's laws as one JSON file; every number reads back as the same float. Claims with
    proofs are in the kernel's format, next to entries that it does not read."""
    versions = {"starhold": __version__, "python": platform.python_version()}
    versions |= {name: metadata.version(name) for name in ("python-flint", "numpy", "scipy")}
    proofs = [proof for certificate in certificates for proof in certificate.proofs]
    places = count()
    content = {
        "format": FORMAT,
        "scenario": scenario,
        "versions": versions,
        "note": NOTE,
        "certificates": [_plain(c, places) for c in certificates],
        "programs": {name: program for proof in proofs for name, program in proof.programs.items()},
        "claims": [proof.claim for proof in proofs],
    }
    path.write_text(json.dumps(content, indent=1, allow_nan=False) + "\n", encoding="utf-8")


def _plain(certificate: Certificate, places: Iterator[int]) -> dict[str, Any]:
    claims: list[dict[str, Any]] = []
    for claim in certificate.claims:
        shown = {"kind": claim.kind, "outcome": claim.outcome}
        if claim.proof is not None:
            claims.append(shown | {"proof": next(places)})
        else:
            claims.append(shown | {part: value for part, value in asdict(claim).items() if part != "proof"})
    kinds = [claim["kind"] for claim in claims]
    about = {"outcome": certificate.outcome, "subject": certificate.subject, "kinds": kinds}
    return {"name": certificate.name, **about, "claims": claims}


_RUN = "import sys\nfrom kernel.check import main\nsys.exit(main(sys.argv[1:]))\n"


def kernel_bundle() -> bytes:
    """Return the bytes of kernel.pyz: python3 -I -S kernel.pyz certificate.json."""
    folder, content = Path(kernel.__file__).parent, io.BytesIO()
    files = {f"kernel/{path.relative_to(folder).as_posix()}": path.read_bytes() for path in folder.rglob("*.py")}
    with zipfile.ZipFile(content, "w", zipfile.ZIP_STORED) as archive:
        for name, data in sorted((files | {"__main__.py": _RUN.encode()}).items()):
            entry = zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0))
            entry.create_system, entry.external_attr = 3, 0o644 << 16
            archive.writestr(entry, data)
    return content.getvalue()
