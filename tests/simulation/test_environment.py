"""Scenarios as environments of Gymnasium, by the checks that Gymnasium has for them."""

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import starhold as sh
from tests.refusals import refused

SHORT = sh.load("three-laws-noise").with_({"simulation.duration": 2.0})


@pytest.mark.filterwarnings("ignore:.*(minimum|maximum) value.*infinity")
@pytest.mark.parametrize("reward", [None, lambda readings, command: -float(np.abs(command).sum())])
def test_gymnasium_accepts_it(reward):
    check_env(sh.environment(SHORT, reward=reward), skip_render_check=True)


def test_an_episode_is_a_flight():
    env = sh.environment(SHORT)
    seen, _ = env.reset(seed=4)
    flight = sh.stepper(SHORT, record=False)
    flight.reset(seed=env.flight.seed)
    rewards, ended = [], False
    while not ended:
        action = np.array([1e-3, -2e-3, 0.0])
        seen, reward, diverged, ended, _ = env.step(action)
        assert np.array_equal(seen, flight.step(action).numbers)
        rewards.append(reward)
        assert not diverged
    assert len(rewards) == 20
    error = env.flight.step().measurement.attitude[0]
    assert rewards[-1] == pytest.approx(-2.0 * np.arccos(abs(error)), abs=0.02)
    # Another seed draws other noise, the same one the same.
    assert not np.array_equal(env.reset(seed=5)[0], env.reset(seed=4)[0])
    assert np.array_equal(env.reset(seed=4)[0], env.reset(seed=4)[0])


def test_lanes_are_an_environment_of_many():
    envs = sh.environment(SHORT, lanes=5)
    assert isinstance(envs, gymnasium.vector.VectorEnv)
    seen, _ = envs.reset(seed=4)
    assert seen in envs.observation_space
    assert len(np.unique(seen[:, 4])) == 5
    for step in range(20):
        seen, reward, diverged, ended, _ = envs.step(envs.action_space.sample())
        assert seen in envs.observation_space
        assert reward.shape == diverged.shape == ended.shape == (5,)
        assert not diverged.any()
        assert ended.all() == (step == 19)


def test_what_is_no_environment_is_refused():
    with refused("a body without an attitude"):
        sh.environment("l2-circle")
    with refused("did you mean"):
        sh.environment(SHORT, law="slidng")
