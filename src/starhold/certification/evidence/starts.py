"""Where the search for a claim about the loop that flies begins: the rate of the loop's start, its stiffness, and sound
sets."""

from collections.abc import Mapping
from fractions import Fraction
from itertools import takewhile
from typing import Any

import numpy as np
from numpy.typing import NDArray

from starhold.certification.assumptions import as_it_starts
from starhold.certification.evidence.attitude import Loop
from starhold.certification.evidence.blends import renumbered
from starhold.certification.evidence.cones import interior_point
from starhold.certification.evidence.finding import NotFoundError, evidence
from starhold.certification.evidence.sparse import entries_of
from starhold.certification.evidence.squares import CLEAR, DEFINITE, cofactors, definiteness, equations, problem_of, settled
from starhold.kernel.held import Held
from starhold.kernel.loops import AttitudeLoop
from starhold.kernel.near import near_target
from starhold.kernel.numbers import RefusedError
from starhold.kernel.rules import Squares
from starhold.kernel.theorems.kinetic import ASKED
from starhold.kernel.theorems.pointing import descends
from starhold.loop.closed_loop import ClosedLoop

Array = NDArray[np.float64]
POINTS, MANY = "points", 18
"""The claim's theorem, and of how many terms a sum of squares takes long to find."""


def start_rate(loop: ClosedLoop) -> float:
    """Return the rate (rad/s), relative to its target, at which a loop starts."""
    return float(np.linalg.norm(as_it_starts(loop).rate))


def begins(loop: Loop, motion: Held, numbers: Mapping[str, Any], scales: Mapping[str, float]) -> bool:
    """Return whether the set of a claim with these numbers, but without levels, is sound, and the torque keeps its limits on
    it, as far as floats tell."""
    forms = set[Any]()
    try:
        begun = renumbered(motion, {**numbers, "highest": 0})
        wanted = dict(takewhile(lambda one: one[0] != "V between samples", descends(begun.loop, begun)))
        for name, o in wanted.items():
            if not isinstance(o, Squares):
                evidence(name, wanted, scales)
                continue
            few = " at first " in name or (" falls " in name and len(o.z) <= MANY)
            if ASKED in numbers and name.startswith(("motor", "torque")) and not few:
                # Others take long, and states of the set have told what may be asked for.
                continue
            # Images in mirrors, and by half turns, differ in signs alone; the bound of the rate was found by its sum.
            alike = o.p.lower, frozenset((m, abs(c)) for m, c in o.p.upper.items()), len(o.z)
            if name == "rate falls" or alike in forms:
                continue
            chance, least = likely(o, scales), DEFINITE
            if chance is None:
                chance, least = definiteness(o, scales), CLEAR
            if chance is None or chance < least:
                raise NotFoundError(f"{name}: no sum of squares was found")
            forms.add(alike)
    except (NotFoundError, RefusedError) as reason:
        loop.failed[POINTS] = str(reason)
        return False
    return True


def feedback(loop: AttitudeLoop) -> float:
    """Return the stiffness of the law near rest, a third of its trace."""
    return -float(sum(row[3 + k] for k, row in enumerate(near_target(loop, Fraction(0)).torque))) / 3.0


def likely(o: Squares, scales: Mapping[str, float]) -> float | None:
    """Return by how much the matrix of a sum of squares can be definite, in floats, where each of its entries has a monomial
    of its own: it follows from multipliers and cofactors, and the interior point looks for these few alone. None otherwise.
    """
    p, known, _ = settled(o)
    problem = problem_of(o, p, known, cofactors(o, p, len(o.z)), len(o.z))
    z = problem.z
    entries, b, _ = equations(problem, scales)
    head, count = entries.shape[1] - len(problem.pairs), len(problem.pairs)
    A, grams = np.zeros((len(b), head)), list[tuple[int, float]]()
    for row, column, value in zip(*entries[:3], strict=True):
        if column < head:
            A[row, column] = value
        else:
            grams.append((row, value))
    places = [row for row, _ in grams]
    if not len(places) == len(set(places)) == count:
        return None
    # In triangles of matrices, the entries beside the diagonal twice.
    halves = np.array([1.0 if i == k else 0.5**0.5 for i, k in problem.pairs])
    weights = halves / np.array([value for _, value in grams])
    unit, equal = float(np.abs(b).max()) or 1.0, sorted(set(range(len(b))) - set(places))
    square, strict = (
        [[float(i == k)] for i, k in problem.pairs],
        [[float(k < problem.strict)] for k in range(problem.signed)],
    )
    rows: list[Array] = [
        np.hstack([A[equal], np.zeros((len(equal), 1))]),
        np.hstack([-np.eye(problem.signed, head), np.array(strict).reshape(-1, 1)]),
        np.eye(head + 1)[head:],
        np.hstack([A[places] * weights[:, None], np.array(square)]),
    ]
    right = np.concatenate([b[equal] / unit, np.zeros(problem.signed), np.ones(1), b[places] * weights / unit])
    cost = -np.eye(head + 1)[head]
    x = interior_point(cost, entries_of(np.vstack(rows)), right, len(equal), problem.signed + 1, [len(z)])
    return None if x is None else float(x[-1])
