"""Finds the claim about a law that opposes the change of the magnetic field: rates of the body, and above which turning of
the field in it the kinetic energy decreases."""

from __future__ import annotations

from fractions import Fraction
from math import inf, isfinite, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.operations import UnreadableError
from starhold.certification.directions import shown
from starhold.certification.evidence.finding import NotFoundError, complete, read
from starhold.certification.evidence.recorded import RecordedLoop
from starhold.certification.evidence.squares import rounded
from starhold.certification.field import field_along
from starhold.certification.matrices import above
from starhold.certification.subject import Subject
from starhold.certification.unmodelled import environment_torques
from starhold.errors import InputError
from starhold.kernel.loops import WHEELS, AttitudeLoop
from starhold.kernel.numbers import RefusedError
from starhold.kernel.polynomials import Poly
from starhold.kernel.theorems.detumbling import highest, power_at, value
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.craft import tensor
from starhold.parts.effectors.magnetorquers import LIMITED
from starhold.parts.effectors.wheel_motion import has_friction

DETUMBLES = "detumbles"
IDLE = "inactive-wheels"
"""The wheels of a mode in which they are inactive."""
MORE = 1.0 + 1e-6
LESS, PART, LEVELS, SLOWEST = 1.3, 3.0, 3, 100.0
"""The ratio of a rate to the next that is tried until the energy is shown to decrease, and from then on; the most rates of a
claim; the ratio of the first to the last that is tried."""
STATES = 20_000
"""How many rates are drawn for the largest gyroscopic acceleration."""
NEARLY = 1e-3
"""The least share of a rate by which the turning rate of the field, above which the energy decreases, is smaller."""


def find_detumbling(subject: Subject) -> RecordedLoop:
    """Find the claim for about the largest rate that the energy at the start allows, and for parts of it, while the energy
    is shown to decrease for a field that turns slower than the body."""
    loop = RecordedLoop(subject)
    try:
        words, numbers = bounds_of(subject)
        wired = AttitudeLoop(read(loop.claim(DETUMBLES, words, None, **numbers), loop.by_digest), quotients=True)
        rates = levels(wired, fastest(subject.loop))
        if not rates:
            raise NotFoundError("the body turns too far in a control period for its dipole to oppose its rate")
        claim = loop.claim(DETUMBLES, words, None, **numbers, **rates)
        loop.claims.append(complete(claim, loop.by_digest, {}))
    except (NotFoundError, RefusedError, ValueError, InputError, UnreadableError) as reason:
        loop.failed[DETUMBLES] = str(reason)
    return loop


def bounds_of(subject: Subject, rate: float = 0.0) -> tuple[list[str], dict[str, Any]]:
    """Return the words of the claim, and the numbers that are not about rates, for rates (rad/s) up to this one and up to
    those of the start. NotFoundError for a loop that the theorem is not about."""
    loop = subject.loop
    rods = [f for f in loop.used("effector") if f.part.name == "magnetorquers" and f.part.file is None]
    idle = [f for f in loop.used("effector") if f.part.name == IDLE]
    if len(rods) != 1 or len(rods) + len(idle) < len(loop.used("effector")):
        raise NotFoundError("other effectors than magnetorquers act")
    if not any("magnetic_field" in shown(fitted) for fitted in loop.used("sensor")):
        raise NotFoundError("no sensor measures the magnetic field")
    params = rods[0].params
    if params.limited != LIMITED.choices.index("together") or any(params.mounting_error):
        raise NotFoundError("the dipoles of the magnetorquers are not reduced together, or not as commanded")
    if any(has_friction(f.params) or f.params.unbalanced for f in idle):
        raise NotFoundError("wheels are braked by friction, or out of balance")
    turning, across = environment_torques(loop, subject.envelope(False))
    outside = turning.torque + above(subject.modelled_norm) + max(fastest(loop), rate) * turning.per_rate
    if not isfinite(outside + across):
        raise NotFoundError("a torque from outside has no bound")
    least, change = field_along(loop, params.epoch)
    J = tensor(loop.craft.inertia)
    moments = np.linalg.eigvalsh(J)
    numbers: dict[str, Any] = {
        "inertia.low": float(moments[0]) / MORE,
        "inertia.high": float(moments[-1]) * MORE,
        "gyroscopic": gyroscopic(J),
        "dipole.limit": min(params.dipole_limit),
        "field.least": least,
        "field.change": change,
        "outside": outside * MORE,
        "outside.across": across * MORE,
    }
    if loop.limit != "none" and isfinite(loop.saturation_limit()):
        numbers["limit"] = loop.saturation_limit()
    if not idle:
        return [], numbers
    return [WHEELS], numbers | {"stored": stored(idle[0].start.momentum, idle[0].params.axes)}


def fastest(loop: ClosedLoop) -> float:
    """Return the largest rate (rad/s) that a body has with the energy of a loop's start."""
    J, w = tensor(loop.craft.inertia), np.array(loop.start.rate)
    return float(np.sqrt(w @ J @ w / np.linalg.eigvalsh(J)[0])) * MORE


def gyroscopic(J: NDArray[np.float64]) -> float:
    """Return about the largest |J^-1 (w x Jw)| / |w|^2, and a little more."""
    w = np.random.default_rng(1).normal(size=(STATES, 3))
    turned = np.linalg.norm(np.linalg.solve(J, np.cross(w, w @ J).T), axis=0)
    return float((turned / (w * w).sum(axis=1)).max()) * 1.01 + 1e-6


def stored(momenta: Any, axes: Any) -> float:
    """Return the norm of the momentum of wheels together (N m s), rounded up."""
    return float(np.linalg.norm(np.array(momenta) @ np.array(axes))) * MORE


def levels(wired: AttitudeLoop, fastest: float) -> dict[str, Any]:
    """Return the numbers of rates, the largest first, at which the energy decreases while the field turns slower than
    that."""
    numbers, rate, count = dict[str, Any](), fastest, 0
    while rate > fastest / SLOWEST and count < LEVELS:
        level = level_at(wired, Fraction(rate))
        numbers |= {f"{name}.{count}": x for name, x in level.items()}
        count += bool(level)
        rate /= PART if count else LESS
    return numbers


def level_at(wired: AttitudeLoop, rate: Fraction) -> dict[str, Fraction]:
    """Return the numbers of a rate; empty where the energy is not shown to decrease."""
    bounds, gain = wired.claim.numbers, wired.claim.subject["gains.k"]
    if "limit" in bounds and bounds["limit"] <= gain * (rate + bounds["field.change"]):
        return {}
    try:
        power = power_at(wired, rate)
    except RefusedError:
        return {}
    root = max(largest_root(-power.free), largest_root(power.limited))
    if root >= rate * (1.0 - NEARLY):
        return {}
    least = rounded(root * MORE, 9)
    often = min(2 * least, (least + rate) / 2)
    fall = min(-value(power.free, often), value(power.limited, often) / value(power.seen, often))
    rise = max(highest(power.free), value(power.others, least))
    return {"rate": rate, "above": least, "often": often, "fall": near(fall, 1.0 / MORE), "rise": near(rise, MORE)}


def near(x: Fraction, share: float) -> Fraction:
    """Return a short number that is about a share of another one."""
    return rounded(float(x) * share, 15)


def largest_root(p: Poly) -> float:
    """Return from where on a quadratic is positive and grows; infinity where it is not in the end."""
    a, b, c = (float(part.number) for part in p.powers("m"))
    if c <= 0.0:
        return inf
    middle, room = -b / (2.0 * c), b * b - 4.0 * a * c
    return max(middle, 0.0) if room < 0.0 else max(middle + sqrt(room) / (2.0 * c), 0.0)


def is_about(loop: ClosedLoop) -> bool:
    """Return whether a law keeps a memory of the magnetic field alone."""
    return loop.remembers and loop.law.lyapunov is None and "magnetic_field" in loop.law.reads
