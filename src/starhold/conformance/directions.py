"""Checks what sensors say of their errors of directions, and estimators of the attitudes that they compute from these."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import islice
from math import asin, atan2
from types import SimpleNamespace
from typing import Any, cast

import numpy as np

from starhold.algebra.quaternion import Quaternion, conjugate, multiply, to_body, vector_part
from starhold.algebra.structure import unflatten
from starhold.algebra.vector import ZERO, Vector, add, cross, dot, norm, scale, unit
from starhold.conformance.bench import any_attitude, anywhere, moving
from starhold.conformance.verdicts import STEPS
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts import as_built, magnetic_field, sun
from starhold.parts.contract import Direction, Sky
from starhold.parts.epoch import START
from starhold.parts.part import Fitted, Part
from starhold.parts.random import Silent
from starhold.parts.vectors import KINDS

OFF = {"sun": 0.002, "field": 0.005, "nadir": 0.003}
"""The errors of directions from which estimators compute attitudes here."""
LATER = 720720
"""So many control steps are a multiple of all numbers of up to 16."""


def tells(part: Part) -> bool:
    """Return whether a part says its errors of directions, or of attitudes computed from these."""
    return part.hook({"sensor": "direction", "estimator": "combined"}.get(part.role, "")) is not None


def misdirected(part: Part, loop: ClosedLoop) -> Iterator[tuple[str, float, float]]:
    """Yield the errors of a part that tells them, with their bounds."""
    if tells(part):
        yield from _of_sensor(part, loop) if part.role == "sensor" else _of_estimator(part, loop)


def sky_at(params: Any, loop: ClosedLoop) -> Sky:
    """Return a loop's surroundings where it starts, for a sensor with these parameters."""
    strength, distance = inertial_directions(params, loop.start.position, 0.0)["strength"], norm(loop.start.position)
    steepest = magnetic_field.steepest(getattr(params, "epoch", START), distance)
    return Sky(strength, steepest / strength, distance, norm(loop.start.velocity))


def _of_sensor(part: Part, loop: ClosedLoop) -> Iterator[tuple[str, float, float]]:
    """Yield errors of the directions that a sensor measures without noise, and their bounds, at places as far away as the
    start, at first there."""
    fitted = next(f for f in loop.parts if f.part == part)
    module, random, numbers = part.module, np.random.default_rng(1), fitted.prepared(loop.period)
    memory, params = fitted.remembered(numbers, loop.start), fitted.params
    here = sky_at(params, loop)._replace(speed=0.0)
    said: Direction = module.direction(params, loop.period, here)
    states = moving(loop, random, said.late) if said.late else anywhere(loop, random)
    for count, (state, fast, _) in enumerate(islice(states, 4 * STEPS)):
        step = count
        if not said.late and count > STEPS:
            # Much later, too.
            step = count + LATER * (count // 8)
            state = state._replace(position=scale(here.distance, unit(_drawn(random))))
            weakest = norm(field_at(params, state.position, step * loop.period))
            said = module.direction(
                params, loop.period, here._replace(weakest=weakest, turning=here.turning * here.weakest / weakest)
            )
        reading, memory = module.measure(state, memory, numbers, Silent(), step)
        name, *flags = KINDS[said.of]
        seen = getattr(reading, name)
        if norm(seen) > 0.0 and all(
            getattr(reading, flag, 1.0) > 0.5 for flag in (*flags, f"{name}_is_new", f"{name}_is_seen")
        ):
            true = to_body(state.attitude, inertial_directions(params, state.position, step * loop.period)[said.of])
            off = atan2(norm(cross(seen, true)), dot(seen, true))
            yield "error of the direction", off, asin(min(said.error, 1.0)) + as_built.behind(said.late) * fast


def _of_estimator(part: Part, loop: ClosedLoop) -> Iterator[tuple[str, float, float]]:
    """Yield errors of the attitudes that an estimator computes from directions with errors, and their bound."""
    fitted = next(f for f in loop.parts if f.part == part)
    random = np.random.default_rng(1)
    given = part.module.combined(fitted.params, tuple(Direction(kind, OFF[kind]) for kind in kinds_of(fitted)))
    if given is None:
        return
    for _ in range(4 * STEPS):
        # Across the direction, as far as it may be.
        off = estimated_amid(fitted, loop, random, lambda kind, true: scale(OFF[kind], unit(cross(true, _drawn(random)))))
        if off is not None:
            yield "error of the attitude", norm(off), given[0].attitude


def scattered(fitted: Fitted, loop: ClosedLoop) -> Iterator[tuple[float, float]]:
    """Yield deviations of the attitude that an estimator computes from directions with small random errors, where these
    matter most of many places, and the deviation that it says."""
    given = fitted.part.module.combined(
        fitted.params, tuple(Direction(kind, 0.0, OFF[kind] / 20.0) for kind in kinds_of(fitted))
    )
    if given is None:
        return

    def sizes(place: int, count: int) -> list[float]:
        random, drawn = np.random.default_rng([2, place]), np.random.default_rng([3, place])
        places, lengths = random.bit_generator.state, list[float]()
        for _ in range(count):
            # The same place and attitude again.
            random.bit_generator.state = places
            off = estimated_amid(fitted, loop, random, lambda kind, _: scale(OFF[kind] / 20.0, _drawn(drawn)))
            lengths.append(0.0 if off is None else norm(off))
        return lengths

    worst = sorted(range(4 * STEPS), key=lambda place: -max(sizes(place, 2)))[:5]
    most = float(np.linalg.norm(np.array(given[1].attitude), 2))
    for place in worst:
        # A single component has at least a third of the square of the length.
        yield float(np.sqrt(np.mean(np.square(sizes(place, STEPS))) / 3.0)), most


def kinds_of(estimator: Fitted) -> list[str]:
    """Return the kinds of directions that an estimator reads."""
    module: Any = estimator.part.module
    return [kind for kind, (name, *_) in KINDS.items() if {name} & {*module.NEEDS, *getattr(module, "SEVERAL", ())}]


def estimated_amid(
    fitted: Fitted, loop: ClosedLoop, random: np.random.Generator, error_of: Callable[[str, Vector], Vector]
) -> Vector | None:
    """Return by how much the attitude that an estimator computes is off (rad, body axes), at random places and attitudes,
    with these errors of directions of a kind and of true ones; None where it computes none."""
    module, numbers = cast(Any, fitted.part.module), fitted.prepared(loop.period)
    position = scale(norm(loop.start.position), unit(_drawn(random)))
    attitude = any_attitude(random)
    there = inertial_directions(fitted.params, position, 0.0)
    shown: dict[str, Any] = {"position": position, "rate": ZERO, "sun_is_seen": 1.0, "nadir_is_seen": 1.0}
    for kind in kinds_of(fitted):
        true = to_body(attitude, there[kind])
        strength = there["strength"] if kind == "field" else 1.0
        shown[KINDS[kind][0]] = scale(strength, unit(add(true, error_of(kind, true))))
    memory = fitted.remembered(numbers, loop.start)
    estimate, _ = module.estimate(SimpleNamespace(**shown), memory, numbers, loop.craft, loop.period)
    return turn_between(attitude, estimate.attitude) if estimate.is_valid > 0.5 else None


def turn_between(attitude: Quaternion, other: Quaternion) -> Vector:
    """Return the rotation from an attitude to another one (body axes), of a length of twice the sine of half the angle."""
    turned = multiply(conjugate(attitude), other)
    return scale(2.0 if turned[0] >= 0.0 else -2.0, vector_part(turned))


def inertial_directions(params: Any, position: Vector, time: float) -> dict[str, Any]:
    """Return the unit vectors of Sun, field and nadir at a position (m) and a time (s), in inertial axes, and the field's
    strength (T)."""
    epoch = getattr(params, "epoch", START)
    field = field_at(params, position, time)
    toward = sun.sun(time, sun.prepared(epoch, getattr(params, "ephemeris", 0))).direction
    return {"sun": toward, "field": unit(field), "nadir": unit(scale(-1.0, position)), "strength": norm(field)}


def field_at(params: Any, position: Vector, time: float) -> Vector:
    """Return the magnetic field (T, inertial axes) at a position (m) and a time (s)."""
    return magnetic_field.field(position, time, magnetic_field.prepared(getattr(params, "epoch", START)))


def _drawn(random: np.random.Generator) -> Vector:
    return unflatten(random.normal(size=3), ZERO)
