"""A certificate holds the loop it speaks of, claims as numbers, and for each claim what had to be shown and how.

Sentences are made from the numbers when they are shown (`wording`), so that nothing in the file can say more than what
the independent checker verifies.
"""

from __future__ import annotations

import json
import platform
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from importlib import metadata
from pathlib import Path
from typing import Any, Literal

from starhold.version import __version__

FORMAT = "starhold certificate 2"
FILE = "certificate.json"
Outcome = Literal["proved", "refuted", "undecided"]
EXACT, BALLS, LASALLE = "exact identity", "ball arithmetic", "LaSalle"
EXACT_SIGN = "exact inequality"
UNLIMITED = "torque not limited"
WHEELS = "neither torque nor wheels limited, wheels without friction"
"""Claims about loops with wheels assume this in place of torque that is not limited."""


@dataclass(frozen=True)
class Obligation:
    """One thing that had to be shown. `how`: by exact identity or inequality in rationals, by ball arithmetic, or by a
    LaSalle argument; `evidence`: where it is refuted, the state (or inertia, or eigenvalue) that refutes it, else why it
    is undecided."""

    name: str
    how: str
    outcome: Outcome
    evidence: dict[str, Any] = field(default_factory=dict[str, Any])


@dataclass(frozen=True, repr=False)
class Claim:
    """`kind` says what is claimed, `numbers` how much, in SI units; None among them means without bound. `witness`:
    numbers that make the proof, and that a checker needs."""

    kind: str
    numbers: dict[str, Any]
    witness: dict[str, Any]
    assumptions: tuple[str, ...]
    obligations: tuple[Obligation, ...]

    def __repr__(self) -> str:
        return f"<Claim {self.kind}: {self.outcome}; {len(self.obligations)} obligations>"

    @property
    def outcome(self) -> Outcome:
        """Refuted if an obligation is, else undecided if one is."""
        found = {obligation.outcome for obligation in self.obligations}
        if "refuted" in found:
            return "refuted"
        return "proved" if found == {"proved"} else "undecided"

    def refutation(self) -> Obligation | None:
        """The first obligation that is refuted."""
        return next((o for o in self.obligations if o.outcome == "refuted"), None)


BESIDE = ("sampling", "control-limit", "saturated-axis")
"""Kinds of claims about a control loop that say nothing of where its motion ends, and go with one that does."""


@dataclass(frozen=True, repr=False)
class Certificate:
    """Claims about one closed loop; `subject` holds all that the claims speak of, as plain numbers and names. `proof`: what
    the kernel is given, of claims that it decides."""

    name: str
    subject: dict[str, Any]
    claims: tuple[Claim, ...]
    proof: dict[str, Any] | None = None

    def __repr__(self) -> str:
        claims = ", ".join(f"{claim.kind} {claim.outcome}" for claim in self.claims)
        return f"<Certificate {self.name}: {claims or 'no claims'}>"

    @property
    def outcome(self) -> Outcome:
        """Refuted if a claim is, undecided if one is or none is made of where the motion ends."""
        found = {claim.outcome for claim in self.claims}
        if "refuted" in found:
            return "refuted"
        ends = any(claim.kind not in BESIDE for claim in self.claims)
        return "proved" if ends and found == {"proved"} else "undecided"

    def claim(self, kind: str) -> Claim | None:
        """The claim of a kind, where one is made."""
        return next((claim for claim in self.claims if claim.kind == kind), None)


def write(certificates: Sequence[Certificate], scenario: str, path: Path) -> None:
    """The certificates of a scenario's laws as one JSON file; every number reads back as the same float."""
    versions = {"starhold": __version__, "python": platform.python_version()}
    versions |= {name: metadata.version(name) for name in ("python-flint", "numpy", "scipy")}
    content = {
        "format": FORMAT,
        "scenario": scenario,
        "versions": versions,
        "certificates": [_plain(c) for c in certificates],
    }
    path.write_text(json.dumps(content, indent=1, allow_nan=False) + "\n", encoding="utf-8")


def _plain(certificate: Certificate) -> dict[str, Any]:
    claims: list[dict[str, Any]] = []
    for claim in certificate.claims:
        claims.append({"kind": claim.kind, "outcome": claim.outcome, **asdict(claim)})
    kinds = [claim["kind"] for claim in claims]
    about = {"outcome": certificate.outcome, "subject": certificate.subject, "kinds": kinds}
    proof = {} if certificate.proof is None else {"proof": certificate.proof}
    return {"name": certificate.name, **about, "claims": claims, **proof}
