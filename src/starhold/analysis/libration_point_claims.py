"""Compares claims about laws near a libration point with flights: departures of a flight, whether a start lies in the
claimed sets, and flights from random states of a certified set, which test the certifier and are not part of a proof."""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from starhold.analysis.departure import LOST, Departure, Span, measured_at
from starhold.analysis.trial import FLIGHTS, BrokenClaimError, Trial, falling
from starhold.certification.assumptions import IN_THE_PLANE
from starhold.certification.certificate import Certificate, Claim
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.bodies.libration_point import ROWS
from starhold.simulation.lane import Recording
from starhold.trace.straight_line import evaluated

SLACK = 1e-6
"""Allowance for the integration error of V, scaled distances and velocities along a border."""
PERIOD = 1e-4
"""The control period (scaled) that counts as continuous control."""
FLOOR = 1e-6
"""The disturbance of V = 0 by held control, as a share of V at the centre of the circle."""


def departures(certificate: Certificate, loop: ClosedLoop, run: Recording, unit: float) -> dict[str, tuple[Departure, ...]]:
    """Return for each kind of proved claim its departures in a run, in order of time; empty if there are none. unit: of
    time, in s."""
    span, at = Span(loop, run, unit=unit), run.attrs.get("diverged_at")
    common = [] if at is None else [Departure(at * unit, LOST)]
    by_kind: dict[str, tuple[Departure, ...]] = {}
    for claim in _proved(certificate):
        left = outside(certificate, claim, loop, run["position"].T, run["velocity"].T, SLACK)
        how = "it is outside the set" if len(left) and left[0] else "it leaves the set"
        by_kind[claim.kind] = tuple(sorted({*common, *span.unmet(claim), *span.first(left, how)}))
    return by_kind


def outside(
    certificate: Certificate,
    claim: Claim,
    loop: ClosedLoop,
    position: NDArray[np.float64],
    velocity: NDArray[np.float64],
    slack: float = 0.0,
) -> Any:
    """Return a mask (n,) of the states, (3, n) each, that lie outside a claim's set by more than a slack; none for a claim
    about all states."""
    numbers, beyond = claim.numbers, np.zeros(position.shape[1], dtype=bool)
    if "level" in numbers:
        value = value_of(claim.programs, loop, position, velocity)
        beyond |= value > numbers["level"] * (1.0 + slack)
    if IN_THE_PLANE in claim.assumptions:
        beyond |= np.maximum(np.abs(position[0]), np.abs(velocity[0])) > slack
    if "width" in numbers:
        steep = math.sqrt(loop.craft.rate**2 + 2.0 * loop.craft.stiffness)
        beyond |= np.abs(position[0] + velocity[0] / steep) > numbers["width"] * (1.0 + slack)
        beyond |= np.abs(position[0]) > numbers["reach"] * (1.0 + slack)
        # The claim assumes that Y and Z are at their equilibrium; it does not cover a flight that starts otherwise.
        beyond |= abs(position[1:, 0] - (loop.gains.y, loop.gains.z)).max() + abs(velocity[1:, 0]).max() > slack
    return beyond


def value_of(
    programs: Mapping[str, Any], loop: ClosedLoop, position: NDArray[np.float64], velocity: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return V at many states, (3, n) each."""
    bare = replace(loop, parts=())
    measurement = measured_at(bare, bare.start._replace(position=tuple(position), velocity=tuple(velocity)))
    return np.asarray(evaluated(programs["lyapunov"], measurement=measurement, gains=loop.gains, craft=loop.known)[0])


def fly_claims(loop: ClosedLoop, certificate: Certificate, flights: int = FLIGHTS, seed: int = 1) -> Trial | None:
    """Fly from states of the circle's certified set, and return the trial; None if the claim is not proved. Raise
    BrokenClaimError if a flight contradicts it."""
    # A claim within limits comes after the other, and has a smaller set.
    claim = next((c for c in reversed(_proved(certificate)) if "level" in c.numbers), None)
    if claim is None:
        return None
    programs = claim.programs

    def value(states: NDArray[np.float64]) -> NDArray[np.float64]:
        return value_of(programs, loop, states[ROWS.position], states[ROWS.velocity])

    free = replace(loop.without("lag"), period=min(loop.period, PERIOD), substeps=1, limit="none")
    level, random = claim.numbers["level"], np.random.default_rng(seed)
    states = draw(loop.gains, level, flights, random)
    floor = FLOOR * loop.gains.alpha * loop.gains.radius**4
    highest, need = 0.0, 0.0
    for batch, share in falling(free, certificate, claim, states, value, floor):
        highest, need = max(highest, share), max(need, float(_size(batch.states[ROWS.control], loop.limit).max()))
    if "limit" not in claim.numbers:
        return Trial(flights, level, highest, None)
    if need > loop.saturation_limit() * (1.0 + 1e-12):
        raise BrokenClaimError(
            f"{certificate.name}: a flight from the certified set needs {need:g} of {loop.saturation_limit():g}"
        )
    return Trial(flights, level, highest, need / loop.saturation_limit())


def draw(gains: Any, level: float, count: int, random: np.random.Generator) -> NDArray[np.float64]:
    """Return states (9, count) of {V <= level} in the plane x = 0 without a rate along X, half of them on its surface."""
    v = level * np.where(np.arange(count) % 2 == 0, 1.0 - 1e-9, random.uniform(size=count))
    s, turn, angle = random.uniform(-1.0, 1.0, count), *random.uniform(0.0, 2.0 * np.pi, (2, count))
    r = np.sqrt(np.maximum(gains.radius**2 + s * np.sqrt(2.0 * v / gains.alpha), 0.0))
    error = np.sqrt(2.0 * v * (1.0 - s * s))
    states = np.zeros((ROWS.control.stop, count))
    position, velocity = states[ROWS.position], states[ROWS.velocity]
    position[1], position[2] = r * np.cos(turn), r * np.sin(turn)
    velocity[1] = error * np.cos(angle) - gains.rate * position[2]
    velocity[2] = error * np.sin(angle) + gains.rate * position[1]
    return states


def start_inside(certificate: Certificate, loop: ClosedLoop) -> dict[str, bool]:
    """Return whether the loop starts in the sets of the proved claims that are not about all states."""
    start = np.array(loop.start.position)[:, None], np.array(loop.start.velocity)[:, None]
    return {
        claim.kind: not outside(certificate, claim, loop, *start)[0]
        for claim in _proved(certificate)
        if not claim.numbers.keys().isdisjoint(("level", "width"))
    }


def _proved(certificate: Certificate) -> list[Claim]:
    return [claim for claim in certificate.claims if claim.outcome == "proved"]


def _size(control: NDArray[np.float64], kind: str) -> NDArray[np.float64]:
    return np.abs(control).max(axis=0) if kind == "axis" else np.linalg.norm(control, axis=0)
