"""A check's verdict, and helpers shared by the checks of parts of all roles."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, NamedTuple, TypeVar

from starhold.algebra.structure import flatten
from starhold.certification.certificate import Certificate
from starhold.errors import InputError, is_interrupt
from starhold.laws.catalogue import Law
from starhold.laws.interface import Card, fields
from starhold.loop.kernels import fly_plainly
from starhold.parts.catalogue import error_line
from starhold.parts.part import Part
from starhold.scenario.checking import nearest
from starhold.simulation.lane import fly
from starhold.simulation.lanes import simulate_many

Found = TypeVar("Found")
STEPS = 40
"""Control steps of a flight in the checks."""


class NonconformityError(Exception):
    """A law fails a check; the message says how."""


class NotApplicableError(Exception):
    """A check does not apply to a law; the message says why."""


class Verdict(NamedTuple):
    """A check's name, its outcome and its reason."""

    name: str
    outcome: Literal["passed", "failed", "does not apply"]
    reason: str


def run(checks: Iterable[Callable[..., None]], part: Part) -> Iterator[Verdict]:
    """Run checks over a part or a law, in order, and continue after failures; return the verdicts."""
    for check in checks:
        name = (check.__doc__ or check.__name__).splitlines()[0].rstrip(".")
        try:
            check(part)
        except NotApplicableError as reason:
            yield Verdict(name, "does not apply", str(reason))
        except (NonconformityError, InputError) as reason:
            yield Verdict(name, "failed", str(reason))
        except BaseException as reason:
            if is_interrupt(reason):
                raise
            yield Verdict(name, "failed", error_line(reason, part.file))
        else:
            yield Verdict(name, "passed", "")


def find(given: str, installed: Mapping[str, Found], read: Callable[[Path], Found], what: str) -> Found:
    """Return the part installed under a name, or the result of `read` for a file of this name; what: its kind in errors.

    Raise InputError if there is none."""
    path = Path(given)
    if given in installed and not path.is_file():
        return installed[given]
    try:
        return read(path)
    except FileNotFoundError:
        allowed = f"a Python file that holds a {what}, or a {what} by name: {nearest(given, list(installed))}"
        raise InputError(given, "", "no such file", allowed) from None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else ""
        raise InputError(given, "", reason or "", f"a Python file that holds a {what}" if reason else str(error)) from None


def require(condition: bool, reason: str) -> None:
    if not condition:
        raise NonconformityError(reason)


def round_trips(law: Law, write: Callable[..., str], parse: Callable[[str, str], Any]) -> None:
    """Check that gains written to a scenario file and read back are the same, and unknown keys refused."""
    for gains in law.examples():
        text = write(law, gains)
        require(parse(text, law.name).laws[0].gains == gains, "gains change on the way through TOML")
        try:
            parse(text + "no_such_key = 1\n", law.name)
        except InputError:
            continue
        raise NonconformityError("an unknown key is accepted")


def agree(loop: Any, starts: Sequence[Any], lanes: Sequence[int]) -> None:
    """Check that a single flight, these lanes of a batch with the same start, and plain Python agree bit for bit."""
    end, plain = fly(loop, STEPS)[1], fly_plainly(loop, STEPS)
    one = flatten((end.state, end.effectors))
    for threads in (1, 2):
        batch = simulate_many(loop, starts, STEPS, threads=threads)
        same = all(batch.states[:, lane].tolist() == one for lane in lanes)
        require(same, f"a lane of a batch on {threads} threads differs from a single flight")
    require(flatten((plain.state, plain.effectors)) == one, "plain Python differs from the compiled kernel")


def gives_reasons(certificate: Certificate) -> None:
    """Check that a certificate gives a reason for everything that it does not prove."""
    for claim in certificate.claims:
        for obligation in claim.obligations:
            explained = obligation.outcome == "proved" or bool(obligation.evidence)
            require(explained, f"{claim.kind}: {obligation.name} is {obligation.outcome} without a reason")


def declares_itself(law: Law) -> None:
    """The file declares a card, gains with units, and examples within their bounds."""
    require(isinstance(law.card, Card), "CARD is not a Card")
    declared = fields(law.gains)
    require(bool(law.examples()), "examples() is empty")
    for gains in law.examples():
        require(isinstance(gains, law.gains), f"the example {gains} is not a Gains")
        for item, value in zip(declared, gains, strict=True):
            same = item.gain.check(item.written(value)) == value
            require(same, f"the example's {item.name} = {value} changes when it is read")
    if law.card.claims != "none":
        require(bool(law.card.assumptions), "a law that claims stability states its assumptions")
