"""Bounds the errors of the attitude and rate that laws receive: the largest besides noise, and those that noise drives."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache, reduce
from math import ceil, hypot, isfinite, log
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.quaternion import NO_TURN
from starhold.algebra.structure import flatten, leaves
from starhold.algebra.vector import IDENTITY, Vector, apply, diagonal, multiply, scale
from starhold.certification.directions import WIDER, directed, is_directed, shown
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.contract import NO_ERRORS, Errors, Noise, Recursion
from starhold.parts.part import Fitted
from starhold.parts.vectors import KINDS

Array = NDArray[np.float64]
TELLING = ("sensor", "estimator")
"""Roles whose `error` affects the law's measurements."""
PLACED = frozenset(("position", "velocity"))
"""Readings whose errors no part can bound."""
DIRECTED = {name for names in KINDS.values() for name in names} | {"nadir_is_seen", "magnetic_field_is_new"}
"""Readings from which attitudes are computed anew."""
SMALL, MOST, SHARE = 1e-9, 100_000, 0.3
"""The share of an error below which an estimate has forgotten it; the most cycles, from one new attitude to the next, that
this may take; and about the share that is left after `ago`."""


class Told(NamedTuple):
    """Bounds of the errors of the measured attitude (rad) and rate (rad/s): steady ones, and in proportion to the body's
    rate and acceleration. Every `ago` (s), what a faster motion added decays to a share `kept`."""

    attitude: float = 0.0
    rate: float = 0.0
    attitude_per_rate: float = 0.0
    attitude_per_acceleration: float = 0.0
    rate_per_rate: float = 0.0
    rate_per_acceleration: float = 0.0
    ago: float = 0.0
    kept: float = 0.0

    @property
    def grows(self) -> bool:
        """Whether the errors grow with the motion."""
        return any(self[2:6])

    def __add__(self, other: Any) -> Told:
        pairs = [*zip(self, other, strict=True)]
        return Told(*(x + y for x, y in pairs[:6]), *(max(pair) for pair in pairs[6:]))


class Measured(NamedTuple):
    """The errors of an estimate, or of noisy readings that the law uses directly: besides noise, and as noise drives them;
    the parts that they come from, and whether there is noise; by how much this is wider than the noise of the parts, and how
    many Gaussian vectors count in the errors besides."""

    amiss: Told
    recursion: Recursion
    parts: tuple[Fitted, ...]
    random: bool
    wider: float = 1.0
    gaussian: int = 0


class Driven(NamedTuple):
    """Noise-driven errors, and the parts with the noise; the deviation of a random torque about each axis (N m)."""

    recursion: Recursion
    parts: tuple[Fitted, ...]
    torque: float = 0.0


def driven_errors(loop: ClosedLoop) -> Driven | None:
    """Return the errors that noise drives in a loop: those of its law's inputs, zero where its parts do not declare them,
    and random external torques. None without either, and where the target depends on the law's mode."""
    if loop.target.part.flag("BY_MODE"):
        return None
    result = measured(loop)
    torques = [fitted for fitted in loop.used("environment") if noise_of(fitted, loop.period).torque]
    if result is not None and result.random:
        driven = Driven(result.recursion, (*result.parts, *torques))
    elif torques:
        driven = Driven(_as_read(Noise()), tuple(torques))
    else:
        return None
    wider = 1.0 if result is None else result.wider
    return driven._replace(torque=wider * hypot(*(noise_of(fitted, loop.period).torque for fitted in torques)))


def measured(loop: ClosedLoop) -> Measured | None:
    """Return the errors of an estimate, or of readings that the law uses directly and of which some are noisy; None where
    parts do not fully declare them, where an estimator does not forget them, and where sensors of one quantity are not read
    together."""
    if loop.target.part.flag("BY_MODE"):
        return None
    estimators = loop.used("estimator")
    by_directions = bool(estimators) and is_directed(estimators[0])
    fix = directed(loop, estimators[0]) if by_directions else None
    if by_directions and (fix is None or len(estimators) > 1):
        return None
    wanted = {name for f in estimators for name in f.needs} or {"attitude", "rate"}
    # What else an estimator reads has errors of which its recursion is not told.
    if estimators and wanted - (DIRECTED if by_directions else {"attitude"}) - {"rate", "attitude_is_new"}:
        return None
    wanted = {"rate"} if by_directions else wanted
    sensors = tuple(f for f in loop.used("sensor") if wanted & shown(f))
    bounds = [bounded(f, loop.period, bool(estimators)) for f in sensors]
    if not sensors or None in bounds or any(f.part.hook("noise") is None for f in sensors):
        return None
    several = getattr(estimators[0].part.module, "SEVERAL", ()) if estimators else ()
    attitudes, rates = (
        [(noise_of(f, loop.period), bound) for f, bound in zip(sensors, bounds, strict=True) if name in shown(f)]
        for name in ("attitude", "rate")
    )
    wider, gaussian = 1.0, sum(bound.gaussian for bound in bounds if bound is not None)
    if fix is not None:
        attitudes, wider, gaussian = [(fix.noise, fix.errors)], WIDER, gaussian + fix.gaussian
        sensors = (*sensors, *(f for f in fix.sensors if f not in sensors))
    every = {noise.every for noise, _ in attitudes}
    if len(rates) > 1 or len(every) > 1 or (len(attitudes) > 1 and "attitude" not in several):
        return None
    noise = Noise()
    for first, _ in attitudes[:1]:
        others = tuple(other.attitude for other, _ in attitudes[1:])
        noise = noise._replace(attitude=first.attitude, every=first.every, more=others)
    for reading, _ in rates:
        noise = noise._replace(rate=reading.rate, walk=reading.walk)
    random = is_random(noise, NO_ERRORS._replace(gaussian=gaussian))
    if wider > 1.0:
        wide = diagonal((wider, wider, wider))
        noise = noise._replace(attitude=multiply(wide, noise.attitude), rate=wider * noise.rate)
    if not estimators:
        amiss = reduce(Told.__add__, (as_read(bound) for bound in bounds if bound is not None))
        return Measured(amiss, _as_read(noise), sensors, True, 1.0, gaussian) if random and not noise.walk else None
    tell: Any = estimators[0].part.hook("recursion")
    if tell is None:
        return None
    given = estimators[0].params, loop.period, _rate(loop)
    recursion: Recursion | None = tell(given[0], noise, *given[1:])
    if recursion is None:
        return None
    amiss = estimated(recursion, tell, given, noise, [bound for _, bound in rates], [bound for _, bound in attitudes])
    return None if amiss is None else Measured(amiss, recursion, (*sensors, *estimators), random, wider, gaussian)


def bounded(fitted: Fitted, period: float, estimated: bool = False) -> Errors | None:
    """Read the declared largest errors of a part besides its noise, where they are finite, with those of an attitude that is
    held between updates, where no estimator waits for them. Errors of a position are not among them."""
    tell: Any = fitted.part.hook("error") if fitted.part.role in TELLING and not tells_place(fitted) else None
    largest: Errors = NO_ERRORS if tell is None else tell(fitted.params)
    if tell is None or not all(map(isfinite, largest)):
        return None
    between = 0.0 if estimated else (noise_of(fitted, period).every - 1) * period
    return largest._replace(turning=largest.turning + between, ago=largest.ago + between)


def as_read(errors: Errors) -> Told:
    """Return errors of readings that the law uses directly."""
    return Told(errors.attitude, errors.rate, errors.turning, 0.0, errors.turned, errors.late, errors.ago)


def noise_of(fitted: Fitted, period: float) -> Noise:
    """Return the noise of a part, by default none."""
    tell: Any = fitted.part.hook("noise")
    return Noise() if tell is None else tell(fitted.params, period)


def is_random(noise: Noise, errors: Errors | None = None) -> bool:
    """Return whether a reading has an unbounded error, or one that has a bound but for a share of times."""
    return any(leaves(noise._replace(every=0))) or (errors is not None and errors.gaussian > 0)


def tells_place(fitted: Fitted) -> bool:
    """Return whether a sensor or an estimator gives a position or velocity."""
    module: Any = fitted.part.module
    return not PLACED.isdisjoint((module.Reading if fitted.part.role == "sensor" else module.Estimate)._fields)


def estimated(
    recursion: Recursion, tell: Any, given: Any, noise: Noise, rates: list[Any], attitudes: list[Any]
) -> Told | None:
    """Return the errors of an estimate with errors of its readings besides noise; None where it does not forget them."""
    units = noise._replace(attitude=IDENTITY, rate=1.0, walk=0.0, more=(IDENTITY,) * len(noise.more))
    steady = [(gyro.rate - (0.0 if recursion.biased else gyro.bias), gyro.turned, gyro.late) for gyro in rates[:1]] or [
        (0.0, 0.0, 0.0)
    ]
    steady += [(tracker.attitude, tracker.turning, 0.0) for tracker in attitudes]
    if not recursion.lag and not any(map(any, steady)):
        return Told()
    gains = _gains(tell, given, units)
    if gains is None:
        return None
    towards, later, steps, kept = gains
    # The gains from each reading to the errors of attitude and rate.
    (attitude, turned, hurried), (rate, rated, late) = (
        [float(np.dot(one, sizes)) for sizes in zip(*steady, strict=True)] for one in towards
    )
    hurried, late = (x + more for x, more in zip((hurried, late), later, strict=True))
    ago = steps * given[1] + max(one.ago for one in (*rates, *attitudes))
    amiss = Told(attitude, rate, turned, hurried, rated, late, ago, kept)
    return amiss if amiss.grows else amiss._replace(ago=0.0, kept=0.0)


@cache
def _gains(tell: Any, given: Any, noise: Noise) -> tuple[list[list[float]], list[float], int, float] | None:
    """Return the largest errors of attitude and rate for unit errors of the gyro and of each attitude, and for a unit
    acceleration of the body; the number of steps after which about a share of an additional error is left, and that share.
    None for an estimate that does not forget. noise: of unit deviations."""
    recursion: Recursion = tell(given[0], noise, *given[1:])
    every, (radius, sizes) = recursion.every, _sizes(recursion)
    if not sizes:
        return None
    lags = np.max([np.cumsum(one[:, :-1, ::-1], axis=-1)[..., ::-1] for one in sizes], axis=0) * (1.0 + 1e-6)
    # From lags of k steps on: rows for attitude and rate, columns for readings.
    towards, later = lags[..., 0].tolist(), (recursion.lag * lags[:, 0, 1]).tolist()
    first = every * max(1, ceil(log(SHARE) / log(max(radius, SMALL))))
    while first < lags.shape[-1]:
        # Of the gyro's errors at earlier steps too, whose whole is less.
        wholes: Array = lags[..., 0].copy()
        wholes[:, 0] = lags[:, 0, 1]
        after: Array = lags[..., first::first] / np.maximum(wholes, 1e-300)[..., None]
        shares: Array = np.power(after, 1.0 / np.arange(1.0, after.shape[-1] + 1.0))
        kept = float(shares.max())
        if kept <= 2.0 * SHARE:
            return towards, later, first, kept
        first *= 2
    return towards, later, lags.shape[-1], SMALL


def strayed(recursion: Recursion) -> Array | None:
    """Return how far off the attitude is told at most at each later step (lags,), for each unit by which the body turns in a
    period otherwise than at the mean of two readings; None for an estimate that is propagated otherwise, or does not forget.
    """
    sizes = _sizes(recursion, False)[1] if recursion.strays else []
    return np.max([one[0, -1] for one in sizes], axis=0) if sizes else None


def _sizes(recursion: Recursion, read: bool = True) -> tuple[float, list[Array]]:
    """Return the share of an error that is left after a cycle, in the end, and the result of `_sums` for each step of a
    cycle, nothing for an estimate that does not forget."""
    steps: list[list[list[float]]] = [_matrix(step, recursion).tolist() for step in (recursion.carried, recursion.corrected)]
    rows = tuple(tuple(tuple(row) for row in step) for step in steps)
    return _sizes_of(recursion.every, 3 * recursion.size, rows, read)


@cache
def _sizes_of(every: int, size: int, matrices: tuple[Any, ...], read: bool) -> tuple[float, list[Array]]:
    carried, corrected = np.array(matrices[0]), np.array(matrices[1])
    steps = [*[carried] * (every - 1), corrected]
    motions = [step[:size, :size] for step in steps]
    radius = float(np.abs(np.linalg.eigvals(reduce(lambda one, A: A @ one, motions, np.eye(size)))).max())
    if radius >= 1.0 or (count := ceil(log(SMALL) / log(max(radius, SMALL)))) > MOST:
        return radius, []
    return radius, [_sums(steps, phase, count, size, read) for phase in range(every)]


def _sums(steps: list[Array], phase: int, count: int, size: int, read: bool) -> Array:
    """Return the sizes of the errors of attitude and rate, at a step of a cycle, due to each reading, and to a turn that the
    estimate leaves out, from 0 to so many cycles of steps before: (2, readings + 1, lags); not `read`: to such a turn alone,
    (2, 1, lags)."""
    every, readings = len(steps), (steps[0].shape[1] // 3 - size // 3 - 1) * read
    order = [steps[(phase + k) % every][:size, :size] for k in range(every)]
    motion, amiss = reduce(lambda one, A: A @ one, order, np.eye(size)), steps[phase][size:, :size]
    powers = np.array([amiss])
    while len(powers) < count:
        powers, motion = np.concatenate([powers, powers[: count - len(powers)] @ motion]), motion @ motion
    sizes = np.zeros((2, readings + 1, every * (len(powers) + 1)))
    # The gyro's, without its walk, and the attitudes', which are new at the last step of a cycle; a turn that is left out is
    # like one by which the attitude, the first of the errors, is off as the step begins.
    places = [*([0, *range(2, readings + 1)] if read else ()), -size // 3]
    since = np.eye(size)
    for lag in range(every + 1):
        at = (phase - lag) % every
        given = steps[at]
        for k, place in enumerate(places):
            if place > 0 and at != every - 1:
                continue
            column = slice(size + 3 * place, size + 3 * place + 3)
            if lag == 0:
                sizes[:, k, 0] = [np.linalg.norm(given[size + part : size + part + 3, column], 2) for part in (0, 3)]
                continue
            made = powers @ (since @ given[:size, column])
            for row, part in enumerate((0, 3)):
                # Faster than singular values.
                block = made[:, part : part + 3]
                squared = np.linalg.eigvalsh(block.transpose(0, 2, 1) @ block)[:, -1]
                sizes[row, k, lag::every][: len(made)] = np.sqrt(np.maximum(squared, 0.0))
        since = since @ steps[at][:size, :size] if lag else since
    return sizes


def _matrix(step: Callable[..., Any], recursion: Recursion) -> Array:
    """Return the matrix of a step of a recursion, from errors and noise to the errors at the next and those told."""

    def columns() -> Iterator[list[float]]:
        count = recursion.size + recursion.noises
        for unit in np.eye(3 * count):
            vectors = [tuple(unit[k : k + 3].tolist()) for k in range(0, 3 * count, 3)]
            yield flatten(step(tuple(vectors[: recursion.size]), tuple(vectors[recursion.size :])))

    return np.array(list(columns())).T


def _as_read(noise: Noise) -> Recursion:
    """Return the errors of readings that the law uses directly, of which attitudes are held between updates."""

    def between(errors: tuple[Vector, ...], random: tuple[Vector, ...]) -> tuple[tuple[Vector, ...], Vector, Vector]:
        return errors, errors[0], scale(noise.rate, random[0])

    def read(errors: tuple[Vector, ...], random: tuple[Vector, ...]) -> tuple[tuple[Vector, ...], Vector, Vector]:
        return between((apply(noise.attitude, random[2]),), random)

    return Recursion(read, between, noise.every, 1)


def _rate(loop: ClosedLoop) -> Vector:
    """Return the rate (rad/s) of a body on target as the loop starts, to six digits, on which all machines agree."""
    target = loop.target
    rate: Any = target.part.module.goal(target.prepared(loop.period), loop.start, 0, NO_TURN).rate
    x, y, z = (float(f"{part:.6g}") for part in rate)
    return x, y, z
