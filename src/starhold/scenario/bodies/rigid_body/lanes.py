"""Starts and spacecraft of many runs at once, from columns of sampled values: the bits that reading each run's own file
gives, without reading it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.quaternion import NO_TURN, multiply, stretch, to_body
from starhold.algebra.vector import add
from starhold.parts.bodies.rigid_body import State
from starhold.parts.craft import Craft
from starhold.scenario.bodies.rigid_body.craft import wheels_of
from starhold.scenario.bodies.rigid_body.start import goal_at_start, start_of, target_of

if TYPE_CHECKING:
    from starhold.scenario.reading import Scenario

Array: TypeAlias = NDArray[np.float64]

START = ("initial.attitude", "initial.rate")


def derive(scenario: Scenario, columns: Mapping[str, Array]) -> dict[str, Any]:
    """The start and the craft that these keys make, with an array (lanes,) in place of each number; columns: values
    (components..., lanes) by key. Left out is what they do not touch, or not in a way known here."""
    found: dict[str, Any] = {}
    if any(key in columns for key in START) and "initial.angles" not in columns:
        found["start"] = _start(scenario, columns)
    if "spacecraft.inertia" in columns and wheels_of(scenario) is None:
        found["craft"] = _craft(scenario.craft, columns["spacecraft.inertia"])
    return found


def _start(scenario: Scenario, columns: Mapping[str, Array]) -> State:
    """As `start_of` makes it, number by number."""
    goal, initial = target_of(scenario), scenario.table.initial
    first = start_of(scenario, goal)
    if initial.relative_to == "target":
        own = scenario.with_({"initial.relative_to": "inertial"})
        first = start_of(own, goal)
    attitude: Any = first.attitude
    if "initial.attitude" in columns:
        q: Any = tuple(columns["initial.attitude"])
        q = stretch(1.0 / np.max(np.abs(columns["initial.attitude"]), axis=0), q)
        attitude = stretch(1.0 / np.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]), q)
    rate: Any = tuple(columns["initial.rate"]) if "initial.rate" in columns else first.rate
    begun = first._replace(attitude=attitude, rate=rate)
    if initial.relative_to == "target":
        # Where the target's goal asks for the attitude too, this is not what a file gives, and whoever calls finds out.
        held = goal_at_start(goal, first._replace(attitude=NO_TURN))
        return begun._replace(attitude=multiply(held.attitude, attitude), rate=add(rate, to_body(attitude, held.rate)))
    return begun


def _craft(craft: Craft, moments: Array) -> Craft:
    """As `make_craft` makes it of valid inertias, (3, lanes) or (3, 3, lanes)."""
    if moments.ndim == 2:
        full = np.zeros((moments.shape[1], 3, 3))
        full[:, range(3), range(3)] = moments.T
    else:
        full = np.moveaxis(moments, -1, 0)
        full = 0.5 * (full + full.swapaxes(1, 2))
    inverse = np.linalg.inv(full)
    if isinstance(craft.inertia[0], tuple):
        made = (tuple(tuple(row.T) for row in part.swapaxes(0, 1)) for part in (full, inverse))
    else:
        made = (tuple(part[:, k, k] for k in range(3)) for part in (full, inverse))
    inertia, inverted = made
    return craft._replace(inertia=inertia, inverse_inertia=inverted)  # pyright: ignore[reportArgumentType]


def refused(columns: Mapping[str, Array]) -> NDArray[np.bool_]:
    """Which lanes have an inertia that no body has, (lanes,)."""
    moments = columns.get("spacecraft.inertia")
    if moments is None:
        return np.zeros(next(iter(columns.values())).shape[-1], dtype=bool)
    if moments.ndim == 2:
        ordered = np.sort(moments, axis=0).T
    else:
        full = np.moveaxis(moments, -1, 0)
        ordered = np.linalg.eigvalsh(0.5 * (full + full.swapaxes(1, 2)))
    return (ordered[:, 0] <= 0.0) | (ordered[:, 2] > (ordered[:, 0] + ordered[:, 1]) * (1.0 + 1e-9))
