"""Certificates of station-keeping loops: what they speak of, and which claims are made."""

from __future__ import annotations

import math
from typing import Any

from starhold.certification.certificate import Certificate, Claim
from starhold.certification.circle import attracts, control_limit
from starhold.certification.rest import rests, saturated_axis
from starhold.certification.subject import described_gains
from starhold.loop.station import StationLoop


def certify_station(loop: StationLoop, name: str = "") -> Certificate:
    """The certificate of a station-keeping loop; without claims, which is undecided, for a law that none are made about."""
    claims: list[Claim] = []
    limited = loop.limit_kind != "none" and math.isfinite(loop.limit)
    if loop.law.name == "l2-circle":
        claims.append(attracts(loop))
        if limited and claims[0].outcome == "proved":
            claims.append(control_limit(loop))
    elif loop.law.name == "l2-rest":
        claims.append(rests(loop))
        if limited and loop.limit_kind == "axis" and loop.model == "linear" and claims[0].outcome == "proved":
            claims.append(saturated_axis(loop))
    return Certificate(name or loop.law.name, described_station(loop), tuple(claims))


def described_station(loop: StationLoop) -> dict[str, Any]:
    """The loop as plain numbers and names, all that a checker needs to build it again."""
    return {
        "law": loop.law.name,
        "gains": described_gains(loop.law, loop.gains),
        "plant": loop.plant._asdict(),
        "model": loop.model,
        "limit": loop.limit_kind,
        "control_limit": loop.limit if math.isfinite(loop.limit) else None,
        "lag": loop.lag,
        "control_period": loop.period,
    }
