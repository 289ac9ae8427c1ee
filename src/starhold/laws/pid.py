"""Proportional-integral-derivative feedback on the quaternion holds the target against a constant external torque."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from starhold.algebra.quaternion import vector_part
from starhold.algebra.vector import ZERO, Vector, add, clip_axes, principal_moments, scale, subtract
from starhold.laws.interface import Card, Gain, Measurement, tracking_torque
from starhold.parts.craft import Craft

CARD = Card(
    title="Quaternion PID",
    summary="u = -k_rate w - k_attitude q - k_integral z, z' = q, |k_integral z| <= integral_limit on each axis",
    sources=(
        "Wen and Kreutz-Delgado, The attitude control problem (1991): the PD part",
        "Astrom and Hagglund, PID Controllers (1995): the integral and its limits",
    ),
    assumptions=(
        "rigid body",
        "inertia known",
        "external torque constant in body axes, below integral_limit on every axis",
        "torque not limited",
        "k_rate k_attitude > J_max k_integral",
        "small attitude error, rate and integral",
        "control period short compared with the loop's time constants",
    ),
    claims="local",
)


class Gains(NamedTuple):
    """Damping, stiffness, the integral gain, and the largest torque of the integral."""

    k_rate: Annotated[float, Gain("N m s", above=0.0, text="damping")]
    k_attitude: Annotated[float, Gain("N m", above=0.0, text="stiffness against the quaternion's vector part")]
    k_integral: Annotated[float, Gain("N m/s", above=0.0, text="on the integral of the quaternion's vector part")]
    integral_limit: Annotated[
        float, Gain("N m", above=0.0, text="largest torque of the integral per axis; above the constant disturbance")
    ]


class Memory(NamedTuple):
    """The integral of the error quaternion's vector part (s)."""

    integral: Vector


def check(gains: Gains, craft: Craft) -> None:
    """Raise ValueError if the linear loop is not stable.

    About a principal axis of moment J its characteristic polynomial is J s^3 + k_rate s^2 + k_attitude/2 s + k_integral/2;
    by Routh's criterion it is stable if k_rate k_attitude > J k_integral, hardest for the largest moment."""
    most = gains.k_rate * gains.k_attitude / principal_moments(craft.inertia)[2]
    if not gains.k_integral < most:
        allowed = f"k_rate k_attitude / J_max = {most:.6g} N m/s"
        raise ValueError(f"k_integral must be below {allowed}, or the linear loop is unstable; it is {gains.k_integral:g}")


def remember(gains: Gains, craft: Craft, period: float) -> Memory:
    """Return the initial memory: an integral of zero."""
    return Memory(ZERO)


def torque(measurement: Measurement, gains: Gains, craft: Craft, memory: Memory) -> tuple[Vector, Memory]:
    """Return the control torque (N m, body)."""
    q = vector_part(measurement.attitude)
    # Anti-windup: the integral is clamped, not frozen while the torque is saturated. It also winds up in a slew that
    # reaches no limit, and a law does not know whether each axis, the norm or the wheels are limited. The clamp bounds the
    # overshoot in every case, and leaves enough torque for the disturbance for which it is sized.
    grown = add(memory.integral, scale(measurement.period, q))
    integral = clip_axes(grown, gains.integral_limit / gains.k_integral)
    proportional = add(scale(gains.k_rate, measurement.rate), scale(gains.k_attitude, q))
    feedback = add(proportional, scale(gains.k_integral, integral))
    return subtract(tracking_torque(measurement, craft), feedback), Memory(integral)


def examples() -> list[Gains]:
    """Return gains for a body of a few kg m2, the second near the stability boundary and soon at the integral's limit."""
    return [Gains(0.3, 0.03, 3e-4, 2e-3), Gains(0.5, 0.05, 5e-3, 1e-4)]
