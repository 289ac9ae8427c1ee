"""Every equation of the algebra means the same to all readers; each operation that they are made of is tried by itself in
`trace/test_operations.py`."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from starhold.algebra import cosines, quaternion, scalar, vector
from tests.algebra.readers import agree, anything, matrices, numbers, positives, quaternions, same, vectors

SCALARS = {
    (numbers,): (scalar.absolute, scalar.sign, scalar.side, scalar.is_finite),
    (numbers, numbers): (scalar.minimum, scalar.maximum, scalar.clip),
}
EQUATIONS = SCALARS | {
    (vectors,): (vector.norm, vector.signs, vector.skew, vector.diagonal),
    (vectors, vectors): (vector.add, vector.subtract, vector.times, vector.dot, vector.cross, vector.gyroscopic_torque),
    (numbers, vectors): (vector.scale,),
    (vectors, positives): (vector.clip_axes, vector.clip_norm),
    (vectors.filter(any),): (vector.unit,),
    (matrices,): (vector.transpose, vector.determinant),
    (matrices, vectors): (vector.apply, vector.gyroscopic_torque, vector.column),
    (matrices, matrices): (vector.multiply,),
    (numbers, matrices, numbers, matrices): (vector.combine,),
    (quaternions,): (quaternion.conjugate, quaternion.normalise, quaternion.renormalise, quaternion.vector_part),
    # Squares of less vanish.
    (quaternions.filter(lambda q: all(x == 0.0 or abs(x) > 1e-150 for x in q)),): (quaternion.half_angle_sine,),
    (quaternions, quaternions): (quaternion.multiply, quaternion.relative, quaternion.nearer),
    (quaternions, vectors): (quaternion.to_body, quaternion.to_reference, quaternion.derivative),
    (numbers, quaternions): (quaternion.stretch,),
    (quaternions.map(cosines.from_quaternion),): (cosines.to_quaternion,),
}
"""Equations by the arguments that they are given."""


@pytest.mark.parametrize("given_to", EQUATIONS, ids=lambda kinds: ", ".join(one.__name__ for one in EQUATIONS[kinds]))
@settings(max_examples=12)
@given(data=st.data())
def test_every_reader_gives_the_same(given_to, data):
    arguments = [data.draw(kind) for kind in given_to]
    for equation in EQUATIONS[given_to]:
        agree(equation, *arguments)


@given(anything, anything)
def test_compiled_scalars_equal_floats_for_any_float(x, y):
    for kinds, equations in SCALARS.items():
        for equation in equations:
            same(equation, *(x, y)[: len(kinds)])
