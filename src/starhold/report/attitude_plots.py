"""The plots over time of a rotating body."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from starhold.analysis.meter import stays_within
from starhold.analysis.rigid_body import DECADES, acceleration, error_angle
from starhold.analysis.validity_notes import column_of
from starhold.parts.bodies import rigid_body
from starhold.parts.effectors import wheels
from starhold.report.plots import (
    OFF_SCALE,
    Curve,
    Mark,
    Panel,
    Plot,
    longest,
    near,
    positive,
    recorded_plots,
    sound,
    thin,
    thin_times,
    thinning,
)
from starhold.scenario.bodies.rigid_body.craft import effectors_of, sure_torque, wheels_of
from starhold.scenario.bodies.rigid_body.faults import fault_times

if TYPE_CHECKING:
    from starhold.scenario.reading import Scenario
    from starhold.studies.flight import Flight

ACCURACIES = (("", "attitude, |q| ≤ 10⁻ᵏ"), ("rate_", "rate, |ω| ≤ 10⁻ᵏ rad/s"))
"""Errors for which the steps to an accuracy are counted: the prefix of the metric, and the heading."""
MOST_MARKS = 20
"""The largest number of mode switches marked per flight."""
NEAR = 0.02
"""A motion counts as near the target if its error is below this share of the largest value."""
KNOWN = (*rigid_body.Sample._fields, *wheels.Sample._fields, "error_angle")
"""Recorded quantities that have their own plots."""


@dataclass(frozen=True)
class AttitudePlots:
    """All plots over time, with the times (s) that all curves share; a run that diverged has shorter curves."""

    times: Curve
    scalar: Plot
    attitude: Plot
    rate: Plot
    torque: Plot
    angle: Plot
    roll_pitch_yaw: Plot
    further: tuple[Plot, ...] = ()
    """Rate and acceleration against their limits, momenta and torques of reaction wheels, where there are any, and what
    other parts record."""
    marks: tuple[Mark, ...] = ()
    """The times (s) of faults, of reactions to them, and of the beginnings of modes."""
    shaded: tuple[tuple[float, float], ...] = ()
    """The intervals (s) in which the estimate of a law is not valid."""


def collect(flights: Sequence[Flight], points: int, scenario: Scenario, end: float = math.inf) -> AttitudePlots:
    """Return the plots of a comparison, each curve thinned to about `points` samples, with marks up to `end` (s)."""
    times = longest(flights)["time"]
    factor = thinning(len(times), points)

    def curves(name: str, column: int, scale: float = 1.0) -> list[Curve]:
        return [thin(flight.recording[name][:, column] * scale, factor) for flight in flights]

    rate_scale, rate_unit = _rate_unit(flights)
    levels, dashed = _limit(flights, scenario)

    def panel(label: str, name: str, column: int, scale: float = 1.0, levels: tuple[float, ...] = ()) -> Panel:
        return Panel(label, curves(name, column, scale), False, levels, source=("column", name, column, scale))

    rates = [panel(f"{axis}, {rate_unit}", "rate_error", i, rate_scale) for i, axis in enumerate("xyz")]
    torques = [panel(f"{axis}, N m", "torque", i, levels=levels) for i, axis in enumerate("xyz")]
    scalar = panel("q₀", "attitude_error", 0)
    vector = [panel(f"q{'₁₂₃'[i]}", "attitude_error", i + 1) for i in range(3)]
    return AttitudePlots(
        thin_times(times, factor),
        Plot("scalar", "scalar part of the error quaternion", [scalar]),
        Plot("attitude", "vector part of the error quaternion", vector),
        Plot("rate", "angular velocity relative to the target", [sound(one, flights) for one in rates]),
        Plot("torque", "torque applied", torques, dashed, True, topic="Actuators"),
        _angle(flights, factor, scenario),
        _roll_pitch_yaw(flights, factor),
        (
            *_transient(flights, factor, scenario),
            *_wheels(flights, factor, scenario),
            *recorded_plots(flights, factor, KNOWN, readers_of(scenario)),
        ),
        tuple(mark for mark in (*map(Mark, fault_times(scenario)), *begun(flights)) if mark.time <= end),
        unsure(flights),
    )


def begun(flights: Sequence[Flight]) -> list[Mark]:
    """Return the times at which modes begin; for laws that switch back and forth, only the first few."""
    of = {flight.name: flight.modes for flight in flights if flight.modes}
    return [
        Mark(one.time, one.mode if len(of) == 1 else f"{name}: {one.mode}")
        for name, modes in of.items()
        for one in modes[:MOST_MARKS]
    ]


def unsure(flights: Sequence[Flight]) -> tuple[tuple[float, float], ...]:
    """Return the intervals (s) in which the estimate of a law is not valid; if there are many, only the first few."""
    spans = dict[tuple[float, float], None]()
    for run in (flight.recording for flight in flights):
        name = column_of(run.arrays, run.attrs)
        bad = run[name] < 0.5 if name else np.zeros(len(run["time"]), bool)
        turns = np.flatnonzero(np.diff(np.r_[False, bad, False]))[: 2 * MOST_MARKS]
        ends = np.r_[run["time"], run["time"][-1]]
        spans |= dict.fromkeys((float(ends[a]), float(ends[b])) for a, b in turns.reshape(-1, 2))
    return tuple(spans)


def readers_of(scenario: Scenario) -> tuple[str, ...]:
    """Return the prefixes of the names of quantities that sensors and estimators output."""
    return tuple(fitted.prefix for fitted in scenario.parts if fitted.part.role in ("sensor", "estimator"))


def steps_within(flight: Flight, kind: str) -> list[int | None]:
    """Return the numbers of control steps after which the error stays within 10^-k, for every k of `DECADES`.

    kind: "" for the attitude, "rate_" for the rate."""
    return [flight.metrics.get(f"{kind}iterations_1e-{k}") for k in DECADES]


def _angle(flights: Sequence[Flight], factor: int, scenario: Scenario) -> Plot:
    degrees = 180.0 / np.pi
    angles = [thin(error_angle(flight.recording["attitude_error"]) * degrees, factor) for flight in flights]
    speeds = [thin(np.linalg.norm(flight.recording["rate_error"], axis=1) * degrees, factor) for flight in flights]
    funnels = [(number, time, most * degrees) for number, flight in enumerate(flights) for time, most in funnel(flight)]
    settling = scenario.table.settling
    within, slow = (settling.attitude_tolerance * degrees,), (settling.rate_tolerance * degrees,)
    panels = [
        replace(positive("angle, deg", angles, within), source=("angle", degrees), bounds=tuple(funnels)),
        replace(sound(positive("rate, deg/s", speeds, slow), flights), source=("norm", "rate_error", degrees)),
    ]
    return Plot("angle", "error angle and relative rate", panels, "tolerance, proved bound" if funnels else "tolerance")


def funnel(flight: Flight) -> Iterator[tuple[Curve, Curve]]:
    """Yield for each certificate times (s) and the proved bounds (rad) on the angle from then on, while the claim covers
    the flight."""
    for certificate, every in zip(flight.certificates, flight.covered, strict=True):
        claim = certificate.claim("pointing")
        if claim is None:
            continue
        for begin, end in every:
            times, most = np.array(claim.numbers["funnel"]).T
            there = begin + times < end
            yield np.append(begin + times[there], end), np.append(most[there], most[there][-1])


def _roll_pitch_yaw(flights: Sequence[Flight], factor: int) -> Plot:
    errors = [roll_pitch_yaw(flight.recording["attitude_error"]) for flight in flights]
    panels = [
        Panel(f"{name}, deg", [_unwrapped(thin(angles[:, i], factor)) for angles in errors], source=("turn", i))
        for i, name in enumerate(("roll", "pitch", "yaw"))
    ]
    return Plot("roll-pitch-yaw", "roll, pitch and yaw error", panels)


def roll_pitch_yaw(q: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return roll, pitch and yaw (deg) of each quaternion (n, 4), an array (n, 3): Tait-Bryan (3-2-1) angles in reverse
    order. `algebra.cosines.to_angles` does the same for one quaternion."""
    q0, q1, q2, q3 = q.T
    roll = np.arctan2(2.0 * (q2 * q3 + q0 * q1), 1.0 - 2.0 * (q1 * q1 + q2 * q2))
    pitch = np.arcsin(np.clip(2.0 * (q0 * q2 - q1 * q3), -1.0, 1.0))
    yaw = np.arctan2(2.0 * (q1 * q2 + q0 * q3), 1.0 - 2.0 * (q2 * q2 + q3 * q3))
    return np.degrees(np.column_stack([roll, pitch, yaw]))


def _unwrapped(angles: Curve) -> Curve:
    """Return angles (deg) with gaps where they jump from one end of their range to the other."""
    broken = angles.copy()
    broken[1:][np.abs(np.diff(angles)) > 180.0] = np.nan
    return broken


def early(flights: Sequence[Flight]) -> float | None:
    """Return the time (s), with a small margin, by which all motions that come near the target have done so; None if it is
    most of the run, or no motion does."""
    ends = list[float]()
    for flight in flights:
        run = flight.recording
        errors = error_angle(run["attitude_error"]), np.linalg.norm(run["rate_error"], axis=1)
        within = [stays_within(values, NEAR * float(values.max(initial=0.0))) for values in errors]
        if flight.lost is None and None not in within:
            ends.append(float(run["time"][max(place for place in within if place is not None)]))
    end = 1.2 * max(ends, default=math.inf)
    return end if 0.0 < end <= 0.5 * float(longest(flights)["time"][-1]) else None


def until(flights: Sequence[Flight], end: float) -> list[Flight]:
    """Return the flights with their recordings cut at a time (s)."""
    return [replace(flight, recording=flight.recording.until(end)) for flight in flights]


def _transient(flights: Sequence[Flight], factor: int, scenario: Scenario) -> tuple[Plot, ...]:
    table = scenario.table.transient
    if table is None:
        return ()
    degrees = 180.0 / np.pi
    rates = [thin(np.linalg.norm(flight.recording["rate"], axis=1) * degrees, factor) for flight in flights]
    turned = [acceleration(flight.recording) * degrees for flight in flights]
    fastest = table.rate_limit * degrees
    panels = [Panel("norm, deg/s", rates, False, near((fastest,), rates), source=("norm", "rate", degrees))]
    for i, axis in enumerate("xyz"):
        curves = [thin(angles[:, i], factor) for angles in turned]
        limit = table.acceleration_limit * degrees
        levels = near((-limit, limit), curves)
        panels.append(Panel(f"{axis}, deg/s²", curves, False, levels, source=("acceleration", i, degrees)))
    return (
        Plot(
            "transient",
            "norm of the body's rate, and the rate's derivative",
            [sound(panel, flights) for panel in panels],
            "limit",
        ),
    )


def _wheels(flights: Sequence[Flight], factor: int, scenario: Scenario) -> tuple[Plot, ...]:
    if not all("wheel_momentum" in flight.recording.arrays for flight in flights):
        return ()
    wheels = wheels_of(scenario)
    plots: list[Plot] = []
    for name, title, unit, limits in (
        ("wheel_momentum", "angular momentum of the wheels", "N m s", None if wheels is None else wheels.momentum_limit),
        ("wheel_torque", "torque on the wheels", "N m", None if wheels is None else wheels.torque_limit),
    ):
        panels: list[Panel] = []
        for wheel in range(flights[0].recording[name].shape[1]):
            curves = [thin(flight.recording[name][:, wheel], factor) for flight in flights]
            levels = () if limits is None else near((-limits[wheel], limits[wheel]), curves)
            panels.append(Panel(f"wheel {wheel + 1}, {unit}", curves, False, levels, source=("column", name, wheel, 1.0)))
        dashed = "" if limits is None else "limit"
        if limits is not None and not any(panel.levels for panel in panels):
            least = min(limits)
            dashed = f"limit of {'each' if max(limits) == least else 'the weakest'}, {least:g} {unit}, off the scale"
        plots.append(Plot(name.replace("_", "-"), title, panels, dashed, topic="Actuators"))
    return tuple(plots)


def closest_limit(flight: Flight, scenario: Scenario) -> tuple[float, str]:
    """Return, for the limit of torque or wheels to which a flight comes closest, the largest value as a share of the limit,
    and the name of the limit; (0, "") if there is none."""
    run, wheels = flight.recording, wheels_of(scenario)
    torque, attrs = run["torque"], run.attrs
    limited = [("torque", np.linalg.norm(torque, axis=1) if attrs["limit"] == "norm" else torque, attrs["torque_limit"])]
    if wheels is not None and "wheel_momentum" in run.arrays:
        limited.append(("wheels' momentum", run["wheel_momentum"], np.array(wheels.momentum_limit)))
        limited.append(("motors' torque", run["wheel_torque"], np.array(wheels.torque_limit)))
    shares = [(float(np.abs(values / limit).max(initial=0.0)), name) for name, values, limit in limited]
    return max(shares) if max(shares)[0] > 0.0 else (0.0, "")


def _peak(flights: Sequence[Flight], name: str) -> float:
    sound = [flight for flight in flights if flight.lost is None] or flights
    return max(float(np.abs(flight.recording[name]).max(initial=0.0)) for flight in sound)


def _rate_unit(flights: Sequence[Flight]) -> tuple[float, str]:
    degrees = 180.0 / np.pi
    return (degrees, "deg/s") if _peak(flights, "rate_error") * degrees >= 0.1 else (degrees * 1e3, "mdeg/s")


def _limit(flights: Sequence[Flight], scenario: Scenario) -> tuple[tuple[float, ...], str]:
    """Return the torque limits (N m) that bind first, and their name."""
    attrs: dict[Any, Any] = flights[0].recording.attrs
    limit, kind = float(attrs["torque_limit"]), attrs["limit"]
    limit = math.inf if kind == "none" else limit
    words = f"limit of {'each axis' if kind == 'axis' else 'the norm'}"
    sure = sure_torque(scenario.table, effectors_of(scenario))
    if sure < limit:
        norm = scenario.table.spacecraft.limit == "norm"
        limit, words = sure, f"torque that the wheels always give {'in norm' if norm else 'about all axes at once'}"
        if any(fault.strikes_wheel for fault in scenario.table.fault):
            words += " before a fault"
    if not np.isfinite(limit):
        return (), "no limit"
    words = f"{words}, {limit:g} N m"
    # A limit far above all torques would flatten them.
    if limit > OFF_SCALE * _peak(flights, "torque"):
        return (), f"{words}, off the scale"
    return (-limit, limit), words
