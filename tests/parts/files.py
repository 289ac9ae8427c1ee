"""Parts of every role as the text of one file each, and a scenario that takes them."""

import re
from pathlib import Path

from tests.texts import toml

HEAD = '''"""A part."""

from typing import Annotated, NamedTuple

from starhold.algebra.quantity import Quantity
from starhold.algebra.vector import ZERO, add, dot, scale
from starhold.parts.contract import Card, Parameter

CARD = Card(title="Mine", summary="a part", sources=("mine",), assumptions=())
'''
PAGE = (Path(__file__).parents[2] / "docs" / "part-authors.md").read_text(encoding="utf-8")
FILES = dict(re.findall(r"`(\w+\.(?:py|toml))`:\n\n```\w+\n(.*?)```", PAGE, flags=re.DOTALL))
"""The files that the page for authors of parts shows."""
EFFECTOR, ACTUATOR = FILES["flexible_panel.py"], FILES["dead_zone.py"]
ENVIRONMENT = f'''{HEAD}ROLE = "environment"


class Params(NamedTuple):
    """How strongly a medium slows the rotation."""

    drag: Annotated[float, Parameter("N m s", at_least=0.0, text="torque for a radian a second")]


def torque(state, params, craft, memory):
    return scale(-params.drag, state.rate)


def examples():
    return [Params(1e-3)]
'''
SENSOR = f'''{HEAD}ROLE = "sensor"


class Params(NamedTuple):
    """How the rate is told."""

    noise: Annotated[float, Parameter("rad/s", at_least=0.0, text="standard deviation")]
    bias: Annotated[tuple, Parameter("rad/s", shape=(3,), text="added to the rate")] = ZERO


class Reading(NamedTuple):
    """The rate."""

    rate: Annotated[tuple, Quantity("rad/s", "measured rate, body axes", "axis")]


def measure(state, memory, params, dice, step):
    return Reading(add(add(state.rate, params.bias), dice.vector(0, params.noise))), memory


def examples():
    return [Params(1e-4)]
'''
ESTIMATOR = f'''{HEAD}ROLE = "estimator"
NEEDS = ("rate",)


class Params(NamedTuple):
    """How far the estimate goes to a reading."""

    share: Annotated[float, Parameter("1", above=0.0, at_most=1.0, text="of the difference, at each control step")]


class Estimate(NamedTuple):
    """The smoothed rate."""

    rate: Annotated[tuple, Quantity("rad/s", "smoothed rate, body axes", "axis")]


def remember(params, state):
    return state.rate


def estimate(readings, memory, params, craft, period):
    rate = add(scale(1.0 - params.share, memory), scale(params.share, readings.rate))
    return Estimate(rate), rate


def examples():
    return [Params(0.5)]
'''
TARGET = f'''{HEAD}from starhold.parts.roles import Goal

ROLE = "target"


class Params(NamedTuple):
    """Which attitude."""

    attitude: Annotated[tuple, Parameter("1", shape=(4,), spread=False, text="unit quaternion")] = (0.6, 0.8, 0.0, 0.0)


def goal(params, state, step, before):
    return Goal(params.attitude, ZERO, ZERO)


def examples():
    return [Params()]
'''
LAW = '''"""A law that does nothing or little."""

from typing import Annotated, NamedTuple

from starhold.algebra.vector import add, scale
from starhold.laws.interface import Card, Gain

CARD = Card(title="Slow", summary="u = -k w - p q", sources=("mine",), assumptions=(), claims="none")


class Gains(NamedTuple):
    k: Annotated[float, Gain("N m s", at_least=0.0, text="damping")] = 0.0
    p: Annotated[float, Gain("N m", at_least=0.0, text="stiffness")] = 0.0


def torque(measurement, gains, craft, memory):
    return scale(-1.0, add(scale(gains.k, measurement.rate), scale(gains.p, measurement.attitude[1:]))), memory


def examples():
    return [Gains(0.09, 0.009)]
'''
JETS = f'''{HEAD}from starhold.algebra.scalar import less, where
from starhold.algebra.vector import Vector, clip_axes
from starhold.parts.contract import Push

ROLE = "effector"
ACTS = OUTSIDE = True


class Params(NamedTuple):
    """How strong it is."""

    most: Annotated[float, Parameter("N m", above=0.0, text="largest torque about each axis")]


class State(NamedTuple):
    """What it has given."""

    impulse: Vector


def remember(params):
    return State(ZERO)


def command(applied, params):
    return applied


def applied(state, command, body, params):
    return clip_axes(command, params.most)


def reaction(state, command, body, params):
    return applied(state, command, body, params)


def rates(state, command, body, acceleration, params):
    return State(command)


def momentum(state, params):
    return ZERO


def sure_torque(params, kind):
    return params.most


def bound(params, envelope):
    return Push(0.0)


def error(params, envelope):
    return Push(0.0)


def examples():
    return [Params(0.05)]
'''
"""An effector that takes the command, and gives it up to a limit."""
PARTS = {
    "effector": (EFFECTOR, "coupling = [0.5, 0.2, 0.9]\nfrequency = 2.0\n"),
    "environment": (ENVIRONMENT, 'drag = "1 mN m s"\n'),
    "sensor": (SENSOR, 'noise = "1e-4 rad/s"\nbias = 1e-4\n'),
    "estimator": (ESTIMATOR, "share = 0.5\n"),
    "target": (TARGET, ""),
    "actuator": (ACTUATOR, 'width = "30 mN m"\n'),
}
"""For each role but the law's a part's text and its keys in a scenario."""
BODY = toml("""
name = "own"
[spacecraft] inertia = [[8.0, 0.2, 0.1], [0.2, 9.0, 0.3], [0.1, 0.3, 7.0]]; torque_limit = 0.05
[initial] angles = ["40 deg", 0, 0]; rate = [0.02, -0.03, 0.01]
[simulation] duration = 10.0; control_period = 0.1
""")
POINT = 'name = "own"\n[libration]\n[initial]\nposition = [0.0, 0.5, 0.1]\n[simulation]\nduration = 1.0\n'
PD = '[[law]]\ntype = "pd"\nk_rate = 0.9\nk_attitude = 0.09\n'


def part(text):
    """A [[part]] table with these lines."""
    return f"[[part]]\n{text}"
