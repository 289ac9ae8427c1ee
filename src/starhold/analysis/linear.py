"""The linear loop near rest on target: matrices of plant, law and both, derived from the equations that fly."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.dual import Dual, differentiate, variables
from starhold.algebra.exponential import exponential
from starhold.algebra.quaternion import NO_TURN, relative, to_body
from starhold.algebra.structure import buffers, flatten, mapped
from starhold.algebra.vector import ZERO
from starhold.loop.closed_loop import Carry, ClosedLoop, Setup
from starhold.loop.kernels import make_step
from starhold.loop.step import Step
from starhold.parts.catalogue import fit
from starhold.parts.contract import IS_VALID

Array = NDArray[np.float64]
AXES = "xyz"
ERROR = tuple(f"{name}_{axis}" for name in ("theta", "rate") for axis in AXES)
"""The first states of every plant: the error's rotation vector (rad), twice the quaternion's vector part, and the rate
relative to the target (rad/s), body axes."""
COMMAND = tuple(f"command_{axis}" for axis in AXES)
DISTURBANCE = tuple(f"disturbance_{axis}" for axis in AXES)
MOST_HELD = 1000
"""The longest delay in control periods."""
CALLS, SOLVED = 30, 10
"""Calls of the law at rest in which its memory settles, and linear solutions for numbers that still change."""
LONG = 2**40
"""The number of calls after which transients must have decayed."""
SETTLED = 1e-9
"""A number has settled once a call changes it by less than this share of its largest change."""


class LinearityError(ValueError):
    """A loop has no linear form near rest on target; the message says why."""


class System(NamedTuple):
    """The system x' = A x + B u, y = C x + D u, or for a step of `period` (s) x+ = A x + B u; period 0 for continuous time.
    The names of states, inputs and outputs are in order."""

    A: Array
    B: Array
    C: Array
    D: Array
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    period: float = 0.0

    def at(self, points: Array) -> Array:
        """Return the transfer matrices (n, outputs, inputs) at complex points (n,): of s, or of z."""
        size = len(self.states)
        if not size:
            return np.broadcast_to(self.D, (len(points), *self.D.shape)).astype(complex)
        return self.C @ np.linalg.solve(points[:, None, None] * np.eye(size) - self.A, self.B.astype(complex)) + self.D

    def take(self, inputs: tuple[str, ...]) -> System:
        """Return the system with only these inputs."""
        places = [self.inputs.index(name) for name in inputs]
        return self._replace(B=self.B[:, places], D=self.D[:, places], inputs=inputs)


@dataclass(frozen=True)
class Linear:
    """A linear loop: the plant from command and disturbance (N m, body axes) to its states, the law from these to the
    command, in continuous time and as sampled.

    Continuous: `plant`, `law` (for a law with memory, its differences divided by the period). Sampled: `stepped`, exact for
    a command that is held for a period and acts `delay` (s) later, and for a held disturbance, and `stepped_law`.
    `left_out` names parts of the loop that the matrices omit."""

    plant: System
    law: System
    stepped: System
    stepped_law: System
    delay: float
    left_out: tuple[str, ...]

    @property
    def period(self) -> float:
        """The control period (s)."""
        return self.stepped.period

    @cached_property
    def stepped_loop(self) -> System:
        """The sampled loop, opened at the command: from a command to the negative of the law's response."""
        return in_series(self.stepped, self.stepped_law)

    @cached_property
    def stepped_closed(self) -> System:
        """The sampled closed loop, from the disturbance to the plant's states and the command."""
        return closed(self.stepped, self.stepped_law)

    @property
    def poles(self) -> Array:
        """The eigenvalues of the sampled closed loop, the largest first."""
        roots: Any = np.linalg.eigvals(self.stepped_closed.A)
        return roots[np.lexsort((roots.imag, -np.round(np.abs(roots), 12)))]

    @property
    def is_stable(self) -> bool:
        """Whether all poles lie inside the unit circle, in floating point."""
        return bool(np.abs(self.poles).max() < 1.0)


def linearise(loop: ClosedLoop, delay: float = 0.0) -> Linear:
    """Return the linear loop near rest on target, with the target fixed at its initial attitude. delay: from the control
    instant until the command acts (s). Raise LinearityError if there is none."""
    if not 0.0 <= delay <= MOST_HELD * loop.period:
        raise LinearityError(f"a delay between 0 and {MOST_HELD} control periods is wanted, not {delay:g} s")
    if not loop.aims:
        raise LinearityError("the body has no attitude")
    for one in (loop.law, *(f.part for f in loop.used("effector") if f.part.flag("ACTS"))):
        # Without an estimator, `is_valid` is always 1.
        if others := [name for name in one.reads if name != IS_VALID]:
            readings = " and the ".join(name.replace("_", " ") for name in others)
            raise LinearityError(f"{one.name} also uses the {readings}, not attitude and rate alone")
    left_out: list[str] = []
    still = _at_rest(loop, left_out)
    try:
        with np.errstate(all="ignore"):
            plant, law = _matrices(still)
    except ArithmeticError:
        # This includes a division by zero.
        raise LinearityError(
            f"the law {loop.law.name}, or a part of the loop, has no derivative at rest on target"
        ) from None
    plant, law = _needed(plant, law)
    if len(law.states):
        difference = (law.A - np.eye(len(law.states))) / loop.period
        continuous = law._replace(A=difference, B=law.B / loop.period, period=0.0)
    else:
        continuous = law._replace(period=0.0)
    return Linear(plant, continuous, sampled(plant, loop.period, delay), law, delay, tuple(left_out))


def _at_rest(loop: ClosedLoop, left_out: list[str]) -> ClosedLoop:
    """Return the loop at rest on target, with inertial axes equal to the target's, so that the error is exactly zero;
    append the names of omitted parts to `left_out`."""
    counted = loop.law.counters(loop.law.remember(loop.gains, loop.known, loop.period))
    if counted is not None or buffers(loop.carry().memory):
        raise LinearityError(f"the law {loop.law.name} iterates, and has no derivative")
    for role in ("sensor", "estimator"):
        left_out += [f"{role} {fitted.called}" for fitted in loop.used(role)]
    gone = [f for f in loop.used("environment") if f.part.hook("torque") is not None and not f.part.flag("MODELLED")]
    gone += [f for f in loop.used("effector") if f.part.reads]
    rated = [f for f in loop.used("actuator") if f.part.name == "rate-limit"]
    left_out += [fitted.called for fitted in (*gone, *rated)]
    if loop.events:
        left_out.append("what changes during the run")
    if not loop.target.part.flag("STILL"):
        left_out.append("the target's own turning")
    goal = loop.first_attitude()
    kept = loop.without("sensor", "estimator", "target", *(fitted.part.name for fitted in (*gone, *rated)))
    start = loop.start
    start = start._replace(
        attitude=NO_TURN,
        rate=ZERO,
        position=to_body(goal, start.position),
        velocity=to_body(goal, start.velocity),
        torque=ZERO,
    )
    parts = (*kept.parts, fit("target", "inertial", NO_TURN), fit("environment", "constant-torque", ZERO, 0))
    return replace(kept, parts=parts, start=start, limit="none", events=(), sign_policy="as_published")


def _settled(loop: ClosedLoop, step: Step, setup: Setup) -> Carry:
    """Return the carry with the law's memory after a long time at rest on target, after its start-up. Raise LinearityError
    if its memory does not settle."""
    carry = loop.carry()

    def called(numbers: Any) -> list[Any]:
        after = step.update(_with_memory(carry, numbers), 0, loop.seed, loop.gains, loop.craft, setup)
        return flatten((after.memory,))

    memory = np.array(flatten((carry.memory,)))
    most = np.zeros(len(memory))
    for turn in range(CALLS + SOLVED):
        change = np.subtract(called(memory.tolist()), memory)
        most = np.maximum(most, np.abs(change))
        if (np.abs(change) <= SETTLED * most).all():
            return _with_memory(carry, memory.tolist())
        if turn >= CALLS:
            slopes = differentiate(lambda: called(variables(memory.tolist(), 0, len(memory))), len(memory))  # noqa: B023
            if not (np.abs(np.linalg.matrix_power(slopes, LONG) @ change) <= SETTLED * most).all():
                break
            change = np.linalg.lstsq(np.eye(len(memory)) - slopes, change)[0]
        memory = memory + change
    raise LinearityError(f"the memory of the law {loop.law.name} does not settle at rest on target")


def _with_memory(carry: Carry, numbers: Any) -> Carry:
    """Return a carry in which the law's memory has these numbers."""
    given = iter(numbers)
    return carry._replace(memory=mapped(carry.memory, lambda _: next(given)))


def _matrices(loop: ClosedLoop) -> tuple[System, System]:
    """Return the plant in continuous time and the sampled law, with all states."""
    step, setup = make_step(loop.composition()), loop.setup()
    carry = _settled(loop, step, setup)
    lags = any(fitted.part.hook("rates") is not None for fitted in loop.used("actuator"))
    inner = flatten((carry.effectors, carry.actuators))
    more = [f"{f.called}_{k + 1}" for f, each in zip(loop.used("effector"), carry.effectors, strict=True)
            for k in range(len(flatten((each,))))]  # fmt: skip
    more += [f"actuator_{k + 1}_{axis}" for k in range(len(carry.actuators)) for axis in AXES]
    more += [f"torque_{axis}" for axis in AXES] * lags
    states = (*ERROR, *more)
    memory = flatten((carry.memory,))
    size = len(states)
    count = size + 6 + len(memory)
    x = variables([0.0] * 6 + inner + [0.0] * 3 * lags, 0, count)
    u, d = variables(ZERO, size, count), variables(ZERO, size + 3, count)
    numbers = iter(x[6:])
    effectors, outputs = (mapped(part, lambda _: next(numbers)) for part in (carry.effectors, carry.actuators))
    turn_parts: Any = [*NO_TURN[:1], *(0.5 * turn for turn in x[:3])]
    # The derivative of the quaternion's scalar part is zero at rest.
    attitude = (Dual(1.0, np.zeros(count)), *turn_parts[1:])
    torque = tuple(x[-3:]) if lags else tuple(u)
    state = carry.state._replace(attitude=attitude, rate=tuple(x[3:6]), torque=torque)
    pushed = setup.environments[-1]._replace(torque=tuple(d))
    setup = setup._replace(environments=(*setup.environments[:-1], pushed))
    now = carry._replace(state=state, effectors=effectors, actuators=outputs, command=tuple(u))
    now = _with_memory(now, variables(memory, size + 6, count))

    def moving() -> list[Any]:
        rates, of_effectors, driven = step.slope(now, loop.craft, setup)
        turning = relative(NO_TURN, rates[0])[1:]
        rates_of_error = [*(2.0 * part for part in turning), *rates[1], *_filled(of_effectors, carry.effectors)]
        return rates_of_error + _filled(driven, carry.actuators) + (list(rates[4]) if lags else [])

    def decided() -> list[Any]:
        after = step.update(now, 0, loop.seed, loop.gains, loop.known, setup)
        return [*after.command, *flatten((after.memory,))]

    by_all, answer = differentiate(moving, count), differentiate(decided, count)
    plant = System(
        by_all[:, :size], by_all[:, size : size + 6], np.eye(size), np.zeros((size, 6)),
        states, (*COMMAND, *DISTURBANCE), states,
    )  # fmt: skip
    known = tuple(f"memory_{k + 1}" for k in range(len(memory)))
    to_law = answer[:, :size]
    kept_by = answer[:, size + 6 :]
    law = System(kept_by[3:], to_law[3:], kept_by[:3], to_law[:3], known, states, COMMAND, loop.period)
    return plant, law


def _filled(rates: Any, states: Any) -> list[Any]:
    """Return the rates of states, 0 for parts without rates."""
    numbers: list[Any] = []
    for rate, state in zip(rates or (None,) * len(states), states, strict=True):
        values = flatten((state,))
        more = [0.0] * len(values) if rate is None else _flat(rate, state)
        numbers += more
    return numbers


def _flat(rate: Any, state: Any) -> list[Any]:
    if not isinstance(state, tuple):
        return [0.0 if rate is None else rate]
    if rate is None:
        return [0.0] * len(flatten(state))
    return [x for r, s in zip(rate, state, strict=True) for x in _flat(r, s)]


def _needed(plant: System, law: System) -> tuple[System, System]:
    """Return plant and law without irrelevant states: states of the plant on which nothing depends, such as the momenta of
    wheels without friction; memory on which the command does not depend; and states that never change, such as flags."""
    law = _remembered(law)
    feeds = plant.A != 0.0
    heard = (law.D != 0.0).any(axis=0) | (law.B != 0.0).any(axis=0)
    needed = np.array([name in ERROR for name in plant.states]) | heard
    while True:
        wider = needed | feeds[needed].any(axis=0)
        if (wider == needed).all():
            break
        needed = wider
    names = tuple(name for name, keep in zip(plant.states, needed, strict=True) if keep)
    reduced = plant._replace(
        A=plant.A[np.ix_(needed, needed)], B=plant.B[needed], C=np.eye(len(names)), D=plant.D[needed],
        states=names, outputs=names,
    )  # fmt: skip
    return reduced, law._replace(B=law.B[:, needed], D=law.D[:, needed], inputs=names)


def _remembered(law: System) -> System:
    """Return the law without memory on which its command does not depend, or that never changes."""
    size = len(law.states)
    constant = (np.eye(size) == law.A).all(axis=1) & (law.B == 0.0).all(axis=1)
    needed = (law.C != 0.0).any(axis=0)
    for _ in range(size):
        needed = needed | (law.A[needed] != 0.0).any(axis=0)
    keep = needed & ~constant
    names = tuple(name for name, kept in zip(law.states, keep, strict=True) if kept)
    return law._replace(A=law.A[np.ix_(keep, keep)], B=law.B[keep], C=law.C[:, keep], states=names)


def sampled(plant: System, period: float, delay: float = 0.0) -> System:
    """Return the exact discretisation of a plant for a command that is held for a period and acts `delay` (s) later, and a
    held disturbance. Pending commands are states (Astrom and Wittenmark, Computer-Controlled Systems, 1997)."""
    size = len(plant.states)
    whole = int(np.floor(delay / period * (1.0 + 1e-12)))
    rest = max(0.0, delay - whole * period)
    split = rest > 1e-12 * period
    over, pushed = _under_hold(plant, period)
    command, others = slice(0, 3), slice(3, None)
    # Until `rest` the previous command acts, then the new one.
    late, new = _under_hold(plant, period - rest)[1][:, command], np.zeros((size, 3))
    if split:
        to_end = exponential(plant.A * (period - rest))
        new, late = late, to_end @ _under_hold(plant, rest)[1][:, command]
    waiting = whole + split
    names = tuple(f"{name}_{-k}_steps" for k in range(-waiting, 0) for name in COMMAND)
    total = size + 3 * waiting
    A, B = np.zeros((total, total)), np.zeros((total, len(plant.inputs)))
    A[:size, :size], B[:size, others] = over, pushed[:, others]
    if not waiting:
        B[:size, command] = late
    else:
        # The oldest command comes first; the newest is the input.
        A[:size, size : size + 3] = late
        if split and waiting > 1:
            A[:size, size + 3 : size + 6] = new
        elif split:
            B[:size, command] = new
        A[size : total - 3, size + 3 :] = np.eye(3 * (waiting - 1))
        B[total - 3 :, command] = np.eye(3)
    C = np.hstack([plant.C, np.zeros((len(plant.outputs), 3 * waiting))])
    return System(A, B, C, plant.D, (*plant.states, *names), plant.inputs, plant.outputs, period)


def _under_hold(plant: System, time: float) -> tuple[Array, Array]:
    """Return the matrices that map states and held inputs to the states after a time (s)."""
    size, inputs = plant.B.shape
    whole = np.zeros((size + inputs, size + inputs))
    whole[:size] = np.hstack([plant.A, plant.B])
    moved = exponential(whole * time)
    return moved[:size, :size], moved[:size, size:]


def in_series(plant: System, law: System) -> System:
    """Return the loop opened at the command: from a command to the negative of the law's response."""
    plant = plant.take(COMMAND)
    A = np.block([[plant.A, np.zeros((len(plant.states), len(law.states)))], [law.B @ plant.C, law.A]])
    B = np.vstack([plant.B, law.B @ plant.D])
    C, D = -np.hstack([law.D @ plant.C, law.C]), -law.D @ plant.D
    return System(A, B, C, D, (*plant.states, *law.states), COMMAND, COMMAND, plant.period)


def closed(plant: System, law: System) -> System:
    """Return the closed loop from the disturbance to the plant's outputs and the command."""
    act, push = plant.take(COMMAND), plant.take(DISTURBANCE)
    command = np.hstack([law.D @ plant.C, law.C])
    A = np.block([[plant.A, np.zeros((len(plant.states), len(law.states)))], [law.B @ plant.C, law.A]])
    A += np.vstack([act.B, np.zeros((len(law.states), 3))]) @ command
    B = np.vstack([push.B, np.zeros((len(law.states), 3))])
    C = np.vstack([np.hstack([plant.C, np.zeros((len(plant.outputs), len(law.states)))]), command])
    D = np.zeros((len(C), 3))
    return System(A, B, C, D, (*plant.states, *law.states), DISTURBANCE, (*plant.outputs, *COMMAND), plant.period)
