"""When and how a flight of station keeping leaves what is claimed of its law."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from starhold.analysis.departure import LOST, Departure
from starhold.analysis.metrics import on_limit
from starhold.certification.station_terms import lag_of
from starhold.laws import l2_circle
from starhold.laws.point import PointMeasurement

if TYPE_CHECKING:
    from starhold.certification.certificate import Certificate, Claim
    from starhold.loop.closed_loop import ClosedLoop
    from starhold.simulation.lane import Recording

SLACK = 1e-6
"""The integration moves V, scaled distances and velocities by so much in a motion along a border."""


def station_departures(
    certificate: Certificate, loop: ClosedLoop, run: Recording, unit: float
) -> dict[str, tuple[Departure, ...]]:
    """For each proved kind of claim how a run leaves it, in order of time; empty where it does not. unit: of time, in s."""

    def first(held: Any, how: str) -> list[Departure]:
        places = np.flatnonzero(held)
        return [Departure(float(run["time"][places[0]]) * unit, how)] if len(places) else []

    at = run.attrs.get("diverged_at")
    common = [] if at is None else [Departure(at * unit, LOST)]
    if lag_of(loop) > 0.0:
        common.append(Departure(0.0, "the control lags"))
    found: dict[str, tuple[Departure, ...]] = {}
    for claim in certificate.claims:
        if claim.outcome == "proved":
            own = [one for held, how in _conditions(claim, loop, run) for one in first(held, how)]
            left = outside(claim, loop, run["position"].T, run["velocity"].T, SLACK)
            sets = first(left, "it leaves the set")
            if len(left) and left[0]:
                sets = [Departure(0.0, "it is outside the set")]
            found[claim.kind] = tuple(sorted({*common, *own, *sets}))
    return found


def _conditions(claim: Claim, loop: ClosedLoop, run: Recording) -> list[tuple[Any, str]]:
    """The samples (n,) that a claim assumes not to be, beside lag and its set, each with its sentence."""
    command, limit, kind = run["command"], loop.cutoff(), loop.limit
    if claim.kind in ("circle", "equilibrium"):
        return [(on_limit(command, limit, kind), "the control reaches its limit")]
    if claim.kind == "saturated-axis" and kind != "none":
        return [(on_limit(command[:, 1:], limit, "axis"), "the control along Y or Z reaches its limit")]
    return []


def outside(
    claim: Claim, loop: ClosedLoop, position: NDArray[np.float64], velocity: NDArray[np.float64], slack: float = 0.0
) -> Any:
    """Which states, (3, n) each, lie outside a claim's set by more than a slack, (n,); none of a claim about all states."""
    if claim.kind == "saturated-axis":
        steep = math.sqrt(loop.craft.rate**2 + 2.0 * loop.craft.stiffness)
        far = np.abs(position[0] + velocity[0] / steep) > claim.numbers["width"] * (1.0 + slack)
        far |= np.abs(position[0]) > claim.numbers["reach"] * (1.0 + slack)
        # The claim takes Y and Z as held; where a flight starts otherwise it is none of those that it speaks of.
        away = abs(position[1:, 0] - (loop.gains.y, loop.gains.z)).max() + abs(velocity[1:, 0]).max()
        return far | (away > slack)
    if "level" not in claim.numbers:
        return np.zeros(position.shape[1], dtype=bool)
    beyond = circle_value(loop.gains, position, velocity) > claim.numbers["level"] * (1.0 + slack)
    if claim.kind == "control-limit":
        beyond |= np.maximum(np.abs(position[0]), np.abs(velocity[0])) > slack
    return beyond


def circle_value(gains: Any, position: NDArray[np.float64], velocity: NDArray[np.float64]) -> NDArray[np.float64]:
    """V of the circle at many states, (3, n) each."""
    measurement: Any = PointMeasurement(tuple(position), tuple(velocity), 0.0, math.inf)
    f1, f2, f3 = l2_circle.errors(measurement, gains)
    return np.asarray(0.5 * (gains.alpha * f1 * f1 + f2 * f2 + f3 * f3))
