"""Flies random states of a certified set of the circle against the claim: a test of the certifier, and no part of any proof.
Tells whether a start lies in certified sets."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from starhold.analysis.station_departure import circle_value, outside
from starhold.analysis.trial import FLIGHTS, LEGS, SLACK, BrokenClaimError, Trial
from starhold.certification.certificate import Certificate
from starhold.loop.closed_loop import ClosedLoop
from starhold.simulation.lanes import simulate_many

Array = NDArray[np.float64]
PERIOD = 1e-4
"""Control that is renewed so often counts as continuous (scaled)."""
FLOOR = 1e-6
"""Of V at the centre of the circle: what the held control makes of zero."""


def fly_station(loop: ClosedLoop, certificate: Certificate, flights: int = FLIGHTS, seed: int = 1) -> Trial | None:
    """Fly the certified set of the circle; None where that is not proved. Raises BrokenClaimError."""
    claims = [certificate.claim(kind) for kind in ("control-limit", "circle")]
    claim = next((c for c in claims if c is not None and c.outcome == "proved"), None)
    if claim is None:
        return None
    free = replace(loop.without("lag"), period=min(loop.period, PERIOD), substeps=1, limit="none")
    level, random = claim.numbers["level"], np.random.default_rng(seed)
    states = draw(loop.gains, level, flights, random)
    floor = FLOOR * loop.gains.alpha * loop.gains.radius**4
    highest, need, before = 0.0, 0.0, _value(loop.gains, states)
    for steps in LEGS:
        batch = simulate_many(free, states, steps)
        states, after = batch.states, _value(loop.gains, batch.states)
        wrong = (after > before * (1.0 + SLACK) + floor) | (batch.lost_at >= 0.0)
        if wrong.any():
            shown = ", ".join(f"{x:.9g}" for x in states[:6, int(np.argmax(wrong))])
            raise BrokenClaimError(f"{certificate.name}, {claim.kind}: V rises on a flight, which is then at ({shown})")
        highest, before = max(highest, float((after / np.maximum(before, floor)).max())), after
        need = max(need, float(_size(states[6:9], loop.limit).max()))
    if claim.kind == "circle":
        return Trial(flights, level, highest, None)
    if need > loop.cutoff() * (1.0 + 1e-12):
        raise BrokenClaimError(f"{certificate.name}: a flight from the certified set needs {need:g} of {loop.cutoff():g}")
    return Trial(flights, level, highest, need / loop.cutoff())


def draw(gains: Any, level: float, count: int, random: np.random.Generator) -> Array:
    """States (9, count) of {V <= level} in the plane x = 0 without a rate along X, half of them on its surface."""
    v = level * np.where(np.arange(count) % 2 == 0, 1.0 - 1e-9, random.uniform(size=count))
    s, turn, angle = random.uniform(-1.0, 1.0, count), *random.uniform(0.0, 2.0 * np.pi, (2, count))
    r = np.sqrt(np.maximum(gains.radius**2 + s * np.sqrt(2.0 * v / gains.alpha), 0.0))
    error = np.sqrt(2.0 * v * (1.0 - s * s))
    states = np.zeros((9, count))
    states[1], states[2] = r * np.cos(turn), r * np.sin(turn)
    states[4] = error * np.cos(angle) - gains.rate * states[2]
    states[5] = error * np.sin(angle) + gains.rate * states[1]
    return states


def station_start_inside(certificate: Certificate, loop: ClosedLoop) -> dict[str, bool]:
    """Whether the loop's start lies in the sets of the proved claims that are about a part of all states."""
    found: dict[str, bool] = {}
    for claim in certificate.claims:
        if claim.outcome == "proved" and claim.kind in ("circle", "control-limit", "saturated-axis"):
            start = np.array(loop.start.position)[:, None], np.array(loop.start.velocity)[:, None]
            found[claim.kind] = not outside(claim, loop, *start)[0]
    return found


def _value(gains: Any, states: Array) -> Array:
    return circle_value(gains, states[:3], states[3:6])


def _size(control: Array, kind: str) -> Array:
    return np.abs(control).max(axis=0) if kind == "axis" else np.linalg.norm(control, axis=0)
