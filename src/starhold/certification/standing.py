"""A claim stands on some numbers of its loop; others may change, or change within bounds, with the claim still proved."""

from collections.abc import Set
from dataclasses import dataclass

from starhold.certification.assumptions import LINEAR, UNLIMITED, WHEELS
from starhold.certification.certificate import Claim


@dataclass(frozen=True)
class Standing:
    """A claim stands with the gains it was made for, and with other numbers where this says so.

    known: whether with any inertia that the law takes the craft for; true: "given" with the true one it was made for,
    "any", or "box" with those whose entries differ by at most `tolerance` sqrt(J_ii J_jj); limit: "given", "any" or
    "above", which is that limit or a larger one; momentum: whether with any angular momentum at the start; start: the
    level of V that the start is to be below, None for any start."""

    known: bool
    true: str
    tolerance: float | None
    limit: str
    momentum: bool
    start: float | None


def standing(claim: Claim, reads: Set[str]) -> Standing:
    """Tell what a claim stands on, of a law that reads these numbers of its nominal model: "inertia", "torque_limit"."""
    free = not {UNLIMITED, WHEELS, LINEAR}.isdisjoint(claim.assumptions)
    limit = "given"
    if "torque_limit" not in reads:
        # A set on which the torque is within its limit is one for every larger limit.
        limit = "any" if free else "above" if "limit" in claim.numbers else "given"
    tolerance: float | None = claim.numbers.get("tolerance")
    true = "given" if "tolerance" not in claim.numbers else "any" if tolerance is None else "box"
    return Standing(
        "inertia" not in reads and true != "given",
        true,
        tolerance,
        limit,
        "momentum" not in claim.numbers,
        claim.numbers.get("start"),
    )
