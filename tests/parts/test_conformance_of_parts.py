"""The conformance suite of parts: those of starhold pass all of it, and each check finds the fault that it is for."""

from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from starhold.conformance.parts import CHECKS, find_part
from starhold.conformance.verdicts import run
from starhold.parts.catalogue import PACKAGES, parts
from tests.parts.files import ACTUATOR, ENVIRONMENT, JETS, PARTS
from tests.refusals import refused, replaced

ALL = [(role, name) for role in PACKAGES for name in parts(role)]
OWN = {role: text for role, (text, _) in PARTS.items()} | {"jets": JETS}
EVERY = {"declares_itself", "is_pure", "reads_alike", "stays_finite"}
"""Checks that say something of every part but a body."""


def outcomes(part, only=None):
    """The outcome and reason of each check, or of some, by name."""
    checks = [check for check in CHECKS if only is None or check.__name__ in only]
    return {check.__name__: verdict for check, verdict in zip(checks, run(checks, part), strict=True)}


@pytest.mark.parametrize(("role", "name"), ALL)
def test_parts_of_starhold_conform(role, name):
    part = parts(role)[name]
    found = outcomes(part)
    assert [v for v in found.values() if v.outcome == "failed"] == []
    if role != "body":
        passed = {name for name, v in found.items() if v.outcome == "passed"}
        assert passed >= EVERY
        assert ("survives_toml" in passed) == (not part.table)
        assert ("keeps_momentum" in passed) == (role == "effector" and not part.flag("OUTSIDE"))
        assert ("measures_what_it_says" in passed) == (role in ("sensor", "estimator"))


COUNTED = """
CALLS = []


def counted():
    CALLS.append(1)
    return 1e-6 * len(CALLS)


def examples():"""
PREPARED = "def prepare(params, period):\n    return Params(params.drag * period)\n\n\ndef torque"
STAYING = """from starhold.parts.contract import Errors, Noise


def error(params):
    return Errors()


def noise(params, period):
    return Noise(rate=params.noise)


def remember(params, state):
    return ZERO


def measure"""
BROKEN = {
    "a counter of its own": (
        "environment",
        {"scale(-params.drag,": "scale(counted() - params.drag,", "\ndef examples():": COUNTED},
        {"is_pure", "reads_alike"},
    ),
    "a counter in a sensor": (
        "sensor",
        {"add(state.rate, params.bias)": "add(state.rate, (counted(), 0.0, 0.0))", "\ndef examples():": COUNTED},
        {"is_pure", "reads_alike"},
    ),
    "a wrong unit": ("environment", {'"N m s"': '"N m"'}, {"keeps_units"}),
    "a number without its unit": ("environment", {"scale(-params.drag,": "scale(-1e-3 - params.drag,"}, {"keeps_units"}),
    "a wrong unit of a command's limit": (
        "actuator", {'Parameter("N m"': 'Parameter("N m s"', "Params(1e-4)": "Params(1.5e-3)"}, {"keeps_units"}
    ),
    "not a number": (
        "environment",
        {"scale(-params.drag,": "scale(params.drag / (dot(state.rate, state.rate) - dot(state.rate, state.rate)),"},
        {"stays_finite"},
    ),
    "infinite at rest": (
        "environment",
        {"scale(-params.drag,": "scale(-1e-6 * params.drag / dot(state.rate, state.rate),"},
        {"stays_finite", "keeps_units"},
    ),
    "a reading of two numbers": (
        "sensor",
        {"Reading(add(add(state.rate, params.bias), dice.vector(0, params.noise)))": "Reading(state.rate[:2])"},
        {"measures_what_it_says"},
    ),
    "a reading without a unit": (
        "sensor",
        {'Annotated[tuple, Quantity("rad/s", "measured rate, body axes", "axis")]': "tuple"},
        {"declares_itself"},
    ),
    "an example out of its bounds": ("sensor", {"[Params(1e-4)]": "[Params(-1e-4)]"}, {"declares_itself", "survives_toml"}),
    "no example": ("sensor", {"[Params(1e-4)]": "[]"}, {"declares_itself"}),
    "no title": ("target", {'title="Mine"': 'title=""'}, {"declares_itself"}),
    "an example of another shape": ("effector", {"(0.3, 0.0, 0.1)": "[0.3, 0.0, 0.1]"}, {"declares_itself"}),
    "a reaction of the wrong sign": (
        "effector", {"subtract(scale(spring(state, params)": "subtract(scale(-spring(state, params)"}, {"keeps_momentum"}
    ),
    "no gyroscopic torque of its momentum": (
        "effector", {"cross(body.rate, momentum(state, params))": "(0.0, 0.0, 0.0)"}, {"keeps_momentum"}
    ),
    "no inertia": ("effector", {"def inertia": "def inertia_of"}, {"keeps_momentum"}),
    "the same numbers in every run": (
        "sensor",
        {"dice.vector(0, params.noise)": "type(dice)((1, 1), 1, 0).vector(0, params.noise + 0.0 * dice.vector(0, 1.0)[0])"},
        {"draws_in_its_range"},
    ),
    "an estimate of two numbers": ("estimator", {"Estimate(rate),": "Estimate(rate[:2]),"}, {"measures_what_it_says"}),
    "an exceeded bound": (
        "environment",
        {
            "def torque": "def bound(params, envelope):\n    return Push(0.0)\n\n\ndef torque",
            "import Card, Parameter": "import Card, Parameter, Push",
        },
        {"keeps_what_it_says"},
    ),
    "a torque that is larger elsewhere on the orbit": (
        "environment",
        {
            "def torque": "def bound(params, envelope):\n    return Push(params.drag)\n\n\ndef torque",
            "import Card, Parameter": "import Card, Parameter, Push",
            "scale(-params.drag, state.rate)": "(params.drag * 4.9e13 / dot(state.position, state.position), 0.0, 0.0)",
        },
        {"keeps_what_it_says"},
    ),
    "errors that stay for a while": (
        "sensor",
        {
            "def measure": STAYING,
            "dice.vector(0, params.noise))), memory": (
                "memory)), add(scale(0.98, memory), dice.vector(0, 0.2 * params.noise))"
            ),
        },
        {"draws_as_it_says"},
    ),
    "a torque that changes faster than it says": (
        "environment",
        {
            "def torque": "def torque_change(params, craft, envelope):\n    return Push(0.0)\n\n\ndef torque",
            "import Card, Parameter": "import Card, Parameter, Push",
            "state.rate)": "state.attitude[1:])",
        },
        {"keeps_what_it_says"},
    ),
    "a torque that changes faster elsewhere on the orbit": (
        "environment",
        {
            "def torque": (
                "def torque_change(params, craft, envelope):\n"
                "    return Push(1e-4 * params.drag, 0.503 * params.drag)\n\n\ndef torque"
            ),
            "import Card, Parameter": "import Card, Parameter, Push",
            "scale(-params.drag, state.rate)": (
                "scale(params.drag * 4.9e13 / dot(state.position, state.position), state.attitude[1:])"
            ),
        },
        {"keeps_what_it_says"},
    ),
    "a target that turns faster than it says": (
        "target",
        {
            "Goal(params.attitude, ZERO, ZERO)": "Goal(params.attitude, (1e-3, 0.0, 0.0), ZERO)",
            "def examples": "def motion(params, orbit):\n    return Motion(1e-4, 0.0)\n\n\ndef examples",
            "import Card": "import Motion, Card",
        },
        {"keeps_what_it_says"},
    ),
    "a target that turns and tells none of it": (
        "target",
        {
            "Goal(params.attitude, ZERO, ZERO)": "Goal(normalise((1.0, 1e-5 * step, 0.0, 0.0)), ZERO, ZERO)",
            "def examples": "def motion(params, orbit):\n    return Motion(0.0, 0.0)\n\n\ndef examples",
            "import Card": "import Motion, Card",
            "from starhold.algebra.quantity": (
                "from starhold.algebra.quaternion import normalise\nfrom starhold.algebra.quantity"
            ),
        },
        {"keeps_what_it_says"},
    ),
    "an acceleration that is larger than it says": ("oblateness", {"3.0 * abs": "2.0 * abs"}, {"keeps_what_it_says"}),
    "a gradient that is larger than it says": ("oblateness", {"12.0 * abs": "8.0 * abs"}, {"keeps_what_it_says"}),
    "a bias that does not stay": (
        "sensor",
        {
            "def measure": STAYING.replace("Errors()", "Errors(rate=1e-3, bias=1e-3)").replace("ZERO", "(1e-3, 0.0, 0.0)"),
            "dice.vector(0, params.noise))), memory": "memory)), scale(-1.0, memory)",
        },
        {"keeps_what_it_says"},
    ),
    "a field that is farther off than it says": (
        "magnetometer", {"scaled + math.hypot(*params.bias)": "scaled"}, {"keeps_what_it_says"}
    ),
    "a field with more noise than it says, beside its bias": (
        "magnetometer", {"field=_deviation": "field=0.4 * _deviation"}, {"draws_as_it_says"}
    ),
    "an error from longer ago than it says": ("star-tracker", {"ago=late": "ago=0.25 * late"}, {"keeps_what_it_says"}),
    "a torque that grows in a flight": (
        "residual-dipole",
        {
            "return magnetic_field.field_at(": "return scale(1.0 + 1e-6 * step, magnetic_field.field_at(",
            "step, params.field)": "step, params.field))",
            "import ZERO, Vector, ": "import ZERO, Vector, scale, ",
        },
        {"keeps_what_it_says"},
    ),
    "a torque that is not across the field": (
        "residual-dipole", {"to_body(state.attitude, memory))": "memory)"}, {"keeps_what_it_says"}
    ),
    "directions that scatter the attitude more than it says": (
        "triad", {"error, math.sqrt((total": "error, 0.2 * math.sqrt((total"}, {"draws_as_it_says"}
    ),
    "an estimate that is corrected less than it says": (
        "complementary-filter", {"0.5 * params.attitude_gain": "0.3 * params.attitude_gain"}, {"errs_as_it_says"}
    ),
    "an estimate with more of the gyro's noise than it says": (
        "complementary-filter", {"scale(noise.rate, random": "scale(0.5 * noise.rate, random"}, {"errs_as_it_says"}
    ),
    "an estimate that is behind a body that speeds up": (
        "complementary-filter", {"0.5 * period)\n\n\ndef": "0.2 * period)\n\n\ndef"}, {"errs_as_it_says"}
    ),
    "a rate that is the mean of two readings": (
        "triad",
        {
            "    return measured_or_carried(readings, memory, period, observe)": (
                "    told, after = measured_or_carried(readings, memory, period, observe)\n"
                "    mean = tuple(0.5 * (x + y) for x, y in zip(memory.rate, readings.rate, strict=True))\n"
                "    return told._replace(rate=mean), after"
            )
        },
        {"errs_as_it_says"},
    ),
    "a drive that does not answer to small changes": (
        "lag",
        {
            "scale(1.0 / params.lag, subtract(target, output))": "tuple(map(slow, subtract(target, output)))",
            "def rates(": "def slow(x):\n    return where(less(absolute(x), 1e-4), 0.0, x / 0.3)\n\n\ndef rates(",
            "scalar import Scalar": "scalar import Scalar, absolute, less, where",
        },
        {"keeps_what_it_says"},
    ),
    "a rate that is not seen if it is small": (
        "sensor",
        {
            "add(state.rate, params.bias)": "add(tuple(map(seen, state.rate)), params.bias)",
            "def measure": (
                "def seen(x):\n    return where(less(absolute(x), 1e-5), 0.0, x)\n\n\n"
                + STAYING.replace("def remember(params, state):\n    return ZERO\n\n\n", "")
            ),
            "from starhold.algebra.quantity": (
                "from starhold.algebra.scalar import absolute, less, where\nfrom starhold.algebra.quantity"
            ),
        },
        {"keeps_what_it_says"},
    ),
    "a command that is not obeyed if it is small": (
        "actuator",
        {
            "def examples": "def error(params, envelope):\n    return Push(0.0)\n\n\ndef examples",
            "Params(1e-4)": "Params(1e-7)",
            "import Card,": "import Push, Card,",
        },
        {"keeps_what_it_says"},
    ),
    "a target that turns for some time": (
        "target",
        {
            "ZERO, ZERO)": "(where(less(step, 900), where(less(300, step), 1e-3, 0.0), 0.0), 0.0, 0.0), ZERO)",
            "def examples": "def motion(params, orbit):\n    return Motion(0.0, 0.0)\n\n\ndef examples",
            "import Card": "import Motion, Card",
            "from starhold.algebra.quantity": (
                "from starhold.algebra.scalar import less, where\nfrom starhold.algebra.quantity"
            ),
        },
        {"keeps_what_it_says"},
    ),
    "noise that grows with the rate": (
        "star-tracker",
        {"dice.vector(0, 1.0)": "dice.vector(0, 1.0 + 4.0 * dot(state.rate, state.rate))"},
        {"draws_as_it_says"},
    ),
    "a Sun in the Earth's shadow": (
        "sun-sensor",
        {
            "seen.direction))": "mixed(seen, state)))",
            "less(0.5, sun.in_view(state.position, seen))": "less(-1.0, params.cosine)",
            "def measure(": (
                "def mixed(seen, state):\n"
                "    away = scale(sun.in_view(state.position, seen) - 1.0, unit(state.position))\n"
                "    return add(seen.direction, away)\n\n\ndef measure("
            ),
            "import ZERO, Vector, add, dot": "import ZERO, Vector, add, scale, dot",
        },
        {"keeps_what_it_says"},
    ),
    "a torque that is not the one that it takes for applied": (
        "jets", {"return applied(state, command, body, params)": "return scale(1.1, command)"}, {"keeps_what_it_says"}
    ),
    "a torque that it does not surely give": (
        "jets", {"return params.most": "return 1.1 * params.most"}, {"keeps_what_it_says"}
    ),
    "a torque that has a limit and says none": ("jets", {"def sure_torque": "def torque_of"}, {"keeps_what_it_says"}),
    "a torque that runs out": (
        "jets",
        {
            "return clip_axes(command, params.most)": (
                "return scale(where(less(dot(state.impulse, state.impulse), 4.0), 1.0, 0.0), command)"
            )
        },
        {"keeps_what_it_says"},
    ),
    "a unit without the period": ("environment", {"def torque": PREPARED}, {"keeps_units"}),
}  # fmt: skip


@pytest.mark.parametrize("kind", BROKEN)
def test_each_fault_is_found(kind, tmp_path):
    role, changes, found_by = BROKEN[kind]
    text = OWN[role] if role in OWN else Path(find_part(role).module.__file__).read_text(encoding="utf-8")
    (tmp_path / "mine.py").write_text(replaced(text, *changes.items()), encoding="utf-8")
    assert {v.outcome for v in outcomes(find_part(str(tmp_path / "mine.py")), found_by).values()} == {"failed"}


def halved(said):
    """What a part says, by half."""
    fields = {"attitude", "rate", "torque", "deviation"} & {*said._fields} or {"error"}
    return said._replace(**{name: (np.array(getattr(said, name)) / 2.0).tolist() for name in fields})


@pytest.mark.parametrize(
    ("role", "name", "hook"),
    [
        ("sensor", "gyro", "noise"),
        ("sensor", "star-tracker", "noise"),
        ("environment", "random-torque", "noise"),
        ("sensor", "sun-sensor", "direction"),
        ("sensor", "gnss", "place"),
    ],
)
def test_random_errors_twice_as_large_as_said_are_found(role, name, hook):
    part, module = parts(role)[name], ModuleType(name)
    tell = part.hook(hook)
    vars(module).update({**vars(part.module), hook: lambda *given: halved(tell(*given))})
    found = outcomes(replace(part, module=module), {"draws_as_it_says"})["draws_as_it_says"]
    assert found.outcome == "failed"


def test_every_check_has_found_something():
    assert {name for _, _, found_by in BROKEN.values() for name in found_by} == {check.__name__ for check in CHECKS}


def test_a_part_that_prepares_its_numbers_for_the_control_period_keeps_its_units(tmp_path):
    (tmp_path / "mine.py").write_text(ENVIRONMENT.replace("def torque", PREPARED).replace('"N m s"', '"N m"'))
    assert outcomes(find_part(str(tmp_path / "mine.py")), {"keeps_units"})["keeps_units"].outcome == "passed"


def test_an_effector_that_keeps_what_it_says_passes(tmp_path):
    (tmp_path / "mine.py").write_text(JETS)
    found = outcomes(find_part(str(tmp_path / "mine.py")))
    assert [v for v in found.values() if v.outcome == "failed"] == []
    assert found["keeps_what_it_says"].outcome == "passed"


def test_a_part_is_found_by_its_name_and_by_its_file(tmp_path):
    assert find_part("gyro") is parts("sensor")["gyro"]
    (tmp_path / "mine.py").write_text(ACTUATOR)
    assert find_part(str(tmp_path / "mine.py")).role == "actuator"
    assert find_part(parts("sensor")["gyro"].module.__file__) is parts("sensor")["gyro"]
    for given, said in (("gyroo", "did you mean gyro?"), (str(tmp_path), "a Python file that holds a part")):
        with refused(said):
            find_part(given)
