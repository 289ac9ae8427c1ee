"""Runs the checks for laws of a body over a law."""

from collections.abc import Iterator

from starhold.conformance.verdicts import Verdict, find, run
from starhold.laws.catalogue import Law, catalogue, from_file
from starhold.parts.catalogue import parts
from starhold.studies.body import body_module


def examine(law: Law) -> Iterator[Verdict]:
    """Run every check for laws of its body over a law, in order, and continue after failures; return the verdicts."""
    return run(body_module("starhold.conformance.bodies", law.body).CHECKS, law)


def find_law(given: str) -> Law:
    """Return the law, for any body, installed under a name, or in a file. Raise InputError if there is none."""
    installed = {name: law for body in parts("body") for name, law in catalogue(body).items()}
    return find(given, installed, lambda path: from_file(path, installed), "law")
