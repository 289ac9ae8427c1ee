"""No claim against a torque from outside says more than was proved without being caught."""

import copy

import pytest

from starhold.checker import check, passed
from tests.certification.edits import alone, claims_of, edited

UP, DOWN = 1.0 + 1e-4, 1.0 - 1e-4
STRONGER = [
    ("lqr-III", "as_published", ("torque", "level", "start", "slew_angle", "rate_start"), UP),
    ("lqr-III", "as_published", ("torque", "angle", "rate"), DOWN),
    ("pd-0", "hysteresis", ("torque", "level", "start", "slew_angle", "rate_start", "rate_everywhere"), UP),
    ("pd-2", "shortest", ("torque", "level", "start", "slew_angle", "rate_start"), UP),
]


@pytest.mark.parametrize(("name", "sign_policy", "keys", "factor"), STRONGER)
def test_a_number_that_says_more_fails(made, name, sign_policy, keys, factor):
    content = alone(made(name, sign_policy), "disturbance")
    assert passed(check(content))
    for key in keys:
        value = claims_of(content)["disturbance"]["numbers"][key]
        assert value is not None, key
        assert not passed(check(edited(content, ("disturbance", "numbers", key), value * factor))), key


def test_every_step_towards_the_end_is_needed_and_checked(made):
    content = alone(made("pd-0", disturbance=1e-4), "disturbance")
    steps = claims_of(content)["disturbance"]["witness"]["steps"]
    assert passed(check(content))
    assert len(steps) > 2
    for place in range(len(steps)):
        assert not passed(check(edited(content, ("disturbance", "witness", "steps"), steps[:place] + steps[place + 1 :])))
    path, step = ("disturbance", "witness", "steps", 1), steps[1]
    for key in ("decay", "spread"):
        for factor in (0.0, -1.0, 0.5, 2.0):
            assert not passed(check(edited(content, (*path, key), step[key] * factor))), key
    for factor in (-1.0, 1.0 - 1e-4, 1.0 + 1e-4):
        assert not passed(check(edited(content, (*path, "form"), [[x * factor for x in row] for row in step["form"]])))
    skew = copy.deepcopy(step["form"])
    skew[0][1] += 1e-9 * abs(skew[0][0])
    assert not passed(check(edited(content, (*path, "form"), skew)))
    # Without any shift the gyroscopic torque is bounded too widely, with another one wider still.
    for shift in (None, 0.0, 1e3):
        assert not passed(check(edited(content, ("disturbance", "witness", "shift"), shift)))
