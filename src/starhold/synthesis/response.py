"""Gains of feedback on rate and quaternion from bandwidth and damping, or from a settling time.

The linear loop J a'' + k_rate a' + k_attitude a/2 = 0 (a an angle, q = a/2) has about a principal axis of moment J_i the
natural frequency sqrt(k_attitude/(2 J_i)) and the damping ratio k_rate/sqrt(2 J_i k_attitude): with scalar gains both are
lowest about the axis of the largest moment.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import lru_cache, partial
from typing import Annotated, Any, NamedTuple, TypeVar

import numpy as np

from starhold.algebra.quaternion import Quaternion
from starhold.algebra.vector import Vector
from starhold.parts.contract import Parameter as Gain
from starhold.parts.craft import Craft, tensor
from starhold.synthesis.slews import Search, Turn, settle
from starhold.synthesis.start import Start

TORQUE = Gain("N m", above=0.0, text="largest norm; all available if absent")
MOMENTUM = Gain("N m s", above=0.0, text="of the wheels; all available if absent")
TURN = Gain(
    "1", shape=(4,), spread=False, text="rotation from the target to the body at the start; the scenario's if absent"
)
RATE = Gain("rad/s", shape=(3,), spread=False, text="relative rate then; the scenario's if absent")
STORED = Gain("N m s", shape=(3,), spread=False, text="in wheels then, body axes; the scenario's if absent")
ANGLE_LEFT, RATE_LEFT = (Gain(unit, above=0.0, text="that of [settling] if absent") for unit in ("rad", "rad/s"))
"""The inputs common to all forms with a settling time."""


class Bandwidth(NamedTuple):
    """The form takes the natural frequency and damping ratio of the linear loop, exact about the axis of the largest moment
    of inertia and higher about the others."""

    bandwidth: Annotated[float, Gain("rad/s", above=0.0, plain=(1e3, "deg/s"), text="lowest natural frequency of all axes")]
    damping: Annotated[float, Gain("1", above=0.0, text="lowest damping ratio of all axes")] = 0.7


class Settling(NamedTuple):
    """The form takes the lowest gains that settle in time within the available torque, by integrating the slew to a
    target at rest without external torque."""

    time: Annotated[float, Gain("s", above=0.0, text="after which angle and rate stay within their tolerances")]
    damping: Annotated[float, Gain("1", above=0.0, text="lowest damping ratio of all axes")] = 0.7
    torque: Annotated[float | None, TORQUE] = None
    momentum: Annotated[float | None, MOMENTUM] = None
    attitude: Annotated[Quaternion | None, TURN] = None
    rate: Annotated[Vector | None, RATE] = None
    wheel_momentum: Annotated[Any, STORED] = None
    attitude_tolerance: Annotated[float | None, ANGLE_LEFT] = None
    rate_tolerance: Annotated[float | None, RATE_LEFT] = None


FORMS: dict[str, Any] = {"bandwidth": Bandwidth, "settling": Settling}
Spec = TypeVar("Spec", bound=NamedTuple)


def complete(spec: Spec, start: Callable[[], Start]) -> Spec:
    """Return the inputs of a form; the form for a settling time is completed from the scenario's start."""
    left = [name for name in Start.__dataclass_fields__ if getattr(spec, name, 0) is None]
    return spec._replace(**{name: getattr(start(), name) for name in left}) if left else spec


def largest_moment(craft: Craft) -> float:
    """Return the largest principal moment of inertia (kg m2)."""
    return float(np.linalg.eigvalsh(tensor(craft.inertia))[-1])


def feedback(moment: float, bandwidth: float, damping: float) -> tuple[float, float]:
    """Return k_rate (N m s) and k_attitude (N m) for the largest moment of inertia (kg m2). Raise ValueError unless they
    are finite and positive."""
    gains = 2.0 * damping * bandwidth * moment, 2.0 * bandwidth * bandwidth * moment
    if not all(math.isfinite(gain) and gain > 0.0 for gain in gains):
        raise ValueError("the gains leave the range of numbers")
    return gains


def designs(
    make: Callable[[float, float], Any], torque: Callable[..., Any], share: float = 1.0
) -> tuple[Callable[..., Any], Callable[..., Any], Callable[..., Any]]:
    """Return `design`, `explain` and `design_all` of a law with these two forms. `make` returns its gains from k_rate (N m
    s) and k_attitude (N m); near rest the law feeds back `share` times k_attitude q."""

    def gains_at(moment: float, damping: float, bandwidth: float) -> Any:
        k_rate, stiffness = feedback(moment, bandwidth, damping)
        return make(k_rate, stiffness / share)

    def search(craft: Craft, spec: Settling) -> Search:
        moments: list[float] = np.linalg.eigvalsh(tensor(craft.inertia)).tolist()

        def fastest(gains: Any) -> float:
            # A bound on the rates of the linear loop with k_rate and this share of k_attitude.
            return max(gains.k_rate / moments[0], math.sqrt(0.5 * share * gains.k_attitude / moments[0]))

        return Search(partial(gains_at, moments[-1], spec.damping), fastest, craft, spec)

    def design(craft: Craft, spec: Bandwidth) -> Any:
        return gains_at(largest_moment(craft), spec.damping, spec.bandwidth)

    one, every, settled = settling(torque, Settling, search, design)

    def explain(craft: Craft, spec: Bandwidth | Settling) -> list[tuple[str, Any]]:
        gains = one(craft, spec)
        turned = slew_figures(settled(craft, spec)[1]) if isinstance(spec, Settling) else []
        return turned + explained(craft, gains.k_rate, share * gains.k_attitude)

    return one, explain, every


def settling(
    torque: Callable[..., Any], kind: type, search: Callable[..., Search], other: Callable[..., Any]
) -> tuple[Callable[..., Any], Callable[..., Any], Callable[..., tuple[Any, Turn]]]:
    """Return `design` and `design_all` of a law whose form `kind` is the `search` of a craft and inputs, and whose other
    forms use `other`; and the function that returns gains and slew of that form."""

    @lru_cache(maxsize=64)
    def settled(craft: Craft, spec: Any) -> tuple[Any, Turn]:
        return settle(torque, [search(craft, spec)])[0]

    def design(craft: Craft, spec: Any) -> Any:
        """Return the gains of a form. Raise ValueError if there are none."""
        return settled(craft, spec)[0] if isinstance(spec, kind) else other(craft, spec)

    def design_all(cases: Sequence[tuple[Craft, Any]]) -> list[Any]:
        """Return the gains for many pairs of craft and inputs of one form, equal to those of `design`."""
        if not isinstance(cases[0][1], kind):
            return [other(*case) for case in cases]
        return [gains for gains, _ in settle(torque, [search(*case) for case in cases])]

    return design, design_all, settled


def explained(craft: Craft, k_rate: float, k_attitude: float) -> list[tuple[str, Any]]:
    """Return natural frequency and damping about each principal axis, and the linear loop's eigenvalues."""
    moments = np.linalg.eigvalsh(tensor(craft.inertia))
    roots = np.array([np.roots([moment, k_rate, 0.5 * k_attitude]) for moment in moments]).ravel()
    return [
        ("principal moments (kg m^2)", moments),
        ("natural frequency (rad/s)", np.sqrt(0.5 * k_attitude / moments)),
        ("damping ratio", k_rate / np.sqrt(2.0 * moments * k_attitude)),
        ("eigenvalues of the linear loop (1/s)", roots),
        ("degree of stability (1/s)", float(-roots.real.max())),
    ]


def slew_figures(turn: Turn) -> list[tuple[str, Any]]:
    """Return the figures of merit of a slew designed for a settling time."""
    return [
        ("settles after (s)", turn.time),
        ("largest torque (N m)", turn.torque),
        ("largest momentum of the wheels (N m s)", turn.momentum),
    ]
