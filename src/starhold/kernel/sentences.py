"""Sentences about what was checked, and the assumptions under which it holds of a spacecraft. Numbers are rounded so as to
say no more than was proved."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from decimal import ROUND_CEILING, ROUND_FLOOR, Context
from fractions import Fraction

ASSUMPTIONS = {
    "rigid-body": "the body is rigid",
    "inertia-as-given": "its inertia is exactly as given",
    "appendages-as-given": "the hub is rigid, and its inertia and its appendages are exactly as given",
    "inertia-near": "its inertia is near the one given",
    "exact-measurement": "measurements are exact",
    "ideal-actuators": "actuators give at once what the law asks",
    "continuous-torque": "the torque is applied continuously",
    "unlimited-torque": "the torque is not limited",
    "no-outside-torque": "there is no torque from outside",
    "known-outside-torque": "a torque from outside is as the law is told",
    "bounded-outside-torque": "a torque from outside is at most as told",
    "changing-outside-torque": "a torque from outside is told as at the attitude told, and changes no faster than told",
    "untold-torque": "the law is given no torque from outside",
    "bounded-push": "torques from outside and errors of the command are no larger than told",
    "held-torque": "the torque is what the law asks for at the last sample, and the error",
    "late-torque": "the torque that acts is off by e, which nears 0 in a period, and then changes with what is asked for",
    "late-alike": "all components of e near 0 alike, and no faster than told",
    "late-told": "errors of what the law is told are no larger at the start than if the body had moved so before",
    "best-plan": "the law's torque is of a plan as told, for the given inertia and motion linearised about the rate told",
    "gaussian-noise": "noise is Gaussian, and independent from sample to sample",
    "linear-estimate": "noise and errors of readings put an estimate off linearly, as for the target's rate at the start",
    "settled-estimate": "an estimate has settled before",
    "valid-estimate": "an estimate is valid throughout",
    "held-field": "the field at a craft is held for a control period, and is as told",
    "rods-alike": "rods give at once, and hold, the least dipole for the torque, all reduced alike if one is at its limit",
    "target-at-rest": "the target is at rest",
    "known-target": "the target's motion is as the law is told",
    "bounded-target": "the target turns, and its rate changes, no faster than told",
    "no-wheels": "no wheels turn",
    "idle-wheels": "wheels keep their momentum, and it is at most as told",
    "frictionless-wheels": "wheels have no friction, and share the torque by least squares",
    "unlimited-wheels": "wheels have no limits but those told",
    "spare-momentum": "no rotor is filled by what wheels store against one another, which friction changes",
    "bounded-momentum": "body and wheels have no more momentum together than told",
    "linear-motion": "the motion is linear, as it is near rest",
    "quaternion-as-fed": "the quaternion that is fed back never jumps",
    "equations-as-given": "the equations are exactly as given",
    "filippov": "motions are those in the sense of Filippov where the right-hand side jumps",
    "sign-at-once": "the sign of the quaternion is chosen at once",
    "linear-field": "linear motion near the point",
    "whole-field": "motion exactly as modelled",
    "circling-bodies": "circular motion of the two bodies",
    "exact-place": "position and velocity exactly known",
    "continuous-control": "control applied continuously, without lag",
    "unlimited-control": "control not limited",
    "in-the-plane": "starts in the plane x = 0 without a rate along X",
    "held-aside": "held at rest along Y and Z, where no Coriolis acceleration acts along X",
    "off-the-bodies": "never at the centre of one of the two bodies",
}
"""The assumption in words, by its identifier."""


@dataclass(frozen=True)
class Statement:
    """A sentence, the identifiers of what it assumes, a label of what it is about, and whether it refutes such a claim.
    within: times (s), and the sines of half the angles to the target that motions do not exceed from then on."""

    text: str
    assumptions: tuple[str, ...]
    label: str = ""
    refutes: bool = False
    within: tuple[tuple[Fraction, Fraction], ...] = ()

    def written(self) -> str:
        """Return the sentence with its assumptions."""
        return f"{self.text}; if {', '.join(ASSUMPTIONS[name] for name in self.assumptions)}"


def below(x: Fraction) -> str:
    """Write a number with seven digits, rounded down."""
    return _rounded(x, ROUND_FLOOR)


def above(x: Fraction) -> str:
    """Write a number with seven digits, rounded up."""
    return _rounded(x, ROUND_CEILING)


def _rounded(x: Fraction, rounding: str) -> str:
    # A float of few digits as it was written.
    if abs(x) < 2**60 and x.denominator < 2**200 and x == Fraction(float(x)) and len(repr(float(x))) <= 9:
        return f"{float(x):g}" if float(x) == float(f"{float(x):g}") else repr(float(x))
    # Digits enough that the quotient of two exact numbers is rounded once only.
    wide, narrow = Context(prec=400, rounding=rounding), Context(prec=7, rounding=rounding)
    quotient = wide.divide(wide.create_decimal(x.numerator), wide.create_decimal(x.denominator))
    return f"{narrow.plus(quotient):g}"


def enumerated(parts: Sequence[str]) -> str:
    """Join some parts of a sentence."""
    return ", and ".join(parts)
