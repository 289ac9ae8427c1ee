"""Certificates of station-keeping loops: what they speak of, and which claims are made."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from starhold.certification.certificate import EXACT, Certificate, Claim, Obligation
from starhold.certification.circle import attracts, control_limit
from starhold.certification.equilibrium import returns, saturated_axis
from starhold.certification.openness import assumed_away, named
from starhold.certification.station_terms import UNLIMITED, assumed, lag_of, model_of
from starhold.certification.subject import described_gains
from starhold.loop.closed_loop import ClosedLoop


def certify_station(loop: ClosedLoop, name: str = "") -> Certificate:
    """The certificate of a station-keeping loop; without claims, which is undecided, for a law that none are made about."""
    # What overflows in a guess is caught where the guess is verified.
    with np.errstate(all="ignore"):
        try:
            claims = _claims(loop)
        except (OverflowError, ZeroDivisionError) as reason:
            refused = Obligation(
                "form", EXACT, "undecided", {"reason": f"gains and plant are too far apart in size: {reason}"}
            )
            kind = "circle" if loop.law.name == "l2-circle" else "equilibrium"
            claims = [Claim(kind, {}, {}, assumed(loop, UNLIMITED), (refused,))]
    return Certificate(name or loop.law.name, described_station(loop), named(claims, loop))


def _claims(loop: ClosedLoop) -> list[Claim]:
    claims: list[Claim] = []
    limited = loop.limit != "none" and math.isfinite(loop.saturation_limit())
    if loop.law.name == "l2-circle":
        claims.append(attracts(loop))
        if limited and claims[0].outcome == "proved":
            claims.append(control_limit(loop))
    elif loop.law.name == "l2-equilibrium":
        claims.append(returns(loop))
        if limited and loop.limit == "axis" and model_of(loop) == "linear" and claims[0].outcome == "proved":
            claims.append(saturated_axis(loop))
    return claims


def described_station(loop: ClosedLoop) -> dict[str, Any]:
    """The loop as plain numbers and names, all that a checker needs to build it again."""
    return {
        "law": loop.law.name,
        "gains": described_gains(loop.law, loop.gains),
        "plant": loop.craft._asdict(),
        "model": model_of(loop),
        "limit": loop.limit,
        "control_limit": loop.saturation_limit() if math.isfinite(loop.saturation_limit()) else None,
        "lag": lag_of(loop),
        "control_period": loop.period,
        "assumed_away": assumed_away(loop),
    }
