"""A law as a program of the proof kernel. Its digest is in certificates, exported C, runs and the report, and so ties the
program that flies to the one proved."""

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
"""For each body a measurement with every number an input."""


def law_program(law: Law, gains: Any, craft: Any, period: float, remembers: bool = False) -> dict[str, Any]:
    """Return a law's command as a program; gains and craft are inputs but for choices and whole numbers. remembers: so is
    the memory, and the new one stands behind the command; else it is that of the start. Errors as of `straight_line`."""
    memory = law.remember(gains, craft, period)
    if remembers:
        return straight_line(law.command, measurement=ASKED[law.body], gains=gains, craft=craft, memory=memory)

    def command(measurement: Any, gains: Any, craft: Any) -> Any:
        return law.command(measurement, gains, craft, memory)[0]

    return straight_line(command, measurement=ASKED[law.body], gains=gains, craft=craft)


def planned_program(plan: Plan, craft: Any) -> dict[str, Any]:
    """Return the torque of a plan's first move where its limits shape none, as a program; the craft is an input."""

    def command(measurement: Any, craft: Any) -> Any:
        return first_move(measurement, plan.free[0], craft)

    return straight_line(command, measurement=ASKED["rigid-body"], craft=craft)


def law_digest(law: Law, gains: Any, craft: Any, period: float) -> str:
    """Return the SHA-256 of a law's program; empty for a law that keeps a memory, or has no such program."""
    if law.body not in ASKED or any(True for _ in leaves(law.remember(gains, craft, period))):
        return ""
    try:
        return digest(law_program(law, gains, craft, period))
    except (InputError, UnreadableError):
        return ""
