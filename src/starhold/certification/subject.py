"""The loop of a certificate, and bounds of external effects on it."""

from collections.abc import Collection
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, cast

import numpy as np
from flint import fmpq

from starhold.algebra.polynomial import Polynomial, constants, exact
from starhold.algebra.vector import Matrix, Vector
from starhold.certification.matrices import (
    above,
    fraction,
    greatest,
    inverted,
    least,
    matrix_of,
    negative,
    number,
    rows,
    upper,
)
from starhold.certification.measured import driven_errors
from starhold.certification.orbit_band import band_of
from starhold.certification.spline import spline_bounds
from starhold.certification.target_motion import motion_of, perigee
from starhold.certification.unmodelled import Pushes, assumed_away, envelope_of, grows, is_read, late_torque, pushes
from starhold.errors import InputError
from starhold.kernel.numbers import Rows, plus
from starhold.laws.catalogue import Law
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.contract import AT_REST, Envelope, Late
from starhold.parts.craft import Craft, tensor
from starhold.parts.effectors.wheels import ALLOCATIONS, Wheels
from starhold.parts.environments.gravity_gradient import gravity_gradient
from starhold.parts.targets.history import Knots

GATHERED = 0.05
"""The momentum that may be added before a mode ends, as a share of the wheels' momentum at which it ends."""
SPLINE = "rotation spline"
"""The curve that a tabulated target follows between its knots, see `parts.targets.history.Knots`."""


@dataclass(frozen=True)
class Subject:
    """One law on one spacecraft, exact: floats stand for their exact values.

    modelled: bound on each axis of the torque the models know (N m); target_rate, target_acceleration: bounds on the
    target's motion (rad/s, rad/s2), zero for one at rest; disturbance: bound on the norm of any further torque (N m);
    total_momentum: bound on the norm of the body's and the wheels' angular momentum (N m s) in claims about wheels;
    tolerance: in the pointing claim the inertia's entries differ by at most this share of sqrt(J_ii J_kk), None where the
    inertia is as given; pull: bound of the gravity-gradient torque per unit of inertia (1/s2); lags: whether the pointing
    claim includes lag, of the torque and of measurements as the body moves.
    """

    loop: ClosedLoop
    disturbance: Any
    modelled: tuple[Any, Any, Any]
    modelled_norm: Any
    target_rate: Any
    target_acceleration: Any
    total_momentum: Any
    tolerance: float | None = None
    pull: Any = 0
    lags: bool = True

    @property
    def off(self) -> float:
        """A bound on the norm of the inertia error (kg m2)."""
        return (self.tolerance or 0.0) * float(np.trace(tensor(self.loop.craft.inertia))) * (1.0 + 1e-12)

    def envelope(self, noisy: bool) -> Envelope:
        """Return the envelope of its motions, for the bounds of parts; noisy: except for a share of the time."""
        given = envelope_of(self.loop, above(self.total_momentum), noisy)
        return given._replace(moment=given.moment + self.off)

    def against(self, envelope: Envelope) -> Pushes:
        """Return bounds of the disturbances that the law does not know, including the gravity-gradient torque on the
        inertia's error."""
        bounds = pushes(self.loop, envelope)
        bounds = bounds if self.lags else bounds.steady
        return bounds._replace(outside=bounds.outside + float(self.disturbance) + above(self.pull) * self.off)

    @property
    def late(self) -> Late | None:
        """How late the torque is in the pointing claim."""
        return late_torque(self.loop) if self.lags else None

    @property
    def noisy(self) -> bool:
        """Whether the pointing claim is about noise, as far as the parts with it are not left out for what is late."""
        return driven_errors(self.loop) is not None and (self.lags or not grows(self.loop))

    @property
    def moving(self) -> bool:
        """Whether the target turns."""
        return self.target_rate != 0 or self.target_acceleration != 0


def make_subject(
    loop: ClosedLoop, disturbance: float = 0.0, momentum: float | None = None, stored: float = np.inf
) -> Subject:
    """The subject of a closed loop, with bounds over the whole orbit. `momentum`: in claims about wheels the total angular
    momentum (N m s); by default that of the start, or that at rest on target if it is larger, with at most `stored` in the
    wheels."""
    rate, acceleration = _target_bounds(loop)
    axes, norm, pull = (fmpq(0), fmpq(0), fmpq(0)), fmpq(0), fmpq(0)
    if loop.has("gravity-gradient"):
        axes, norm, pull = gravity_gradient_bounds(loop)
    # The subject is what its file says.
    axes, (norm, pull, rate, acceleration) = (
        tuple(exact(above(x)) for x in bounds) for bounds in (axes, (norm, pull, rate, acceleration))
    )
    total = fmpq(0)
    if loop.wheels is not None:
        total = exact(_momentum(loop, rate, stored) if momentum is None else momentum)
    return Subject(loop, exact(disturbance), axes, norm, rate, acceleration, total, pull=pull)


def described(subject: Subject, kinds: Collection[str] = ()) -> dict[str, Any]:
    """The subject as plain numbers and names, all that a checker needs to build it again, without what no claim of these
    kinds is about."""
    loop = subject.loop
    limit = loop.craft.torque_limit
    orbit = {
        "position": list(loop.start.position),
        "velocity": list(loop.start.velocity),
        "gravitational_parameter": loop.craft.gravity,
    }
    target = described_target(loop)
    # Claims leave other targets out by name, and are about one at rest.
    name = target["target"] if is_read(loop, loop.target) else "inertial"
    return {
        "law": loop.law.name,
        "gains": described_gains(loop.law, loop.gains),
        "quaternion_sign": loop.sign_policy,
        "hysteresis_width": loop.hysteresis_width if loop.sign_policy == "hysteresis" else None,
        "inertia": tensor(loop.craft.inertia).tolist(),
        "limit": loop.limit,
        "torque_limit": _finite(limit),
        "orbit": orbit if loop.has("two-body") else None,
        "gravity_gradient": loop.has("gravity-gradient"),
        "target": name,
        "history": target["history"],
        "target_rate": above(subject.target_rate),
        "target_acceleration": above(subject.target_acceleration),
        "modelled_torque": [above(m) for m in subject.modelled],
        "modelled_torque_norm": above(subject.modelled_norm),
        "disturbance": number(subject.disturbance) if "sliding" in kinds else 0.0,
        "control_period": loop.period,
        "assumed_away": assumed_away(loop),
        "parts": len(loop.parts),
        "wheels": None if loop.wheels is None else _described_wheels(subject, loop.wheels),
    }


def described_target(loop: ClosedLoop) -> dict[str, Any]:
    """The target by its name, with its attitude if it rests and its knots if it has any; a target that claims leave out is
    described by the name that they use."""
    part, knots = loop.target.part, followed(loop)
    name = part.name if is_read(loop, loop.target) else f"{part.role} {loop.target.called}"
    history = None if knots is None else {"interpolant": SPLINE} | {n: x.tolist() for n, x in knots._asdict().items()}
    attitude = list(loop.target.params.attitude) if name == "inertial" else None
    return {"target": name, "attitude": attitude, "history": history}


def followed(loop: ClosedLoop) -> Knots | None:
    """The knots of the spline that a tabulated target follows; the rows of a table without knots are its knots."""
    if loop.target.part.name != "history":
        return None
    table, knots = loop.target.params
    return knots or Knots(np.arange(len(table), dtype=float) * loop.period, table[:, :4], table[:, 4:7])


def described_gains(law: Law, gains: Any) -> dict[str, Any]:
    """Return a law's gains by name; a choice is given by its own name."""
    described: dict[str, Any] = {}
    for item, value in zip(law.fields(), gains, strict=True):
        described[item.name] = item.gain.choices[value] if item.gain.choices else _plain(value)
    return described


def _described_wheels(subject: Subject, wheels: Wheels) -> dict[str, Any]:
    return {
        "axes": [list(axis) for axis in wheels.axes],
        "torque_limit": [_finite(limit) for limit in wheels.torque_limit],
        "momentum_limit": [_finite(limit) for limit in wheels.momentum_limit],
        "inertia": list(wheels.inertia),
        "least": [list(row) for row in wheels.least],
        "momentum": list(subject.loop.rotors),
        "allocation": ALLOCATIONS[wheels.allocation],
        "total_momentum": number(subject.total_momentum),
    }


def _finite(x: float) -> float | None:
    return x if np.isfinite(x) else None


def exact_craft(inertia: Any, torque_limit: Any, gravity: Any) -> Craft:
    """A craft of constant polynomials with the exact inverse of its inertia; a limit that is infinite stays a variable."""
    full = rows(tensor(inertia))
    limit = Polynomial.constant(torque_limit) if np.isfinite(torque_limit) else Polynomial.variable("limit")
    return Craft(as_tuple(full), as_tuple(inverted(full)), limit, Polynomial.constant(gravity))  # pyright: ignore


def as_tuple(matrix: Rows) -> Matrix | Vector:
    """Rows as the constant polynomials that equations take."""
    return constants(tuple(tuple(row) for row in matrix))


def _plain(value: Any) -> Any:
    return np.asarray(cast(Any, value)).tolist() if isinstance(value, tuple) else value


def _momentum(loop: ClosedLoop, target_rate: Any, stored: float) -> float:
    """Norm of the total angular momentum at the start or at rest on target, whichever is more, rounded up (N m s), with no
    more than `stored` in the wheels and a part more for what torques add until a mode ends."""
    inertia = tensor(loop.craft.inertia)
    begun = inertia @ loop.start.rate + loop.stored
    still = float(np.linalg.eigvalsh(inertia)[-1]) * above(target_rate)
    return max(min(float(np.linalg.norm(begun)), stored * (1.0 + GATHERED) + still), still) * (1.0 + 1e-12)


# --- bounds on the outside --------------------------------------------------------------------------------------------


def gravity_gradient_bounds(loop: ClosedLoop) -> tuple[Any, Any, Any]:
    """Bounds on the axes and on the norm of the gravity-gradient torque over the whole orbit (N m), and on the norm per unit
    of inertia (1/s2)."""
    nearest, _, _, gravity = perigee(loop)
    # With a margin, because the inertia with the rotors is flown up to rounding.
    strength = upper(3 * gravity / (nearest * (1 - exact(band_of(loop).share))) ** 3) * exact(1.0 + 1e-12)
    full = _with_rotors(loop)
    whole = Craft(as_tuple(full), as_tuple(full), Polynomial.constant(0), Polynomial.constant(0))  # pyright: ignore
    torque: Any = gravity_gradient(direction("p"), cast(Any, Polynomial.constant(1)), whole)
    axes = [strength * _largest_form(component) for component in torque]
    # |n x Jn| is the deviation of the moments about their mean in direction n, so at most half their range.
    return tuple(axes), strength * exact(greatest(full) - least(full)) / 2, strength


def _with_rotors(loop: ClosedLoop) -> Rows:
    """The inertia with the rotors' moments about their axes."""
    full = rows(tensor(loop.craft.inertia))
    if loop.wheels is not None:
        for axis, inertia in zip(loop.wheels.axes, loop.wheels.inertia, strict=True):
            a = [fraction(x) for x in axis]
            full = plus(full, [[x * y for y in a] for x in a], fraction(inertia))
    return full


def _largest_form(quadratic: Polynomial) -> Any:
    """A bound of |quadratic form| over the unit sphere."""
    form = matrix_of(quadratic, ("p1", "p2", "p3"))
    return exact(max(greatest(form), greatest(negative(form)), Fraction(0)))


def direction(name: str, first: int = 1, count: int = 3) -> Any:
    """Variables name1, name2, ... as a tuple."""
    return tuple(Polynomial.variable(f"{name}{i}") for i in range(first, first + count))


def _target_bounds(loop: ClosedLoop) -> tuple[Any, Any]:
    knots = followed(loop)
    if knots is not None:
        try:
            return spline_bounds(knots)
        except ArithmeticError as reason:
            raise InputError("target", "history", str(reason), "attitudes closer together") from None
    motion = motion_of(loop) or AT_REST
    return exact(motion.rate), exact(motion.acceleration)
