"""The torque envelope of reaction wheels: its facets, and the largest box and ball within it."""

from __future__ import annotations

import math
from functools import cache
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.structured import Buffer
from starhold.algebra.vector import Vector
from starhold.parts.effectors.wheel_arrays import most_of_each

if TYPE_CHECKING:
    from starhold.parts.effectors.wheels import Wheels

Array = NDArray[np.float64]
COPLANAR = 1e-9
"""Sine of the angle below which axes count as parallel, or as lying in a plane."""
WORST_CONDITION = 1e3


def facets_of(axes: tuple[Vector, ...], least: tuple[Vector, ...]) -> Buffer:
    """Return the facets that `allocate_peak` needs, for wheels with these axes and least-squares allocation rows."""
    return _facets(axes, _counted(least))


def authority(wheels: Wheels, kind: Literal["axis", "norm"] = "norm", *, peak: bool = False) -> float:
    """Return the torque (N m) available in every direction: any torque of at most this norm ("norm"), or of at most this
    about each body axis at once ("axis"), is allocated within the motors' torque limits. It is 0 if a wheel in the
    allocation has none.

    With least squares it is the largest such ball or box. With the least peak it is the largest in the envelope of wheels
    that all have the least of the limits, which is exact if the limits are equal.
    """
    limits = [wheels.torque_limit[k] for k in _counted(wheels.least)]
    if peak:
        pieces = np.array(facets_of(wheels.axes, wheels.least).cells).reshape(-1, 6 + 3 * len(wheels.axes))
        return min(limits) / float(most_of_each(pieces[:, :3], kind).max())
    shares = most_of_each(np.array(wheels.least)[list(_counted(wheels.least))], kind)
    return min(limit / share for limit, share in zip(limits, shares.tolist(), strict=True))


def _counted(least: tuple[Vector, ...]) -> tuple[int, ...]:
    """Return the indices of the wheels that take part in the allocation."""
    return tuple(k for k, row in enumerate(least) if any(row))


@cache
def _facets(rows: tuple[Vector, ...], counted: tuple[int, ...]) -> Buffer:
    """Return the pieces of `allocate_peak`, see `Wheels.facets`. Parallel wheels act as one stronger wheel; pairs of axes
    in one plane share a facet, in which the same problem is solved again with the axes in that plane. The last piece is
    repeated until there is one for each pair of wheels."""
    axes = np.array(rows)
    spread = _merge_parallel(axes, counted)
    strong = spread.T @ axes
    unit = strong / np.linalg.norm(strong, axis=1)[:, None]
    count = len(strong)
    correction = np.linalg.pinv(strong.T)
    pieces: list[Array] = []
    seen: set[tuple[int, int]] = set()
    for pair in ((i, j) for j in range(count) for i in range(j)):
        if pair in seen:
            continue
        normal = np.cross(unit[pair[0]], unit[pair[1]])
        normal /= np.linalg.norm(normal)
        heights = strong @ normal
        plane = [k for k in range(count) if k in pair or abs(unit[k] @ normal) < COPLANAR]
        seen.update((i, j) for j in plane for i in plane if i < j)
        outside = np.sign(heights)
        outside[plane] = 0.0
        normal /= outside @ heights
        peak = np.outer(outside, normal)
        left = np.eye(3) - strong.T @ peak
        # Two axes have one such plane, which either axis gives.
        for free in plane if len(plane) > 2 else plane[:1]:
            across = np.cross(normal, unit[free])
            sides = np.where(np.isin(np.arange(count), plane), np.sign(strong @ across), 0.0)
            sides[free] = 0.0
            across /= sides @ (strong @ across)
            torques = peak + np.outer(sides, across @ left)
            torques[free] = strong[free] @ (np.eye(3) - strong.T @ torques) / (strong[free] @ strong[free])
            torques += correction @ (np.eye(3) - strong.T @ torques)
            pieces.append(np.concatenate([normal, across @ left, (-spread @ torques).ravel()]))
    most = math.comb(len(axes), 2)
    pieces += [pieces[-1]] * (most - len(pieces))
    return Buffer(np.concatenate(pieces).tolist())


def _merge_parallel(axes: Array, counted: tuple[int, ...]) -> Array:
    """Return signs (wheels, classes): the torque of a wheel is that of its class of parallel wheels times the sign."""
    classes: list[Array] = []
    leaders: list[Array] = []
    for k in counted:
        parallel = [c for c, leader in enumerate(leaders) if np.linalg.norm(np.cross(leader, axes[k])) < COPLANAR]
        if not parallel:
            leaders.append(axes[k])
            classes.append(np.zeros(len(axes)))
            parallel = [len(leaders) - 1]
        classes[parallel[0]][k] = np.sign(leaders[parallel[0]] @ axes[k])
    return np.array(classes).T


def check_authority(axes: Array, who: str) -> None:
    """Raise ValueError unless the axes (working wheels, 3) span space with an acceptable condition number."""
    if len(axes) == 0:
        raise ValueError(f"{who} no torque at all: none is left")
    directions, sizes, _ = np.linalg.svd(axes.T)
    sizes = np.append(sizes, np.zeros(3 - len(sizes)))
    lacking = directions[:, sizes <= COPLANAR * sizes[0]]
    if lacking.shape[1]:
        shown = " and ".join(_shown(direction) for direction in lacking.T)
        raise ValueError(f"{who} no torque about the body direction {shown}: three independent axes are needed")
    condition = float(sizes[0] / sizes[2])
    if condition > WORST_CONDITION:
        raise ValueError(
            f"{who} hardly any torque about the body direction {_shown(directions[:, 2])}: "
            f"the condition number of the axes is {condition:.3g}, above {WORST_CONDITION:g}"
        )


def _shown(direction: Array) -> str:
    rounded = direction.round(9)
    leading = np.flatnonzero(np.abs(rounded) > 0.5 * np.abs(rounded).max())[0]
    return f"({', '.join(f'{x:.3g}' for x in (np.sign(rounded[leading]) * rounded + 0.0).tolist())})"
