"""Starts and spacecraft of many runs at once, from columns of sampled values: the bits that reading each run's own file
gives, without reading it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.cosines import from_angles
from starhold.algebra.quaternion import NO_TURN, multiply, stretch, to_body
from starhold.algebra.vector import add
from starhold.parts.bodies.rigid_body import State
from starhold.parts.craft import Craft, inverse
from starhold.scenario.bodies.rigid_body.craft import wheels_of
from starhold.scenario.bodies.rigid_body.start import goal_at_start, start_of, target_of

if TYPE_CHECKING:
    from starhold.scenario.reading import Scenario

Array: TypeAlias = NDArray[np.float64]

START = ("initial.attitude", "initial.angles", "initial.rate")


def derive(scenario: Scenario, columns: Mapping[str, Array]) -> dict[str, Any]:
    """The start and the craft that these keys make, with an array (lanes,) in place of each number; columns: values
    (components..., lanes) by key, of whole vectors or of single components. Left out is what they do not touch, or not in a
    way known here."""
    found: dict[str, Any] = {}
    initial = {key: _whole(columns, key, getattr(scenario.table.initial, key.partition(".")[2])) for key in START}
    if any(values is not None for values in initial.values()):
        found["start"] = _start(scenario, *initial.values())
    moments = _moments(scenario, columns)
    if moments is not None and wheels_of(scenario) is None:
        found["craft"] = _craft(scenario.craft, moments)
    return found


def _moments(scenario: Scenario, columns: Mapping[str, Array]) -> Array | None:
    return _whole(columns, "spacecraft.inertia", np.diagonal(np.asarray(scenario.table.spacecraft.inertia)))


def _whole(columns: Mapping[str, Array], key: str, nominal: Any) -> Array | None:
    """The vectors (components, lanes), or matrices, of a key of which all or some components are drawn; None of one that is
    not drawn."""
    if key in columns:
        return columns[key]
    drawn = {name: values for name, values in columns.items() if name.startswith(f"{key}[")}
    if not drawn or nominal is None or any("][" in name for name in drawn):
        return None
    found = np.repeat(np.asarray(nominal, dtype=float)[:, None], len(next(iter(drawn.values()))), axis=1)
    for name, values in drawn.items():
        found[int(name[len(key) + 1 :].partition("]")[0]) - 1] = values
    return found


def _start(scenario: Scenario, quaternions: Array | None, angles: Array | None, rates: Array | None) -> State:
    """As `start_of` makes it, number by number."""
    goal, initial = target_of(scenario), scenario.table.initial
    first = start_of(scenario, goal)
    if initial.relative_to == "target":
        own = scenario.with_({"initial.relative_to": "inertial"})
        first = start_of(own, goal)
    attitude: Any = first.attitude
    if quaternions is not None:
        q: Any = stretch(1.0 / np.max(np.abs(quaternions), axis=0), tuple(quaternions))  # pyright: ignore
        attitude = stretch(1.0 / np.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]), q)
    elif angles is not None:
        # One by one, for the sine of an array may differ from that of a number.
        attitude = tuple(np.array([from_angles(*lane) for lane in angles.T.tolist()]).T)
    rate: Any = first.rate if rates is None else tuple(rates)
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
    made: Any
    if isinstance(craft.inertia[0], tuple):
        made = tuple(tuple(row.T) for row in full.swapaxes(0, 1))
    else:
        made = tuple(full[:, k, k] for k in range(3))
    return craft._replace(inertia=made, inverse_inertia=inverse(made))


def refused(scenario: Scenario, columns: Mapping[str, Array]) -> NDArray[np.bool_] | None:
    """Which lanes have an inertia that no body has, (lanes,); None where that is not drawn."""
    moments = _moments(scenario, columns)
    if moments is None:
        return None
    if moments.ndim == 2:
        ordered = np.sort(moments, axis=0).T
    else:
        full = np.moveaxis(moments, -1, 0)
        ordered = np.linalg.eigvalsh(0.5 * (full + full.swapaxes(1, 2)))
    return (ordered[:, 0] <= 0.0) | (ordered[:, 2] > (ordered[:, 0] + ordered[:, 1]) * (1.0 + 1e-9))
