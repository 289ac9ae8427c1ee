"""Checks that targets move, and environments move orbits, as they say."""

from __future__ import annotations

from typing import Any, cast

import numpy as np

from starhold.algebra.quaternion import NO_TURN
from starhold.algebra.vector import ZERO, add, norm, scale, subtract
from starhold.certification.target_motion import motion_of
from starhold.conformance.bench import loop_with
from starhold.conformance.directions import turn_between
from starhold.conformance.verdicts import STEPS, require
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.contract import Motion
from starhold.parts.orbit import at_anomaly
from starhold.parts.part import Fitted, Part


def moves_as_it_says(part: Part) -> None:
    """Check a target's rate and acceleration at points of the orbit and instants of a year or of the time that it states,
    and that its attitude changes by them."""
    for params in part.examples():
        loop, random = loop_with(part, params), np.random.default_rng(3)
        motion = motion_of(loop)
        if motion is None:
            continue
        numbers, module, seen = Fitted(part, params).prepared(loop.period), cast(Any, part.module), NO_TURN
        last = min(motion.until, 3e7) / loop.period
        # Soon after the start motions may be brief.
        soon = np.geomspace(1.0, last, 10 * STEPS) if last > 1.0 else []
        for step in (*np.linspace(0.0, last, 10 * STEPS), *soon):
            state = loop.start
            if loop.has("two-body"):
                position, velocity = at_anomaly(state.position, state.velocity, loop.craft.gravity, 6.3 * random.uniform())
                state = state._replace(position=position, velocity=velocity)
            seen, *moved = module.goal(numbers, state, int(step), seen)
            for name, vector, most in zip(("rate", "acceleration"), moved, motion, strict=False):
                require(norm(vector) <= most * (1.0 + 1e-9), f"the {name} is {norm(vector):g}, larger than {most:g}")
            goals = [module.goal(numbers, _later(loop, state, n), int(step) + 1 + n, seen) for n in (-1, 0, 1)]
            _turns_as_it_tells(goals, motion, loop.period)


def _later(loop: ClosedLoop, state: Any, count: int) -> Any:
    """Return a state on an orbit a few control periods later."""
    if not loop.has("two-body"):
        return state
    pull, time = scale(-loop.craft.gravity / norm(state.position) ** 3, state.position), count * loop.period
    position = add(add(state.position, scale(time, state.velocity)), scale(0.5 * time * time, pull))
    return state._replace(position=position, velocity=add(state.velocity, scale(time, pull)))


def _turns_as_it_tells(goals: list[Any], motion: Motion, period: float) -> None:
    """Check the rate and the acceleration that a target tells against how its attitude and its rate change in two control
    periods. Where it jumps nothing is said."""
    (before, first, _), (_, now, slope), (after, last, _) = goals
    turn, change = (scale(0.5 / period, x) for x in (turn_between(before, after), subtract(last, first)))
    if motion.jumps and norm(turn) > motion.rate * 1.01:
        return
    # Accelerations may begin and end at once, by which rates differ from their means.
    hurried = max(norm(goal[2]) for goal in goals)
    amiss = norm(subtract(turn, now)), norm(subtract(change, slope))
    most = (
        motion.off_rate + 1.01 * period * hurried + 1e-3 * motion.rate + 1e-7,
        motion.off_acceleration + 2.01 * hurried + 1e-3 * motion.acceleration + 1e-6,
    )
    for name, off, bound in zip(("rate", "acceleration"), amiss, most, strict=True):
        require(off <= bound, f"the {name} that it tells is off by {off:g}, more than {bound:g}")


def pulls_as_it_says(part: Part) -> None:
    """Check an environment's acceleration and its gradient at places at least as far away as the orbit."""
    module, random = cast(Any, part.module), np.random.default_rng(6)
    for params in part.examples():
        loop = loop_with(part, params)
        numbers, least = Fitted(part, params).prepared(loop.period), norm(loop.start.position)
        memory, most = Fitted(part, params).remembered(numbers), module.perturbation(params, loop.craft, least)
        for drawn in random.normal(size=(10 * STEPS, 3)):
            # Near the least distance most often, and near axes and planes through two of them.
            away = drawn * random.choice([1e-3, 1.0], size=3)
            away *= least * (1.0 + 1e-4 + 0.5 * random.uniform() ** 4) / np.linalg.norm(away)
            around = [away, *(away + way for way in 1e-5 * least * np.array([*np.eye(3), *-np.eye(3)]))]
            states = (loop.start._replace(position=tuple(place.tolist())) for place in around)
            here, *there = (np.array(module.acceleration(s, numbers, loop.craft, memory) or ZERO) for s in states)
            gradient = np.subtract(there[:3], there[3:]) / (2e-5 * least)
            sizes = float(np.linalg.norm(here)), float(np.linalg.norm(gradient, 2))
            for name, size, bound in zip(("acceleration", "gradient of the acceleration"), sizes, most, strict=True):
                require(size <= bound * (1.0 + 1e-6), f"the {name} is {size:g}, larger than {bound:g}")
