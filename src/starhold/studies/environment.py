"""A scenario as a Gymnasium environment: observations are the readings of flight software, actions its commands."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from starhold.errors import InputError
from starhold.simulation.stepper import Readings, Stepper
from starhold.studies import compare as studies

if TYPE_CHECKING:
    from starhold.scenario.reading import Scenario

Array = NDArray[np.float64]
Reward = Callable[[Readings, Array], Any]
"""The reward of a control period, from the readings at its end and the command (3,) or (lanes, 3), in the body's unit."""


def error_angle(readings: Readings, command: Array) -> Any:
    """Return minus the angle to the target (rad), as measured or estimated."""
    # Noise in its components may make a quaternion longer than 1.
    return -2.0 * np.arccos(np.minimum(np.abs(readings.measurement.attitude[0]), 1.0))


class _Plant:
    """Flights of a scenario over its duration, and their observation and action spaces."""

    def __init__(self, scenario: Scenario, law: str | None, reward: Reward | None, lanes: int | None) -> None:
        loop = studies.build(scenario, scenario.pick(law))
        if reward is None and not loop.aims:
            raise InputError(scenario.where, "", "a body without an attitude", "reward = a function")
        limit = min(loop.saturation_limit(), getattr(loop.known, "torque_limit", math.inf))
        if not math.isfinite(limit):
            raise InputError(scenario.where, "", "a command without a limit", "a limit, which bounds actions")
        self.flight = Stepper(loop, lanes, record=False)
        self.steps, self.reward = scenario.table.simulation.steps, reward or error_angle
        self.actions = Box(-limit, limit, (3,), np.float64)
        self.observations = Box(-math.inf, math.inf, (self.flight.size,), np.float64)

    def begin(self, generator: np.random.Generator) -> tuple[Array, dict[str, Any]]:
        """Return the first observation of new flights with other random numbers, and further information."""
        return self.flight.reset(seed=int(generator.integers(1 << 31))).numbers.T, {}

    def fly(self, action: Any) -> tuple[Array, Any, Any, bool, dict[str, Any]]:
        """Return the observation, the reward, whether the motion diverged, whether the time is over, and further
        information."""
        command = np.asarray(action, dtype=float)
        readings = self.flight.step(command)
        ended = self.flight.steps >= self.steps
        return readings.numbers.T, self.reward(readings, command), self.flight.diverged, ended, {}


class Environment(gymnasium.Env[Array, Array]):
    """One flight; terminated where its motion diverges, truncated at the end of the scenario's duration."""

    def __init__(self, scenario: Scenario, law: str | None = None, reward: Reward | None = None) -> None:
        self._plant = _Plant(scenario, law, reward, None)
        self.action_space, self.observation_space = self._plant.actions, self._plant.observations

    @property
    def flight(self) -> Stepper:
        """The stepper of the flight, with the true state."""
        return self._plant.flight

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Array, dict[str, Any]]:
        """Begin a flight with random numbers from the seed; return the observation and further information."""
        super().reset(seed=seed)
        return self._plant.begin(self.np_random)

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Fly one control period with a command; return observation, reward, terminated, truncated, information."""
        seen, reward, diverged, ended, more = self._plant.fly(action)
        return seen, float(reward), bool(diverged), ended, more


class Environments(VectorEnv[Array, Array, Any]):
    """A batch of flights that begin and end together; none restarts automatically."""

    def __init__(self, scenario: Scenario, lanes: int, law: str | None = None, reward: Reward | None = None) -> None:
        self._plant, self.num_envs = _Plant(scenario, law, reward, lanes), lanes
        self.metadata = {"autoreset_mode": AutoresetMode.DISABLED}
        self.single_action_space, self.single_observation_space = self._plant.actions, self._plant.observations
        self.action_space = batch_space(self.single_action_space, lanes)
        self.observation_space = batch_space(self.single_observation_space, lanes)

    def reset(self, *, seed: Any = None, options: dict[str, Any] | None = None) -> tuple[Array, dict[str, Any]]:
        """Begin all flights with random numbers from the seed."""
        super().reset(seed=seed)
        return self._plant.begin(self.np_random)

    def step(self, actions: Array) -> tuple[Array, Any, Any, Any, dict[str, Any]]:
        """Fly one control period of each flight."""
        seen, reward, diverged, ended, more = self._plant.fly(actions)
        return seen, np.asarray(reward, dtype=float), diverged, np.full(self.num_envs, ended), more
