"""Verdicts on how a measurement compares with a printed number or statement. They are computed; the expected ones are
recorded, so that a change is noticed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal
from typing import Literal, TypeAlias

Verdict: TypeAlias = Literal["agrees", "close", "differs", "holds", "depends", "fails"]
VERDICTS: dict[Verdict, str] = {
    "agrees": "our number, rounded to the printed digits, is the printed one, or it lies beyond the printed bound",
    "close": "our number does not round to the printed digits, but lies within the tolerance that the row states",
    "differs": "our number lies outside that tolerance",
    "holds": "the statement is true in every case that was tried or proved",
    "depends": "the statement is true for some of the choices that the publication leaves open, and false for others",
    "fails": "the statement is false in every case",
}
PLAIN: tuple[Verdict, ...] = ("agrees", "holds")
"""The verdicts that need no explanation."""


@dataclass(frozen=True)
class Finding:
    """A measurement: a number (or one for each printed number), or whether a statement is true, in general or by the names
    of choices. The note describes it briefly."""

    value: float | Sequence[float] | bool | dict[str, bool]
    note: str = ""


@dataclass(frozen=True)
class Printed:
    """A printed number: its digits, and whether it is a bound beyond which the true value lies."""

    text: str
    bound: str = ""

    @classmethod
    def read(cls, text: str) -> Printed:
        """Return the number in "22.8", "1.2e-6", "> 3000" or "< 0.1". ValueError for anything else."""
        stripped = text.strip()
        bound = stripped[0] if stripped[:1] in ("<", ">") else ""
        digits = stripped.removeprefix(bound).strip()
        if not Decimal(digits).is_finite():
            raise ValueError(f"not a number: {text!r}")
        return cls(digits, bound)

    @property
    def value(self) -> float:
        """The number."""
        return float(self.text)

    def rounds_from(self, ours: float) -> bool:
        """Return whether a number rounds to the printed digits; a half may round either way."""
        if not math.isfinite(ours):
            return False
        exponent = Decimal(self.text).as_tuple().exponent
        assert isinstance(exponent, int)
        half = Decimal(5).scaleb(exponent - 1)
        return abs(Decimal(ours) - Decimal(self.text)) <= half

    def judge(self, ours: float, tolerance: float) -> Verdict:
        """Return the verdict on a number; the tolerance is a share of the printed number."""
        if self.bound:
            beyond = ours > self.value if self.bound == ">" else ours < self.value
            return "agrees" if beyond else "differs"
        if self.rounds_from(ours):
            return "agrees"
        return "close" if abs(ours - self.value) <= tolerance * abs(self.value) else "differs"


def judge(finding: Finding, printed: Sequence[Printed], tolerance: float) -> Verdict:
    """Return the verdict on a finding; for several numbers, the worst of their verdicts. ValueError where the finding and
    the printed value are of different kinds."""
    value = finding.value
    if isinstance(value, dict):
        if printed or not value:
            raise ValueError("cases answer a statement, of at least one choice, not a number")
        return "holds" if all(value.values()) else "depends" if any(value.values()) else "fails"
    if isinstance(value, bool):
        if printed:
            raise ValueError("yes or no does not answer a number")
        return "holds" if value else "fails"
    numbers = [value] if isinstance(value, (int, float)) else list(value)
    if len(numbers) != len(printed):
        raise ValueError(f"{len(numbers)} numbers measured, {len(printed)} printed")
    verdicts = {one.judge(float(ours), tolerance) for one, ours in zip(printed, numbers, strict=True)}
    worst: Sequence[Verdict] = ("differs", "close", "agrees")
    return next(verdict for verdict in worst if verdict in verdicts)
