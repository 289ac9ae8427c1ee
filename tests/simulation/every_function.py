"""A law that uses every elementary function, and the time."""

from typing import Annotated, NamedTuple

from starhold.algebra.elementary import atan2, cbrt, cos, exp, log, power, sin, tanh
from starhold.algebra.quaternion import vector_part
from starhold.algebra.rotation import modified_rodrigues
from starhold.algebra.scalar import absolute, sign
from starhold.algebra.vector import ZERO, add, scale
from starhold.laws.interface import Card, Gain

CARD = Card(title="Every function", summary="u", sources=("a test",), assumptions=(), claims="none")
READS = ("time",)


class Gains(NamedTuple):
    k: Annotated[float, Gain("N m", above=0.0, text="of all")]
    wave: Annotated[float, Gain("s", above=0.0, text="of the changes")] = 3.0


def torque(measurement, gains, craft, memory):
    phase = measurement.time / gains.wave
    grown = log(1.0 + exp(0.1 * sin(phase)) + cos(phase) * cos(phase))
    angle = atan2(measurement.attitude[1], measurement.attitude[0])
    damping = tuple(tanh(20.0 * w) + sign(w) * power(absolute(w), 0.75) for w in measurement.rate)
    roots = tuple(cbrt(x) for x in vector_part(measurement.attitude))
    stiff = add(scale(0.1 * grown, roots), modified_rodrigues(measurement.attitude, 1.0 + 0.1 * angle))
    return scale(-gains.k, add(damping, add(stiff, ZERO))), memory


def examples():
    return [Gains(0.05)]
