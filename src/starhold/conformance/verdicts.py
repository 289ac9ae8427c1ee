"""What a check of a law finds, and the check that laws of all kinds share."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Literal, NamedTuple

from starhold.errors import InputError
from starhold.laws.catalogue import Law
from starhold.laws.interface import Card, fields


class NonconformityError(Exception):
    """A law breaks the check; the text says how."""


class NotApplicableError(Exception):
    """The check says nothing about this law; the text says why."""


class Verdict(NamedTuple):
    """What a check found."""

    name: str
    outcome: Literal["passed", "failed", "does not apply"]
    reason: str


def run(checks: Iterable[Callable[..., None]], law: Law) -> Iterator[Verdict]:
    """Run checks over a law, in order, going on after failures."""
    for check in checks:
        name = (check.__doc__ or check.__name__).splitlines()[0].rstrip(".")
        try:
            check(law)
        except NotApplicableError as reason:
            yield Verdict(name, "does not apply", str(reason))
        except Exception as reason:
            kind = "" if isinstance(reason, (NonconformityError, InputError)) else f"{type(reason).__name__}: "
            yield Verdict(name, "failed", kind + str(reason))
        else:
            yield Verdict(name, "passed", "")


def require(condition: bool, reason: str) -> None:
    if not condition:
        raise NonconformityError(reason)


def declares_itself(law: Law) -> None:
    """The file declares a card, gains with units, and examples within their bounds."""
    require(isinstance(law.card, Card), "CARD is not a Card")
    declared = fields(law.gains)
    require(bool(law.examples()), "examples() is empty")
    for gains in law.examples():
        require(isinstance(gains, law.gains), f"the example {gains} is not a Gains")
        for item, value in zip(declared, gains, strict=True):
            shown = item.gain.choices[value] if item.gain.choices else value
            require(item.gain.check(shown) == value, f"the example's {item.name} = {value} changes when it is read")
    if law.card.claims != "none":
        require(bool(law.card.assumptions), "a law that claims stability states its assumptions")
