"""Whether something holds all over a box, by Bernstein coefficients of its parts: shown, false at an exact state, or open.

A part is done where one of the `rooms` is surely negative, or where all goals of one of the `options` are met: of each goal
one of its polynomials is surely positive, or is so where a room is not negative.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import prod
from typing import Any, TypeAlias

import numpy as np
from flint import fmpq
from numpy.typing import NDArray

from starhold.algebra.polynomial import Polynomial
from starhold.checker.bernstein import CLEAR, decided, halves, stacked, steepest
from starhold.checker.exact import CheckError, in_time

Poly: TypeAlias = Any
"""`fmpq_mpoly`."""
Options: TypeAlias = Sequence[Sequence[Sequence[Poly]]]
MOST, BLOCK, LOOKED_AT, LARGEST = 100_000, 4_096, 400, 1_000_000
"""Parts that are looked at, at once so many; states that are tried; coefficients of a part."""


@dataclass(frozen=True)
class Question:
    """Over a box (names of the ring's generators to their intervals). `strict`: how many of the rooms, the first ones, have
    to be positive, rather than not negative, at a state that shows the answer to be no. `most`: parts to look at."""

    box: Mapping[str, tuple[Any, Any]]
    rooms: Sequence[Poly]
    options: Options = ()
    strict: int = 0
    most: int = MOST


def answer(asked: Question) -> bool | None:
    """True: shown, False: an exact state shows the contrary, None: open."""
    # Polynomials of flint have no hash, their texts have; one that occurs twice is bounded once.
    flat = {str(p): p for goals in asked.options for goal in goals for p in goal}
    place = {text: len(asked.rooms) + k for k, text in enumerate(flat)}
    options = [[[place[str(p)] for p in goal] for goal in goals] for goals in asked.options]
    stack = [as_terms(p) for p in asked.rooms] + [-as_terms(p) for p in flat.values()]
    box = asked.box or {"": (fmpq(0), fmpq(1))}
    if not stack:
        return False
    if not {name for p in stack for name in p.variables()} <= set(box):
        raise CheckError("a polynomial depends on what the box does not hold")
    degrees = highest(stack, box)
    if len(stack) * prod(degree + 1 for degree in degrees) > LARGEST:
        return None
    first = stacked(stack, box, degrees)
    corner, width = np.zeros((1, len(box))), np.ones((1, len(box)))
    waiting = [(first, corner, width)]
    seen = tried = 0
    while waiting:
        in_time()
        boxes, corner, width = waiting.pop()
        seen += len(boxes)
        left = ~_done(boxes, len(asked.rooms), options)
        boxes, corner, width = boxes[left], corner[left], width[left]
        if not len(boxes):
            continue
        against = np.flatnonzero(_suspect(boxes, len(asked.rooms), asked.strict))[: max(0, LOOKED_AT - tried)]
        for k in against:
            tried += 1
            if any(_against(asked, stack, options, box, share) for share in _corners(corner[k], width[k])):
                return False
        if seen > asked.most:
            return None
        waiting += _halved(boxes, corner, width)
    return True


def _halved(boxes: Any, corner: Any, width: Any) -> list[tuple[Any, Any, Any]]:
    """Both halves of each box across its steepest axis, in blocks."""
    axes = steepest(boxes)
    found: list[tuple[Any, Any, Any]] = []
    for axis in range(2, boxes.ndim):
        here = axes == axis
        if not here.any():
            continue
        both = halves(boxes[here], axis)
        narrow, low = width[here].copy(), corner[here]
        narrow[:, axis - 2] /= 2.0
        high = low.copy()
        high[:, axis - 2] += narrow[:, axis - 2]
        lows, widths = np.concatenate([low, high]), np.concatenate([narrow, narrow])
        for k in range(0, len(both), BLOCK):
            found.append((both[k : k + BLOCK], lows[k : k + BLOCK], widths[k : k + BLOCK]))
    return found


def _done(boxes: Any, rooms: int, options: Sequence[Sequence[Sequence[int]]]) -> NDArray[np.bool_]:
    """The boxes where a room is negative, or the goals of an option are met. `boxes` holds upper bounds of what is not
    wanted: a polynomial that is to be positive stands there with the other sign."""
    rows = boxes.reshape(len(boxes), boxes.shape[1], -1)
    done = (rows[:, :rooms] < 0).all(axis=2).any(axis=1)
    met: dict[int, Any] = {}
    for goals in options:
        for k in {k for goal in goals for k in goal}:
            if k not in met:
                met[k] = (rows[:, k] < 0).all(axis=1)
                for room in range(rooms):
                    both = np.stack([rows[:, k], rows[:, room]], axis=1)
                    met[k] |= decided(both)
        reached = np.ones(len(rows), dtype=bool)
        for goal in goals:
            reached &= np.any([met[k] for k in goal], axis=0)
        done |= reached
    return done


def _suspect(boxes: Any, rooms: int, strict: int) -> NDArray[np.bool_]:
    """Boxes with a corner at which rooms allow a state, and something wanted may fail."""
    for axis in range(2, boxes.ndim):
        boxes = boxes.take([0, -1], axis=axis)
    rows = boxes.reshape(len(boxes), boxes.shape[1], -1)
    # Of corners at which V is zero there are many, and none shows anything.
    found = (rows[:, :rooms] >= 0).all(axis=1) & (rows[:, :strict] > CLEAR).all(axis=1)
    if rows.shape[1] > rooms:
        found &= (rows[:, rooms:] >= 0).any(axis=1)
    return found.any(axis=1)


def _corners(corner: Any, width: Any) -> list[list[Any]]:
    found: list[list[Any]] = [[]]
    for low, wide in zip(corner, width, strict=True):
        found = [[*before, fmpq(*float(x).as_integer_ratio())] for before in found for x in (low, low + wide)]
    return found


def _against(
    asked: Question,
    stack: Sequence[Polynomial],
    options: Sequence[Sequence[Sequence[int]]],
    box: Mapping[str, tuple[Any, Any]],
    share: list[Any],
) -> bool:
    """Whether an exact state shows that the answer is no. Only the first polynomial of a goal is what is asked; the others
    are ways to show it."""
    state = {name: low + s * (high - low) for (name, (low, high)), s in zip(box.items(), share, strict=True)}
    for k in range(len(asked.rooms)):
        value = stack[k].at(state)
        if value < 0 or (k < asked.strict and value == 0):
            return False
    return all(any(stack[goal[0]].at(state) >= 0 for goal in goals) for goals in options)


def highest(stack: Sequence[Polynomial], box: Mapping[str, Any]) -> list[int]:
    """The degree in each variable that none of these exceeds."""
    return [max((monomial.count(name) for p in stack for monomial in p.terms), default=0) for name in box]


def as_terms(p: Poly) -> Polynomial:
    """As `bernstein` reads it."""
    names = p.context().names()
    terms = {
        tuple(sorted(name for name, power in zip(names, powers, strict=True) for _ in range(int(power)))): c
        for powers, c in p.to_dict().items()
    }
    return Polynomial(terms)
