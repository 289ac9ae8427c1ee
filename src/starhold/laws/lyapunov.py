"""PD feedback with the gyroscopic and the modelled external torque cancelled."""

from __future__ import annotations

from functools import lru_cache, partial
from typing import Annotated, Any, NamedTuple

from starhold.algebra.quaternion import vector_part
from starhold.algebra.scalar import Scalar
from starhold.algebra.vector import Vector, add, apply, dot, scale, subtract, swing
from starhold.laws import response
from starhold.laws.interface import Card, Gain, NoMemory, Seen
from starhold.laws.response import Bandwidth, Settling, Turn, explained, fastest, feedback, settle, told
from starhold.models.craft import Craft

CARD = Card(
    title="Lyapunov",
    summary="u = -k_rate w - k_attitude q + w x Jw - M_ext: V falls whatever the modelled torque",
    sources=("published comparison of Lyapunov, sliding-mode and predictive attitude control, eq. (9)",),
    assumptions=("rigid body", "inertia known", "external torque known", "torque not limited"),
    claims="almost-global",
)


class Gains(NamedTuple):
    """Damping and stiffness."""

    k_rate: Annotated[float, Gain("N m s", above=0.0, text="damping")]
    k_attitude: Annotated[float, Gain("N m", above=0.0, text="stiffness against the quaternion's vector part")]


FORMS: dict[str, Any] = {"bandwidth": Bandwidth, "settling": Settling}
complete = response.complete


def design(craft: Craft, spec: Bandwidth | Settling) -> Gains:
    """Gains of this bandwidth and damping, or the lowest that settle in time; ValueError where the torque allows none."""
    if isinstance(spec, Bandwidth):
        return Gains(*feedback(craft, spec.bandwidth, spec.damping))
    return _settled(craft, spec)[0]


@lru_cache(maxsize=64)
def _settled(craft: Craft, spec: Settling) -> tuple[Gains, Turn]:
    def gains_of(x: float) -> Gains:
        return Gains(*feedback(craft, x, spec.damping))

    return settle(torque, gains_of, partial(fastest, craft), craft, spec)


def explain(craft: Craft, spec: Bandwidth | Settling) -> list[tuple[str, Any]]:
    """The linear loop's frequency and damping about each principal axis, and how the turn goes."""
    if isinstance(spec, Bandwidth):
        return explained(craft, *design(craft, spec))
    gains, turn = _settled(craft, spec)
    return told(turn) + explained(craft, *gains)


def torque(seen: Seen, gains: Gains, craft: Craft, memory: NoMemory) -> tuple[Vector, NoMemory]:
    """Control torque (N m, body)."""
    feedback = add(scale(-gains.k_rate, seen.rate), scale(-gains.k_attitude, vector_part(seen.attitude)))
    gyroscopic = swing(craft.inertia, seen.body_rate)
    model = add(subtract(gyroscopic, seen.external_torque), apply(craft.inertia, seen.target_acceleration))
    return add(feedback, model), memory


def lyapunov(seen: Seen, gains: Gains, craft: Craft) -> Scalar:
    """V = w.Jw/2 + 2 k_attitude (1 - q0) (J); V' = -k_rate |w|2."""
    energy = 0.5 * dot(seen.rate, apply(craft.inertia, seen.rate))
    return energy + 2.0 * gains.k_attitude * (1.0 - seen.attitude[0])


def examples() -> list[Gains]:
    """The published gains, and stiffer ones."""
    return [Gains(0.09, 0.009), Gains(0.5, 0.05)]
