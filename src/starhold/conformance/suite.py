"""The checks for laws of a body are run over a law."""

from collections.abc import Iterator
from pathlib import Path

from starhold.conformance.verdicts import Verdict, run
from starhold.errors import InputError
from starhold.laws.catalogue import Law, catalogue, from_file
from starhold.parts.catalogue import parts
from starhold.scenario.checking import nearest
from starhold.studies.body import body_module


def examine(law: Law) -> Iterator[Verdict]:
    """Run every check for laws of its body over a law, in order, going on after failures."""
    return run(body_module("starhold.conformance.bodies", law.body).CHECKS, law)


def find_law(given: str) -> Law:
    """The law for any body that is installed under a name, or stands in a file. InputError where there is none."""
    installed = {name: law for body in parts("body") for name, law in catalogue(body).items()}
    path = Path(given)
    if given in installed and not path.is_file():
        return installed[given]
    try:
        return from_file(path, installed)
    except FileNotFoundError:
        allowed = f"a Python file that holds a law, or a law by name: {nearest(given, list(installed))}"
        raise InputError(given, "", "no such file", allowed) from None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else ""
        raise InputError(given, "", reason or "", "a Python file that holds a law" if reason else str(error)) from None
