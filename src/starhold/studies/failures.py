"""Wheel failures: the control authority that a spacecraft retains after the loss of one or two wheels."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from starhold.analysis.rigid_body import measure
from starhold.errors import InputError
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.craft import tensor
from starhold.parts.effectors.envelope import authority
from starhold.parts.effectors.wheels import Wheels, lose
from starhold.scenario.bodies.rigid_body.craft import wheels_of
from starhold.scenario.bodies.rigid_body.tables import FaultTable
from starhold.scenario.building import build
from starhold.scenario.designing import written
from starhold.scenario.reading import LawEntry, Scenario
from starhold.simulation.lane import fly, label
from starhold.studies.bodies.rigid_body import certify_law
from starhold.studies.body import SILENT, Notice
from starhold.studies.pointing import ProvedPointing, prove_pointing
from starhold.studies.requirements import orbit_of
from starhold.synthesis.stability_degree import degree, scale

Array: TypeAlias = NDArray[np.float64]

FULL = 0.99
"""Share of its momentum limit at which a wheel counts as saturated: beyond it the motor cannot accelerate it further."""
HORIZON = 1000
"""The most orbits over which growth of momentum is extrapolated; slower growth counts as none."""
WEAK = 1e-3
"""Singular values of the axes below this share of the largest mark directions without authority."""
SINGULAR = 1e-9
MOST_STEPS = 2_000_000
"""The most control steps of a flight continued beyond the scenario's duration."""


@dataclass(frozen=True)
class Saturation:
    """The first saturation of a wheel: its time (s) and the wheel's number from 1, both None where none saturates; how it is
    known ("flown", "extrapolated", "none"); and the window (s) over which growth was measured (None where flown)."""

    time: float | None
    wheel: int | None
    known: str
    window: float | None


@dataclass(frozen=True)
class Failure:
    """A loss of wheels, and the control authority after it. Values that need three axes are None where fewer are left. lost:
    the lost wheels, counted from 1; empty for the intact set. lacking: body directions without authority, orthonormal (n,
    3). condition: condition number of the working axes. authority: N m. share: authority relative to the intact set. gains:
    those that fly, by field. eta: degree of stability (1/s), intact and after the loss; None for a law not designed for one.
    settling: s, None where the motion does not settle within the scenario's duration. diverged_at: s, None where the motion
    does not diverge. certified: the largest slew from rest (rad) and the largest rate on target (rad/s) for which it is
    proved that no motor and no wheel reaches its limit; None where this is not proved. momentum_share: largest |h| over its
    limit among working wheels during the flight. flown: length of the flight (s). orbit: orbital period (s), None without an
    orbit. refused: why the law cannot fly with the remaining wheels; then there is no flight."""

    lost: tuple[int, ...]
    lacking: tuple[tuple[float, ...], ...]
    condition: float
    authority: float
    share: float
    gains: dict[str, Any] | None = None
    eta_intact: float | None = None
    eta: float | None = None
    settling: float | None = None
    diverged_at: float | None = None
    certified: tuple[float, float] | None = None
    saturation: Saturation | None = None
    momentum_share: float | None = None
    flown: float | None = None
    orbit: float | None = None
    refused: str = ""
    proof: ProvedPointing | None = None
    """The proved pointing bound of the loop, where it was requested."""

    @property
    def name(self) -> str:
        """The name of the case, from the lost wheels."""
        return " and ".join(map(str, self.lost)) or "none"

    @property
    def controllable(self) -> bool:
        """Whether three axes are left."""
        return not self.lacking


def study(
    scenario: Scenario,
    entry: LawEntry,
    notice: Notice = SILENT,
    proof: bool = False,
) -> list[Failure]:
    """Fly the intact set and every single and double loss of wheels, with one law and without the scenario's faults; return
    all cases. The loss occurs at time 0 and is known at once: the torque is reallocated to the remaining wheels, and gains
    designed for a degree of stability are redesigned for the remaining torque. `notice` is called with the number done, the
    total, and the next loss. proof: whether to prove a pointing bound for each loop. InputError where the scenario has no
    wheels."""
    wheels = require_wheels(scenario)
    count = len(wheels.axes)
    losses = [lost for size in range(3) for lost in combinations(range(1, count + 1), size)]
    intact = authority(wheels)
    eta = _degree(scenario, entry, entry.gains)
    failures: list[Failure] = []
    for done, lost in enumerate(losses):
        failure = _left(wheels, lost, intact)
        notice(done, len(losses), failure.name)
        failure = replace(failure, eta_intact=eta, proof=ProvedPointing("it does not fly") if proof else None)
        failures.append(_flown(scenario, entry, failure) if failure.controllable else failure)
    notice(len(losses), len(losses), "")
    return failures


def directions_lacking(axes: Array) -> Array:
    """Return orthonormal body directions (n, 3) about which wheels with these axes (k, 3) have almost no authority."""
    if len(axes) == 0:
        return np.eye(3)
    directions, sizes, _ = np.linalg.svd(axes.T)
    sizes = np.append(sizes, np.zeros(3 - len(sizes)))
    lacking = directions[:, sizes <= WEAK * sizes[0]].T
    leading = np.take_along_axis(lacking, np.abs(lacking.round(9)).argmax(axis=1)[:, None], axis=1)
    return np.sign(leading) * lacking


def pick(scenario: Scenario, law: str | None) -> LawEntry:
    """Return the law of this name, by default the first. InputError where the scenario has no wheels."""
    entry = scenario.pick(law)
    require_wheels(scenario)
    return entry


def require_wheels(scenario: Scenario) -> Wheels:
    """Return the wheels of a scenario; InputError where it has none."""
    wheels = wheels_of(scenario)
    if wheels is None:
        raise InputError(scenario.where, "wheels", "no wheels", "a scenario with [wheels] or [[wheel]] tables")
    return wheels


def _left(wheels: Wheels, lost: tuple[int, ...], intact: float) -> Failure:
    """Return the case of these lost wheels before its flight, with the checks of a diagnosed fault."""
    limits = tuple(0.0 if i in lost else limit for i, limit in enumerate(wheels.torque_limit, 1))
    axes = np.array([axis for i, axis in enumerate(wheels.axes, 1) if i not in lost])
    try:
        left = lose(wheels._replace(torque_limit=limits), lost[0] - 1) if lost else wheels
    except ValueError:
        lacking = tuple(tuple(map(float, direction.round(12) + 0.0)) for direction in directions_lacking(axes))
        return Failure(lost, lacking, _condition(axes), 0.0, 0.0)
    able = authority(left)
    share = able / intact if math.isfinite(intact) else 1.0
    return Failure(lost, (), _condition(axes), able, share)


def _condition(axes: Array) -> float:
    sizes = np.linalg.svd(axes, compute_uv=False) if len(axes) >= 3 else np.zeros(3)
    return float(sizes[0] / sizes[2]) if sizes[2] > SINGULAR * sizes[0] else math.inf


def _designed(entry: LawEntry) -> bool:
    return entry.form == "degree-of-stability" and {"torque", "momentum"} <= set(entry.spec._fields)


def _degree(scenario: Scenario, entry: LawEntry, gains: Any) -> float | None:
    """Return the degree of stability (1/s) of these gains; None for a law that is not designed for one."""
    if not _designed(entry):
        return None
    moments = np.linalg.eigvalsh(tensor(scenario.craft.inertia))
    units = scale(moments, entry.spec.torque, entry.spec.momentum)
    return float(degree(*units.scaled(gains.k_attitude[0], gains.k_rate), units.ratios)) / units.t0


def _flown(scenario: Scenario, entry: LawEntry, failure: Failure) -> Failure:
    table = scenario.table
    retune = _designed(entry) and 0.0 < failure.authority < math.inf
    faults = [
        FaultTable(time=0.0, wheel=wheel, lost=True, action="both" if retune else "reallocate") for wheel in failure.lost
    ]
    # The law's reaction to faults of the file does not matter here.
    plain_entry = replace(entry, options=entry.options._replace(fault_action=None))
    try:
        loop = build(replace(scenario, table=table.model_copy(update={"fault": faults})), plain_entry)
    except InputError as error:
        if not faults:
            raise
        return replace(failure, refused=error.allowed)
    # The loss occurs at time 0, and the law knows of it.
    flown = loop.after(loop.events[-1]) if loop.events else loop
    period = orbit_of(scenario)
    every, steps = table.simulation.record_every, _steps(scenario, loop, period)
    samples, carry = fly(loop, steps, every)
    recording = label(loop, samples, carry, every)
    # A motion that diverges after the scenario's duration counts as diverged too.
    whole, settling = recording.until(table.simulation.duration), table.settling
    metrics = measure(whole, settling.attitude_tolerance, settling.rate_tolerance)
    working = [i for i in range(len(require_wheels(scenario).axes)) if i + 1 not in failure.lost]
    filled = recording["wheel_momentum"][:, working] / np.array(require_wheels(scenario).momentum_limit)[working]
    lost_at = metrics["diverged_at"]
    known = None if lost_at is not None else saturation(recording["time"], filled, period)
    if known is not None and known.wheel is not None:
        known = replace(known, wheel=working[known.wheel - 1] + 1)
    return replace(
        failure,
        gains=written(entry.law.fields(), flown.gains),
        eta=_degree(scenario, entry, flown.gains),
        settling=metrics["settling_time"],
        diverged_at=lost_at,
        certified=_certified(scenario, entry, loop),
        saturation=known,
        momentum_share=float(np.abs(filled).max()),
        flown=float(recording["time"][-1]),
        orbit=period,
        proof=failure.proof and prove_pointing(scenario, flown),
    )


def _certified(scenario: Scenario, entry: LawEntry, loop: ClosedLoop) -> tuple[float, float] | None:
    if loop.nominal is not None:
        # No claim covers a law whose nominal model differs from the craft.
        return None
    claim = certify_law(scenario, entry, loop)[0].certificate.claim("wheels")
    if claim is None or claim.outcome != "proved":
        return None
    # Wheels without limits are not claimed, so that the set is bounded.
    return claim.numbers["slew_angle"], claim.numbers["rate"]


def _steps(scenario: Scenario, loop: ClosedLoop, period: float | None) -> int:
    """Return the number of control steps to fly: one orbit more than the scenario if possible, because the wheels' momentum
    oscillates with the orbit, which looks like growth over less than one orbit."""
    steps = scenario.table.simulation.steps
    if period is None or loop.target.part.name == "history" or loop.remembers:
        return steps
    every = scenario.table.simulation.record_every
    more = math.ceil(period / loop.period / every + 1.0) * every
    return steps + more if steps + more <= MOST_STEPS else steps


def saturation(times: Array, filled: Array, period: float | None) -> Saturation:
    """Return the first saturation, from times (n,; s), momenta relative to their limits (n, wheels) and the orbital period
    (s). The growth over the last orbit (or the last half of the flight, if shorter or without an orbit) is extrapolated from
    the largest momentum of the same sign in this window; the time is accurate to within an orbit."""
    beyond = np.argwhere(np.abs(filled) > FULL)
    if len(beyond):
        row, wheel = beyond[0].tolist()
        return Saturation(float(times[row]), wheel + 1, "flown", None)
    end, half = float(times[-1]), 0.5 * float(times[-1])
    window = half if period is None or period > end else period
    last = times >= end - window
    best = Saturation(None, None, "none", window)
    if window <= 0.0:
        return best
    reach = end + HORIZON * (window if period is None else period)
    for wheel, share in enumerate(filled.T):
        growth = (share[-1] - np.interp(end - window, times, share)) / window
        if growth == 0.0:
            continue
        outward = np.sign(growth) * share[last]
        top = int(outward.argmax())
        full = float(times[last][top] + (FULL - outward[top]) / abs(growth))
        if full < (reach if best.time is None else best.time):
            best = Saturation(full, wheel + 1, "extrapolated", window)
    return best
