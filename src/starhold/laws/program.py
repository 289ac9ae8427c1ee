"""A law as a program of the proof kernel. Its digest in certificates, exported C, runs and the report ties the program that
flies to the one proved."""

from __future__ import annotations

from typing import Any

from starhold.algebra.operations import UnreadableError
from starhold.algebra.structure import leaves
from starhold.algebra.vector import ZERO
from starhold.errors import InputError
from starhold.kernel.programs import digest
from starhold.laws.catalogue import Law
from starhold.laws.interface import Measurement
from starhold.laws.point import PointMeasurement
from starhold.laws.predictive.free import Plan, first_move
from starhold.trace.straight_line import straight_line

ASKED: dict[str, Any] = {
    "rigid-body": Measurement((1.0, *ZERO), ZERO, ZERO, ZERO, ZERO, ZERO, ZERO, 0.0, ZERO, ZERO, 0.0, 1.0),
    "libration-point": PointMeasurement(ZERO, ZERO, 0.0, 0.0),
}
"""For each body, a measurement in which every number is an input."""


def law_program(law: Law, gains: Any, craft: Any, period: float, remembers: bool = False) -> dict[str, Any]:
    """Return a law's command as a program; gains and craft are inputs, except for choices and integers. remembers: the
    memory is an input too, and the new memory follows the command in the output; else the memory is the initial one. Errors
    as in `straight_line`."""
    memory = law.remember(gains, craft, period)
    if remembers:
        return straight_line(law.command, measurement=ASKED[law.body], gains=gains, craft=craft, memory=memory)

    def command(measurement: Any, gains: Any, craft: Any) -> Any:
        return law.command(measurement, gains, craft, memory)[0]

    return straight_line(command, measurement=ASKED[law.body], gains=gains, craft=craft)


def planned_program(plan: Plan, craft: Any) -> dict[str, Any]:
    """Return the torque of a plan's first move, with no limit active, as a program; the craft is an input."""

    def command(measurement: Any, craft: Any) -> Any:
        return first_move(measurement, plan.free[0], craft)

    return straight_line(command, measurement=ASKED["rigid-body"], craft=craft)


def law_digest(law: Law, gains: Any, craft: Any, period: float) -> str:
    """Return the SHA-256 of a law's program; empty for a law with a memory, or without such a program."""
    if law.body not in ASKED or any(True for _ in leaves(law.remember(gains, craft, period))):
        return ""
    try:
        return digest(law_program(law, gains, craft, period))
    except (InputError, UnreadableError):
        return ""
