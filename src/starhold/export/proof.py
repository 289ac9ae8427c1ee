"""Headers state the proofs: claims in sentences, assumptions, and a warning where something is missing."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from starhold.certification.assumptions import texts
from starhold.certification.certificate import FILE, Certificate
from starhold.certification.wording import HEADINGS, evidence, recheck, sentence, unclaimed


class Proof(NamedTuple):
    """The certificate's file and the digest of that (both empty for none), its outcome, a line for each claim, what they
    assume, why nobody should fly the law unread (empty where all is proved), and the command that checks it again."""

    file: str
    digest: str
    outcome: str
    claims: tuple[str, ...]
    assumptions: tuple[str, ...]
    warning: str
    recheck: str = ""


UNPROVED = Proof("", "", "", (), (), "NO CERTIFICATE. Nothing was proved of this law, because nobody asked for it.")


def proof_of(certificates: Sequence[Certificate], digest: str) -> Proof:
    """Return the summary of the certificates of one law; digest: that of the file which holds them, as hexadecimal."""
    claims: list[str] = []
    wrong: list[str] = []
    assumed: dict[str, None] = {}
    for certificate in certificates:
        if not certificate.claims:
            wrong.append(f"NOTHING IS CLAIMED: {unclaimed(certificate.subject)}.")
        for claim in certificate.claims:
            whose = f"{certificate.name}: " if len(certificates) > 1 else ""
            text = f"{whose}{HEADINGS[claim.kind]}: {sentence(claim, certificate.subject)}"
            claims.append(f"{claim.outcome}: {text}")
            assumed |= dict.fromkeys(texts(claim.assumptions))
            if claim.outcome != "proved":
                refutation = claim.refutation()
                why = f" ({evidence(refutation)})" if refutation is not None else ""
                wrong.append(f"{'REFUTED' if claim.outcome == 'refuted' else 'NOT DECIDED'}: {text}{why}.")
    outcomes = {certificate.outcome for certificate in certificates}
    outcome = next((one for one in ("refuted", "undecided") if one in outcomes), "proved")
    if outcome != "proved" and not wrong:
        wrong.append("NOT DECIDED where the motion ends: no claim is made of it.")
    return Proof(FILE, digest, outcome, tuple(claims), tuple(assumed), "\n".join(wrong), recheck(certificates))
