"""Searches for the root of the modal law with the fastest slew within limits, over the initial angle, and fits it."""

import math
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from os import cpu_count
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import minimize_scalar

from starhold.algebra.quaternion import multiply
from starhold.algebra.structure import flatten
from starhold.analysis.transient import Flown, Limits, Transient, Transients, Watcher
from starhold.laws import modal
from starhold.laws.modal import fitted
from starhold.loop.closed_loop import ClosedLoop

PIECE = 3
"""The least number of angles for each piece of the fit, which has three parameters."""
TOGETHER = 128
"""The number of roots flown in a batch, after each of which hopeless ones are dropped."""
DECAYS = np.geomspace(0.02, 30.0, 80)
"""The exponents (1/rad) tried first in the fit of a piece."""


@dataclass(frozen=True)
class Best:
    """The best root (1/s), with its transient, which is the shortest."""

    root: float
    transient: Transient

    @property
    def time(self) -> float:
        """Return the duration of the transient (s)."""
        return math.inf if self.transient.time is None else self.transient.time


class Found(NamedTuple):
    """The best roots for one initial angle (rad): within the limits, and within the limits plus tolerances; None if no root
    tried keeps them and settles."""

    angle: float
    hard: Best | None
    eased: Best | None


class Unmet(NamedTuple):
    """The condition that no root meets from an angle: to reach the "end" at all; or, if some do, to keep the limit of the
    "rate" or of the "acceleration", where `least` is the least of their peaks (rad/s or rad/s2), that of `root` (1/s); or
    to keep "both"."""

    what: Literal["end", "rate", "acceleration", "both"]
    least: float = math.nan
    root: float = math.nan


class TwoPieceFit(NamedTuple):
    """The fit c exp(d angle) + e (1/s; angle in rad), with c, d, e up to the split (rad) and beyond it."""

    below: tuple[float, float, float]
    above: tuple[float, float, float]
    split: float

    def at(self, angles: ArrayLike) -> NDArray[np.float64]:
        """Return roots (n,) at angles (n,)."""
        return fitted(np.asarray(angles, dtype=float), *self)

    def errors(self, angles: ArrayLike, roots: ArrayLike) -> NDArray[np.float64]:
        """Return the relative errors (n,) of the fit against roots (n,) at angles (n,)."""
        return self.at(angles) / np.asarray(roots, dtype=float) - 1.0


PUBLISHED = TwoPieceFit(*(modal.Fit._field_defaults[name] for name in TwoPieceFit._fields))
"""The published fit for limits of 30 deg/s and 50 deg/s2, from an initial rate of 20 deg/s about the axis of the slew."""


@dataclass(frozen=True)
class SlewProblem:
    """Slews from an angle (rad) about the axis (3,) at a rate (3,) (rad/s), flown for `steps` control steps of the modal
    law's loop to a target at rest; they end within the ends, in rad and rad/s; b in s."""

    loop: ClosedLoop
    steps: int
    axis: tuple[float, float, float]
    rate: tuple[float, float, float]
    angle_end: float
    rate_end: float
    b: float

    def watcher(self) -> Watcher:
        """Return the watcher that flies the problem's loop and checks each step."""
        root = (-1.0, -1.0, -1.0)
        # These gains only define the form of those of the lanes.
        return Watcher(replace(self.loop, gains=modal.Gains(root, root, self.b)), self.angle_end, self.rate_end)

    def start(self, angle: float) -> list[float]:
        """Return the numbers of the initial state of slews of this angle (rad)."""
        half = math.sin(0.5 * angle) / math.hypot(*self.axis)
        x, y, z = self.axis
        turn = (math.cos(0.5 * angle), half * x, half * y, half * z)
        goal: Any = self.loop.target.params.attitude
        return flatten(self.loop.start._replace(attitude=multiply(goal, turn), rate=self.rate))

    def gains(self, roots: ArrayLike) -> modal.Gains:
        """Return the law's gains, with arrays (n,) for the roots (n,)."""
        root: Any = np.asarray(roots, dtype=float)
        return modal.Gains((root, root, root), (root, root, root), self.b)

    def fly(self, angle: float, roots: ArrayLike) -> Transients:
        """Return the transients of the slew of this angle (rad) with each of the roots (n,), all flown to the end."""
        starts = np.repeat(np.array([self.start(angle)]).T, len(np.asarray(roots)), axis=1)
        return self.watcher().fly(starts, self.gains(roots), self.steps)


def search(
    problem: SlewProblem,
    angles: Sequence[float],
    roots: ArrayLike,
    limits: Limits,
    eased: Limits,
    notice: Callable[[int, int], None] = lambda done, total: None,
    threads: int | None = None,
) -> list[Found]:
    """Return the best of all roots (n,) for each angle, within `limits` and within `eased`, which are no tighter. Every root
    is flown until it leaves the eased limits, takes longer than the best so far, or ends. `notice` is called with the number
    of angles done and their total."""
    answers: list[Found] = []
    work = partial(_best, problem, problem.watcher(), np.sort(np.asarray(roots, dtype=float)), limits, eased)
    with ThreadPoolExecutor(max_workers=threads or cpu_count() or 1) as pool:
        try:
            for answer in pool.map(work, angles):
                answers.append(answer)
                notice(len(answers), len(angles))
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    return answers


def _best(problem: SlewProblem, watcher: Watcher, roots: Any, limits: Limits, eased: Limits, angle: float) -> Found:
    """Return the result of the search at one angle, block by block from the fastest roots on."""
    start = np.array(problem.start(angle))[:, None]
    best: dict[Limits, Best] = {}
    for at in range(0, len(roots), TOGETHER):
        block = roots[at : at + TOGETHER]
        enough = partial(_settled, eased, best[limits].time if limits in best else math.inf, problem.loop.period)
        starts = np.repeat(start, len(block), axis=1)
        flown = watcher.search(starts, problem.gains(block), problem.steps, enough)
        for kind in {limits, eased}:
            times = np.where(flown.within(kind) & ~np.isnan(flown.time), flown.time, np.inf)
            lane = int(np.argmin(times))
            if times[lane] < (best[kind].time if kind in best else math.inf):
                best[kind] = Best(float(block[lane]), flown[lane])
    return Found(angle, best.get(limits), best.get(eased))


def _settled(limits: Limits, least: float, period: float, flown: Flown) -> bool:
    """Return whether no lane of a block can still be the best: all are beyond the limits, diverged, or too late."""
    beyond = ~flown.transients(period).within(limits) | flown.lost
    late = flown.outside & (flown.steps * period > least)
    return bool((beyond | late).all())


def unmet(problem: SlewProblem, angle: float, roots: ArrayLike, limits: Limits) -> Unmet:
    """Return the reason why `search` finds none of these roots (n,) at an angle (rad)."""
    roots = np.asarray(roots, dtype=float)
    flown = problem.fly(angle, roots)
    ended = ~np.isnan(flown.time)
    if not ended.any():
        return Unmet("end")
    rate, acceleration, roots = flown.peak_rate[ended], flown.peak_acceleration.max(axis=0)[ended], roots[ended]
    if rate.min() > limits.rate:
        return Unmet("rate", float(rate.min()), float(roots[rate.argmin()]))
    if acceleration.min() > limits.acceleration:
        return Unmet("acceleration", float(acceleration.min()), float(roots[acceleration.argmin()]))
    return Unmet("both")


def fit(angles: ArrayLike, roots: ArrayLike) -> TwoPieceFit | None:
    """Return the fit of least rms relative error: two pieces, split half-way between two angles; None for too few angles.

    angles: (n,), increasing (rad); roots: (n,), below zero (1/s)."""
    x, y = np.asarray(angles, dtype=float), np.asarray(roots, dtype=float)
    if len(x) < 2 * PIECE:
        return None
    best, least = None, math.inf
    for cut in range(PIECE, len(x) - PIECE + 1):
        below, above = (_piece(x[part], y[part]) for part in (slice(None, cut), slice(cut, None)))
        if below[1] + above[1] < least:
            best, least = TwoPieceFit(below[0], above[0], 0.5 * float(x[cut - 1] + x[cut])), below[1] + above[1]
    return best


def _piece(x: Any, y: Any) -> tuple[tuple[float, float, float], float]:
    """Return c, d, e of one piece and the sum of its squared relative errors. For a given d the others are linear."""

    def solve(d: float) -> tuple[Any, float]:
        # Weighted by 1/y, so that relative errors count.
        basis = np.column_stack([np.exp(d * (x - x[0])), np.ones_like(x)]) / y[:, None]
        factors = np.linalg.lstsq(basis, np.ones_like(y), rcond=None)[0]
        return factors, float(np.sum((basis @ factors - 1.0) ** 2))

    tried = np.concatenate([-DECAYS[::-1], DECAYS])
    place = int(np.argmin([solve(d)[1] for d in tried]))
    low, high = tried[max(place - 1, 0)], tried[min(place + 1, len(tried) - 1)]
    best: Any = minimize_scalar(lambda d: solve(d)[1], bounds=(low, high), method="bounded", options={"xatol": 1e-6})
    d = float(best.x) if best.fun < solve(tried[place])[1] else float(tried[place])
    (c, e), error = solve(d)
    return (float(c * math.exp(-d * x[0])), d, float(e)), error
