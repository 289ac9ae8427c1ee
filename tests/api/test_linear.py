"""`sh.linearise` and `sh.margins`: systems of python-control, that agree in continuous time and sampled."""

import sys
from pathlib import Path

import control
import numpy as np
import pytest

import starhold as sh
from starhold.laws import pd


@pytest.mark.parametrize("delay", [0.0, 0.07])
def test_continuous_and_sampled_agree_where_sampling_is_fast(delay):
    linear = sh.linearise("cubesat-slew", "pd", delay)
    assert isinstance(linear.loop, control.StateSpace)
    assert linear.plant.dt == 0
    assert linear.sampled.plant.dt == 0.1
    assert linear.plant.input_labels[:4] == ["command_x", "command_y", "command_z", "disturbance_x"]
    assert linear.law.input_labels[:6] == linear.plant.state_labels[:6]
    for frequency in (0.01, 0.1, 0.3):
        # A command that is held comes half a period later on the average.
        held = np.exp(-0.05j * frequency)
        slow = linear.loop(1j * frequency) * held
        np.testing.assert_allclose(linear.sampled.loop(np.exp(0.1j * frequency)), slow, rtol=2e-4, atol=1e-6)
        late, prompt = (
            np.diag(found.plant(1j * frequency)[:3, :3]) for found in (linear, sh.linearise("cubesat-slew", "pd"))
        )
        np.testing.assert_allclose(late, prompt * np.exp(-1j * delay * frequency), rtol=1e-9)


def test_closed_is_the_loop_closed():
    linear = sh.linearise("cubesat-slew", "pd", 0.05)
    for parts in (linear, linear.sampled):
        shut = control.feedback(parts.loop, np.eye(3))
        np.testing.assert_allclose(np.poly(shut.poles()), np.poly(parts.closed.poles()), rtol=1e-6, atol=1e-9)
    assert linear.left_out == ("sensor gaussian",)


def test_a_law_that_leaves_an_axis_alone_has_margins_about_the_others(tmp_path):
    """Gain 0 has no logarithm: neither an error nor a warning comes of it."""
    text = (Path(pd.__file__).read_text()).replace(
        "subtract(tracking_torque(measurement, craft), feedback), memory",
        "(-feedback[0], -feedback[1], 0.0 * feedback[2]), memory",
    )
    (tmp_path / "two_axes.py").write_text(text)
    body = {"name": "axes", "spacecraft": {"inertia": [2, 3, 4]}, "initial": {"attitude": [1, 0, 0, 0]}}
    law = {"file": "two_axes.py", "k_rate": 0.3, "k_attitude": 0.1}
    whole = sh.scenario({**body, "simulation": {"duration": 1.0}, "law": [law]}, tmp_path)
    with pytest.warns(UserWarning, match="magnitude 1, so the loop is not stable and has no margins"):
        found = sh.margins(whole)
    assert np.isnan(found[2].crossover)
    assert found[0].crossover > found[1].crossover > 0.0


def test_margins_of_an_unstable_loop_are_nan_with_a_reason():
    with pytest.warns(
        UserWarning, match=r"law sliding: a pole of the sampled linear loop has magnitude 1\.\d+, so the loop is not"
    ):
        found = sh.margins("cubesat-slew", "sliding", 0.25)
    assert all(np.isnan(about.gain) for about in found)


@pytest.mark.parametrize(
    ("scenario", "law", "why"),
    [
        ("three-laws", "mpc", "law mpc: found the law mpc iterates"),
        ("three-laws", "sliding", "has no derivative at rest on target"),
        ("l2-circle", None, "rigid-body"),
        ("three-laws", "none", "none"),
    ],
)
def test_what_cannot_be_linearised_is_told(scenario, law, why):
    with pytest.raises(sh.InputError, match=why):
        sh.margins(scenario, law)
    with pytest.raises(sh.InputError, match=why):
        sh.linearise(scenario, law)


def test_without_python_control_margins_are_still_found(monkeypatch):
    monkeypatch.setitem(sys.modules, "control", None)
    with pytest.raises(sh.InputError, match=r"need control: pip install 'starhold\[interop\]'"):
        sh.linearise("cubesat-slew", "pd")
    assert len(sh.margins("cubesat-slew", "pd")) == 3
