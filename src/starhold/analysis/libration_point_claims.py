"""Claims about laws near a libration point against flights: when and how a flight leaves them, whether a start lies in their
sets, and flights of random states of a certified set, which test the certifier and are no part of any proof."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from starhold.analysis.departure import HAS, LOST, Departure
from starhold.analysis.metrics import on_limit
from starhold.analysis.trial import FLIGHTS, LEGS, BrokenClaimError, Trial
from starhold.analysis.trial import SLACK as RISE
from starhold.certification.openness import WITHOUT
from starhold.kernel.sentences import ASSUMPTIONS
from starhold.laws import l2_circle
from starhold.laws.point import PointMeasurement
from starhold.parts.bodies.libration_point import ROWS
from starhold.simulation.lanes import simulate_many

if TYPE_CHECKING:
    from starhold.certification.certificate import Certificate, Claim
    from starhold.loop.closed_loop import ClosedLoop
    from starhold.simulation.lane import Recording

SLACK = 1e-6
"""The integration moves V, scaled distances and velocities by so much in a motion along a border."""
PERIOD = 1e-4
"""Control that is renewed so often counts as continuous (scaled)."""
UNLIMITED, HELD = ASSUMPTIONS["unlimited-control"], ASSUMPTIONS["held-aside"]
_NAMES = (
    "linear-field",
    "whole-field",
    "circling-bodies",
    "exact-place",
    "continuous-control",
    "off-the-bodies",
    "in-the-plane",
)
MET = tuple(ASSUMPTIONS[name] for name in _NAMES)
"""Assumptions that a flight meets, but for where `outside` or the simulation ends it."""
FLOOR = 1e-6
"""Share of V at the centre of the circle: what the held control makes of zero."""


def departures(certificate: Certificate, loop: ClosedLoop, run: Recording, unit: float) -> dict[str, tuple[Departure, ...]]:
    """For each proved kind of claim how a run leaves it, in order of time; empty where it does not. unit: of time, in s."""

    def first(held: Any, how: str) -> list[Departure]:
        places = np.flatnonzero(held)
        return [Departure(float(run["time"][places[0]]) * unit, how)] if len(places) else []

    at = run.attrs.get("diverged_at")
    common = [] if at is None else [Departure(at * unit, LOST)]
    found: dict[str, tuple[Departure, ...]] = {}
    for claim in certificate.claims:
        if claim.outcome == "proved":
            own = [one for held, how in _unmet(claim, loop, run["command"]) for one in first(held, how)]
            left = outside(claim, loop, run["position"].T, run["velocity"].T, SLACK)
            sets = first(left, "it leaves the set")
            if len(left) and left[0]:
                sets = [Departure(0.0, "it is outside the set")]
            found[claim.kind] = tuple(sorted({*common, *own, *sets}))
    return found


def _unmet(claim: Claim, loop: ClosedLoop, command: NDArray[np.float64]) -> list[tuple[Any, str]]:
    """The samples (n,) at which an assumption of a claim is not met, beside its set, each with its sentence."""
    found: list[tuple[Any, str]] = []
    for assumed in claim.assumptions:
        if assumed.startswith(WITHOUT):
            found.append((np.ones(len(command), dtype=bool), f"{HAS}{assumed.removeprefix(WITHOUT)}"))
        elif assumed == UNLIMITED:
            found.append((on_limit(command, loop.saturation_limit(), loop.limit), "the control reaches its limit"))
        elif assumed == HELD:
            found.append(
                (on_limit(command[:, 1:], loop.saturation_limit(), loop.limit), "the control along Y or Z reaches its limit")
            )
        elif assumed not in MET:
            raise KeyError(assumed)
    return found


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


def fly_claims(loop: ClosedLoop, certificate: Certificate, flights: int = FLIGHTS, seed: int = 1) -> Trial | None:
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
        wrong = (after > before * (1.0 + RISE) + floor) | (batch.lost_at >= 0.0)
        if wrong.any():
            shown = ", ".join(f"{x:.9g}" for x in states[: ROWS.velocity.stop, int(np.argmax(wrong))])
            raise BrokenClaimError(f"{certificate.name}, {claim.kind}: V rises on a flight, which is then at ({shown})")
        highest, before = max(highest, float((after / np.maximum(before, floor)).max())), after
        need = max(need, float(_size(states[ROWS.control], loop.limit).max()))
    if claim.kind == "circle":
        return Trial(flights, level, highest, None)
    if need > loop.saturation_limit() * (1.0 + 1e-12):
        raise BrokenClaimError(
            f"{certificate.name}: a flight from the certified set needs {need:g} of {loop.saturation_limit():g}"
        )
    return Trial(flights, level, highest, need / loop.saturation_limit())


def draw(gains: Any, level: float, count: int, random: np.random.Generator) -> NDArray[np.float64]:
    """States (9, count) of {V <= level} in the plane x = 0 without a rate along X, half of them on its surface."""
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
    """Whether the loop's start lies in the sets of the proved claims that are about a part of all states."""
    found: dict[str, bool] = {}
    for claim in certificate.claims:
        if claim.outcome == "proved" and claim.kind in ("circle", "control-limit", "saturated-axis"):
            start = np.array(loop.start.position)[:, None], np.array(loop.start.velocity)[:, None]
            found[claim.kind] = not outside(claim, loop, *start)[0]
    return found


def _value(gains: Any, states: NDArray[np.float64]) -> NDArray[np.float64]:
    return circle_value(gains, states[ROWS.position], states[ROWS.velocity])


def _size(control: NDArray[np.float64], kind: str) -> NDArray[np.float64]:
    return np.abs(control).max(axis=0) if kind == "axis" else np.linalg.norm(control, axis=0)
