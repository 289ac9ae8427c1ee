"""What every station-keeping law must do, whatever it is for."""

import math

import numpy as np
import pytest
import sympy

from starhold.algebra.structure import flatten
from starhold.algebra.vector import ZERO
from starhold.laws.catalogue import catalogue
from starhold.laws.interface import NoMemory
from starhold.laws.point import PointMeasurement
from starhold.loop.kernels import fly_plainly
from starhold.parts.bodies.libration_point import PRIMARIES, PointState, make_libration
from starhold.simulation.lane import fly
from starhold.simulation.lanes import simulate_many
from tests.making import point_loop

EARTH = PRIMARIES["sun-earth"]
PLANT = make_libration(EARTH.larger, EARTH.smaller, EARTH.separation)
CASES = [(law, gains) for law in catalogue("libration-point").values() for gains in law.examples()]
every = pytest.mark.parametrize(("law", "gains"), CASES, ids=lambda value: getattr(value, "name", ""))


def loop_of(law, gains, **changes):
    start = PointState((0.01, 0.9, 0.1), (0.1, 0.0, 1.3), ZERO)
    return point_loop(PLANT, law, gains, start, 1e-3, limit=4.0, **changes)


@every
def test_examples_are_within_their_bounds(law, gains):
    for item, value in zip(law.fields(), gains, strict=True):
        given = item.gain.choices[value] if item.gain.choices else value
        assert item.gain.check(given) == value


@every
@pytest.mark.parametrize("model", ["linear", "nonlinear"])
@pytest.mark.parametrize("lag", [0.0, 0.0086])
def test_plain_python_one_lane_and_many_agree_bit_for_bit(law, gains, model, lag):
    loop = loop_of(law, gains, model=model, lag=lag)
    alone = fly(loop, 5)[1]
    batch = simulate_many(loop, [loop.start] * 3, 5)
    assert flatten(alone) == flatten(fly_plainly(loop, 5))
    for lane in range(3):
        assert tuple(batch.states[:, lane].tolist()) == tuple(flatten(alone.state))


@every
def test_is_finite(law, gains):
    random = np.random.default_rng(1)
    for _ in range(200):
        x, v = random.normal(size=(2, 3)) * 10.0 ** random.uniform(-9.0, 1.0)
        measurement = PointMeasurement(tuple(x.tolist()), tuple(v.tolist()), 1e-3, 4.0)
        assert all(map(math.isfinite, law.command(measurement, gains, PLANT, NoMemory())[0]))


@every
def test_is_read_by_sympy(law, gains):
    x, v = sympy.symbols("x1:4", real=True), sympy.symbols("v1:4", real=True)
    found = law.command(PointMeasurement(x, v, sympy.Symbol("T"), sympy.Integer(4)), gains, PLANT, NoMemory())[0]
    values = dict(zip((*x, *v), (0.01, 0.9, 0.1, 0.1, -0.2, 1.3), strict=True))
    numbers = [float(sympy.sympify(part).evalf(subs=values)) for part in found]
    measurement = PointMeasurement((0.01, 0.9, 0.1), (0.1, -0.2, 1.3), 1e-3, 4.0)
    np.testing.assert_allclose(numbers, law.command(measurement, gains, PLANT, NoMemory())[0], rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize(
    "law", [law for law in catalogue("libration-point").values() if law.forms], ids=lambda law: law.name
)
def test_forms_give_gains_and_say_where_they_cannot(law):
    for kind in law.forms.values():
        spec = kind(radius=1.0) if "radius" in kind._fields else kind()
        assert law.gains(*law.design(PLANT, spec)) is not None
        flat = PLANT._replace(stiffness=1.9)
        if "radius" in kind._fields:
            with pytest.raises(ValueError, match="no rate has a least demand"):
                law.design(flat, spec)
