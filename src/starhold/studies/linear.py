"""Linear loops of a scenario's laws, their margins, and their systems for python-control."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from starhold.analysis.linear import COMMAND, DISTURBANCE, Linear, LinearityError, System, closed, in_series, linearise
from starhold.analysis.margins import Margins, margins
from starhold.errors import InputError, optional
from starhold.scenario.building import build

if TYPE_CHECKING:
    from control import StateSpace

    from starhold.scenario.reading import LawEntry, Scenario

ORDER = 4
"""The order of the Pade approximant of a delay in continuous time."""


@dataclass(frozen=True)
class Systems:
    """The systems of a linear loop: `plant` from command and disturbance (N m, body axes) to its states, `law` from these to
    the command, `loop` from a command to the negative of the law's response, and `closed` from the disturbance to states and
    command. The first states are the error's rotation vector theta (rad) and the rate relative to the target (rad/s)."""

    plant: StateSpace
    law: StateSpace
    loop: StateSpace
    closed: StateSpace


@dataclass(frozen=True)
class LinearLoop(Systems):
    """A linear loop in continuous time, with an approximated delay, and `sampled`, exact at control instants; `left_out`
    names parts of the true loop that it lacks. `starhold.margins` computes its margins."""

    sampled: Systems
    delay: float
    left_out: tuple[str, ...]


def linear_of(scenario: Scenario, entry: LawEntry, delay: float = 0.0) -> Linear:
    """Return the linear loop of a law of a scenario. InputError where there is none."""
    try:
        return linearise(build(scenario, entry), delay)
    except LinearityError as error:
        raise InputError(scenario.where, f"law {entry.name}", str(error), "a loop that is linear near rest") from None


def margins_of(scenario: Scenario, entry: LawEntry, delay: float = 0.0) -> list[Margins]:
    """Return the margins of the linear loop of a law of a scenario; NaN, with a warning, where it is not stable. InputError
    where there is no linear loop."""
    linear = linear_of(scenario, entry, delay)
    if not linear.is_stable:
        why = f"a pole of the sampled linear loop has magnitude {abs(linear.poles[0]):.6g}, so the loop is not stable"
        warnings.warn(f"{scenario.where}: law {entry.name}: {why} and has no margins", stacklevel=3)
    return margins(linear)


def systems_of(linear: Linear) -> LinearLoop:
    """Return the linear loop as systems of python-control. InputError where that is not installed."""
    control = optional("control", "linearise", "interop")
    plant = _delayed(linear.plant, linear.delay, control)
    stepped = _systems(linear.stepped, linear.stepped_law, control)
    continuous = _systems(plant, linear.law, control)
    return LinearLoop(
        continuous.plant, continuous.law, continuous.loop, continuous.closed, stepped, linear.delay, linear.left_out
    )


def _systems(plant: System, law: System, control: Any) -> Systems:
    def made(system: System) -> Any:
        names = {"states": list(system.states)} if system.states else {}
        return control.ss(
            system.A,
            system.B,
            system.C,
            system.D,
            system.period,
            inputs=list(system.inputs),
            outputs=list(system.outputs),
            remove_useless_states=False,
            **names,
        )

    return Systems(made(plant), made(law), made(in_series(plant, law)), made(closed(plant, law)))


def _delayed(plant: System, delay: float, control: Any) -> System:
    """Return the plant in series with a Pade approximant of the delay of each command."""
    if delay == 0.0:
        return plant
    # Imported here, because loading takes half a second and is needed only with a delay.
    from scipy.signal import tf2ss

    a, b, c, d = (np.kron(np.eye(3), part) for part in tf2ss(*control.pade(delay, ORDER)))
    act, push = plant.take(COMMAND), plant.take(DISTURBANCE)
    size, more = len(plant.states), len(a)
    A = np.block([[plant.A, act.B @ c], [np.zeros((more, size)), a]])
    B = np.block([[act.B @ d, push.B], [b, np.zeros((more, 3))]])
    C = np.hstack([plant.C, np.zeros((len(plant.outputs), more))])
    names = tuple(f"delay_{k + 1}" for k in range(more))
    return System(A, B, C, plant.D, (*plant.states, *names), plant.inputs, plant.outputs)
