"""Bounds an attitude that an estimator computes anew from the measured directions of Sun, magnetic field and nadir."""

from __future__ import annotations

from math import inf, isfinite
from typing import Any, NamedTuple

from starhold.certification.certificate import FRESH
from starhold.certification.orbit_band import band_of, extremes
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts import magnetic_field
from starhold.parts.contract import Direction, Errors, Noise, Sky
from starhold.parts.part import Fitted
from starhold.parts.vectors import KINDS

WIDER, LONGEST = 1.16, 100.0
"""Noise turns the body, and what later noise does to the attitude depends on the directions that are measured then. Let at
each sample the covariance of what it adds be at most some S, whatever came before. Then the mean of exp(l.y) is at most that
of a Gaussian y of the covariances S, for any l, so that P(|y| > k) <= (k^2/3)^(3/2) exp(3/2 - k^2/2) for a y of three
components and unit covariance (the mean over Gaussian l of covariance 1 - 3/k^2). This is less than the kernel's bound for a
y wider by 1.16 wherever that is below 1e-4; and it is, for any share of an orbit or an hour, with control periods of up to
100 s."""
AGE = "attitude_age"
"""The estimate that tells whether directions are there (s)."""
NEAR = 5e-3
"""The share of its least distance within which the Earth's surroundings of an orbit are considered."""


class Directed(NamedTuple):
    """The errors and the noise of an attitude computed from directions, the sensors that it depends on, and how many
    Gaussian vectors count in the errors at each reading."""

    errors: Errors
    noise: Noise
    sensors: tuple[Fitted, ...]
    gaussian: int


def is_directed(estimator: Fitted) -> bool:
    """Return whether an estimator computes the attitude anew from the directions of each control instant."""
    return estimator.part.hook("combined") is not None


def directed(loop: ClosedLoop, estimator: Fitted) -> Directed | None:
    """Return the bounds of the attitude of such an estimator; None where it does not tell how old this is, where a sensor
    says no bounds, or those of one direction while it shows another or two, or knows Sun and field as of another epoch or
    otherwise than the estimator."""
    module: Any = estimator.part.module
    names = {
        name: kind for kind, (name, *_) in KINDS.items() if name in module.NEEDS or name in getattr(module, "SEVERAL", ())
    }
    if AGE not in module.Estimate._fields or not {"epoch", "ephemeris"} <= {*estimator.params._fields}:
        return None
    sensors = tuple(f for f in loop.used("sensor") if shown(f) & {*names, "position"})
    places = [f for f in sensors if "position" in shown(f)][:1]
    seeing = [f for f in sensors if shown(f) & names.keys()]
    if not hasattr(module, "SEVERAL"):
        seeing = [f for name in names for f in [one for one in seeing if name in shown(one)][:1]]
    alike = all(
        getattr(f.params, name, assumed) == assumed
        for f in seeing
        for name in ("epoch", "ephemeris")
        for assumed in [getattr(estimator.params, name)]
    )
    tells: list[Any] = [f.part.hook("direction") for f in seeing]
    tell_places: list[Any] = [f.part.hook("place") for f in places]
    sky = sky_of(loop, estimator.params.epoch) if alike and None not in (*tells, *tell_places) else None
    if sky is None or loop.period > LONGEST or not places:
        return None
    (where,) = (tell(f.params, sky) for tell, f in zip(tell_places, places, strict=True))
    off: float = where.error
    moved = {"sun": 0.0, "field": off * sky.turning, "nadir": off / sky.distance}
    seen: list[Direction] = [tell(f.params, loop.period, sky) for tell, f in zip(tells, seeing, strict=True)]
    if any({names[name] for name in shown(f) & names.keys()} != {one.of} for f, one in zip(seeing, seen, strict=True)):
        return None
    seen = [one.beside(moved[one.of]) for one in seen]
    if off > NEAR * sky.distance or not all(isfinite(one.error) for one in seen):
        return None
    combined = module.combined(estimator.params, tuple(seen))
    if combined is None:
        return None
    return Directed(
        combined[0],
        combined[1],
        tuple(dict.fromkeys((*seeing, *places))),
        where.gaussian + sum(d.deviation > 0.0 for d in seen),
    )


def freshness(loop: ClosedLoop) -> list[str]:
    """Return the assumption that directions give the attitude of a loop's estimator as often as its sensors have them; none
    where it is another one or is not bounded."""
    fixes = [directed(loop, f) for f in loop.used("estimator")[:1] if is_directed(f)]
    return [f"{FRESH}{(fix.noise.every - 1) * loop.period!r}" for fix in fixes if fix is not None]


def sky_of(loop: ClosedLoop, epoch: Any) -> Sky | None:
    """Return the surroundings of a loop's orbit within its band, rounded so that all machines agree; None without an
    orbit that stays above ground and comes back, and where the field is not bounded."""
    if not loop.has("two-body"):
        return None
    (low, high, fast), share = extremes(loop), band_of(loop).share + NEAR
    low, high, fast = (float(f"{x:.6g}") for x in (low * (1.0 - share), high * (1.0 + share), fast * (1.0 + share)))
    if not magnetic_field.GROUND < low < high < inf:
        return None
    weakest = magnetic_field.weakest(epoch, low, high)
    return Sky(weakest, magnetic_field.steepest(epoch, low) / weakest, low, fast) if weakest else None


def shown(sensor: Fitted) -> set[str]:
    """Return the names of a sensor's readings."""
    return set(sensor.part.module.Reading._fields)
