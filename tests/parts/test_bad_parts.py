"""What is wrong with the parts of a scenario is told in one line, with exit code 2."""

import tracemalloc
from pathlib import Path

import pytest

from starhold import files
from starhold.laws.catalogue import catalogue
from starhold.parts.catalogue import find, read_module
from starhold.parts.contract import Parameter
from starhold.scenario.writing import law_table
from tests.parts.files import BODY, EFFECTOR, PARTS, PD, POINT, TARGET, part
from tests.refusals import complains, replaced
from tests.running import starhold
from tests.texts import toml

CIRCLE = law_table(catalogue("libration-point")["l2-circle"], catalogue("libration-point")["l2-circle"].examples()[0])
GYRO, FILTER = part('type = "gyro"\n'), part('type = "complementary-filter"\nattitude_gain = 0.1\nbias_gain = 0.01\n')
TRACKER = part('type = "star-tracker"\ncross = 1e-5\nroll = 1e-4\n')
MEKF = part('type = "mekf"\nnoise = 1e-5\nbias_walk = 1e-5\nbias = 1e-4\ncross = 1e-5\nroll = 1e-4\n')
MARS = "[orbit]\nposition = [3.8e6, 0, 0]\nvelocity = [0, 3.4e3, 0]\ngravitational_parameter = 4.2828375816e13\n"
MODES = toml("""[[law]] type = "modes"
[[law.mode]] name = "slow"; type = "pd"; k_rate = 0.1; k_attitude = 0.01; until = { after = "5 s" }
[[law.mode]] name = "sun"; type = "pd"; k_rate = 0.9; k_attitude = 0.09; target = { type = "sun" }
""")
MINE = 'file = "mine.py"\n'
TABLE = part('type = "torque-table"\ntable = "rows.csv"\n')


def told(folder, text):
    """What the command says of a scenario: one line, and exit code 2."""
    (folder / "own.toml").write_text(text)
    done = starhold("run", "own.toml", "-o", "out", cwd=folder)
    complains(done)
    assert not (folder / "out").exists()
    return done.stderr


COMPOSED = {
    "an estimator without its sensors": (FILTER, "no attitude", "a sensor that measures attitude"),
    "an estimator without one of its sensors": (TRACKER + FILTER, "no rate", "a sensor that measures rate"),
    "two estimators": (GYRO + TRACKER + FILTER * 2, "a second estimator", "one estimator"),
    "two sensors of the rate": (GYRO * 2, "a second sensor of rate, beside gyro", "one of each"),
    "a sensor of the attitude that a filter is not told of": (
        GYRO + TRACKER * 3 + MEKF + "more_trackers = [[1e-5, 1e-4, 0, 1, 0]]\n",
        "part mekf: found more_trackers of length 1 for star-tracker-2, star-tracker-3",
        "a row for each sensor of attitude after the first",
    ),
    "a sensor that a filter is told of and that is not there": (
        GYRO + TRACKER + MEKF + "more_trackers = [[1e-5, 1e-4, 0, 1, 0]]\n",
        "more_trackers of length 1 for no second sensor",
    ),
    "two sensors of the attitude and no estimator": (TRACKER * 2, "a second sensor of attitude, beside star-tracker"),
    "a tracker without noise": (
        GYRO + TRACKER * 2 + MEKF + "more_trackers = [[0, 1e-4, 0, 1, 0]]\n",
        "part mekf",
        "the deviations cross and roll of each star tracker must be above 0",
    ),
    "a sensor beside [sensor]": ("[sensor]\nrate_noise = 1e-4\n" + GYRO, "a second sensor of rate"),
    "a part that is about the Earth elsewhere": (
        MARS + part('type = "residual-dipole"\ndipole = [0, 0, 0.01]\n'),
        "part residual-dipole: found an orbit about Mars",
        "an orbit about Earth",
    ),
    "a target about the Earth elsewhere": (MARS + part('type = "sun"\n'), "part sun: found an orbit about Mars"),
    "an unknown type": (part('type = "gyroo"\n'), 'part[1].type: found "gyroo"', "did you mean gyro?"),
    "no type": (part("noise = 1\n"), "part[1].type: found nothing", "or a file"),
    "what another table gives": (part('type = "wheels"\n'), '"wheels"', "the [wheels] table, which gives it"),
    "single brackets": ('[part]\ntype = "gyro"\n', "part: found", "[[part]] tables, with double brackets"),
    "another unit": (part('type = "gyro"\nnoise = "1 N m"\n'), 'part[1].noise: found "1 N m"', "rad"),
    "below the bound": (part('type = "gyro"\nnoise = -0.01\n'), "part[1].noise: found -0.01", "at least 0"),
    "two numbers of three": (part('type = "gyro"\nbias = [0, 1]\n'), "part[1].bias", "3 numbers"),
    "a name twice": (GYRO + part('type = "lag"\nlag = 1\nname = "gyro"\n'), "part[2].name", "a name that"),
    "too late a tracker": (
        part('type = "star-tracker"\ncross = 0\nroll = 0\ndelay = 50\n'),
        "part star-tracker",
        "the delay must be at most 64 control periods",
    ),
    "a blind tracker": (
        part('type = "star-tracker"\ncross = 0\nroll = 0\nboresight = [0, 0, 0]\n'),
        "part star-tracker",
        "the boresight needs a direction",
    ),
    "too fast a lag": (part('type = "lag"\nlag = 0.001\n'), "simulation.substeps", "at least 200 substeps"),
    "file and type": (part(MINE + 'type = "gyro"\n'), "part[1].file", "either a type or a file, not both"),
    "rows of other lengths": (
        part('type = "torque-table"\ntable = [[0, 0, 0, 1e-4], [1, 0, 0]]\n'),
        "allowed: rows of time, x, y, z, or the name of a CSV file",
    ),
    "no such file": (part('file = "nope.py"\n'), '"nope.py": No such file', "a Python file that holds a part"),
}
"""Tables beside those of a body and a law."""
WHOLE = {
    "a law for another body": (POINT + '[[law]]\ntype = "pd"\nk_rate = 0.1\nk_attitude = 0.1\n', "law[1].type", '"pd"'),
    "a law for this body is not there": (BODY + CIRCLE, "law[1].type", '"l2-circle"'),
    "a part of another body": (
        POINT + part('type = "constant-torque"\ntorque = [0, 0, 1e-5]\n') + CIRCLE,
        "part[1]: found constant-torque, for the body rigid-body",
        "a part for libration-point",
    ),
    "a mode's target about the Earth elsewhere": (BODY + MARS + MODES, "found an orbit about Mars"),
    "no table": ("part = [3]\n" + BODY + PD, "part[1]: found 3", "a [[part]] table"),
}


WHOLE |= {kind: (BODY + tables + PD, *said) for kind, (tables, *said) in COMPOSED.items()}


@pytest.mark.parametrize("kind", WHOLE)
def test_parts_that_do_not_go_together(kind, tmp_path):
    text, *said = WHOLE[kind]
    line = told(tmp_path, text)
    assert all(words in line for words in said), line


THRUSTERS = 'type = "thrusters"\ntorque = "50 mN m"\n'
PANEL = [0.4, 0.5, 0.1, 0.0, 0.1, 1.0, 0.2, 0.6, 0.1, 0.05, 0.010, 0.005, 0.015, 0.20, 0.01, 0.15]
GYROSCOPE = [0.8165, 0.0, 0.57735, 0.0, 1.0, 0.0, 8e-4, 1e-3, 6e-4, 8e-4, 1.0, 0.2, 0.01, 0.6, 0.0, 0.4]


def panel(change):
    return f'type = "hinged-panels"\nmass = 30.0\npanels = [{[change.get(k, x) for k, x in enumerate(PANEL)]}]\n'


def gyroscope(change):
    return f'type = "control-moment-gyros"\nunits = [{[change.get(k, x) for k, x in enumerate(GYROSCOPE)]}]\n'


PLATE = 'type = "solar-pressure"\nplates = [[{}, 0, 0, 0.05, 0, 0.02, {}]]\n'
IMPOSSIBLE = [
    (THRUSTERS + "off = 0.1\n", "off must be at most on"),
    (THRUSTERS + "minimum = 0.2\n", "the shortest pulse must be at most the control period of 0.1 s, not 0.2 s"),
    (THRUSTERS + part('type = "lag"\nlag = 0.5\n'), "thrusters, which reads the command only at control instants"),
    (panel({0: 40.0}), "part hinged-panels: the panels together must have less than the craft's mass of 30 kg"),
    (panel({0: 0.0}), "panel 1 needs a mass above 0"),
    (panel({4: 0.0, 5: 0.0, 6: 0.0}), "the hinge of panel 1 has no direction"),
    (panel(dict(zip(range(4, 10), [0.6, 0.1, 0.05] * 2, strict=True))), "the centre of mass of panel 1 lies on its hinge"),
    # 8 kg at 1.1 m have more inertia than the whole, or leave the hub two moments whose sum is less than the third.
    (panel({0: 8.0}), "without its panels the craft of 30 kg is no body"),
    (panel({12: 6.0}), "no body has these principal moments"),
    ('type = "flexible-modes"\nmodes = [[0.6, 0.005, 3.0, 0, 0, 0]]\n', "the modes carry more inertia than the craft has"),
    (gyroscope({3: 1.0, 4: 0.0}), "the spin axis of unit 1 is not perpendicular to its gimbal"),
    (gyroscope({0: 0.0, 2: 0.0}), "the gimbal of unit 1 has no direction"),
    (gyroscope({6: 2e-3}), "unit 1 needs moments of inertia above 0, of the rotor at most about_spin"),
    (gyroscope({11: 0.0}), "the gimbal of unit 1 needs a rate limit of at least 0 and a torque limit above 0"),
    (gyroscope({15: 0.7}), "torque limit of at least 0, a momentum limit above 0, and a momentum within it"),
    (gyroscope({10: 0.0}), "there is no unit with momentum in a gimbal that turns"),
    (gyroscope({}), "the units give no torque about some axis: two gimbals that are not parallel are needed"),
    (PLATE.format("0.06, 1", "0.8, 0.3"), "plate 1 needs shares"),
    (PLATE.format("0.06, 0", "0.2, 0.3"), "plate 1 needs an area of at least 0 and a normal"),
    ('type = "sun"\naxis = [0, 0, 2]\nother = [0, 0, -1]\n', "the two body axes must have directions"),
    ('type = "sun"\nreference = [0, 0, 0]\n', "the reference needs a direction"),
    ('type = "ground-station"\nlatitude = 2.0\nlongitude = 0.0\n', "latitude"),
    ('type = "magnetometer"\noutage = [2, 1]\n', "outage ends"),
    ('type = "star-tracker"\ncross = 0\nroll = 0\noutage = [2, 1]\n', "outage ends"),
    ('type = "sun-sensor"\nboresight = [0, 0, 0]\n', "boresight"),
    ('type = "residual-dipole"\ndipole = [0, 0, 1]\n', "no two-body, which residual-dipole needs"),
]


@pytest.mark.parametrize(("keys", "said"), IMPOSSIBLE)
def test_numbers_that_no_part_can_have(keys, said, tmp_path):
    orbit = "" if "residual" in keys else '[orbit]\nposition = ["6878 km", 0, 0]\nvelocity = [0, 0, "7.6 km/s"]\n'
    assert said in told(tmp_path, BODY + orbit + part(keys) + PD)


def test_two_targets_and_two_effectors_that_take_the_command(tmp_path):
    (tmp_path / "mine.py").write_text(TARGET)
    (tmp_path / "other.py").write_text(TARGET)
    both = part(MINE) + part('file = "other.py"\n')
    assert "one target" in told(tmp_path, BODY + both + PD)
    line = told(tmp_path, BODY + '[target]\nangles = ["10 deg", 0, 0]\n' + part(MINE) + PD)
    assert "part mine: found a second target, beside [target]; allowed: one target" in line
    acting = EFFECTOR.replace('ROLE = "effector"\n', 'ROLE = "effector"\nACTS = True\n')
    (tmp_path / "mine.py").write_text(acting + "\n\ndef command(applied, params):\n    return applied\n")
    wheels = '[wheels]\nlayout = "orthogonal"\ninertia = 1e-3\ntorque_limit = 0.05\nmomentum_limit = 0.4\n'
    assert "a second effector for the command" in told(tmp_path, BODY + wheels + part(MINE + PARTS["effector"][1]) + PD)


def test_an_effector_on_a_body_that_does_not_turn(tmp_path):
    (tmp_path / "mine.py").write_text(EFFECTOR.replace("ROLE = ", 'BODY = ""\nROLE = '))
    line = told(tmp_path, POINT + part(MINE + PARTS["effector"][1]) + CIRCLE)
    assert "an effector on the body libration-point; allowed: a body that turns" in line


DRAG = "return scale(-params.drag, state.rate)"
BROKEN = {
    "syntax": ("environment", "def torque(state,", "def torque(state", "mine.py, line"),
    "no card": ("environment", "CARD = Card(", "KARD = Card(", "this environment needs CARD"),
    "not a card": ("environment", "CARD = Card(", "CARD = dict(", "CARD is not a Card"),
    "import": ("environment", "import Quantity", "import Quantities", "mine.py, line 5: ImportError"),
    "an unknown role": ("environment", 'ROLE = "environment"', 'ROLE = "thruster"', "its role must be one of effector"),
    "no role": ("environment", 'ROLE = "environment"', "", "it declares no ROLE"),
    "a role of its own tables": ("environment", 'ROLE = "environment"', 'ROLE = "law"', "its role must be one of"),
    "no equation": ("environment", "def torque", "def torques", "this environment needs torque or acceleration"),
    "no measure": ("sensor", "def measure", "def measures", "this sensor needs measure"),
    "no needs": ("estimator", "NEEDS = ", "NEED = ", "this estimator needs NEEDS"),
    "no momentum": ("effector", "def momentum", "def momenta", "this effector needs momentum"),
    "no unit": (
        "environment", 'Annotated[float, Parameter("N m s", at_least=0.0, text="torque for a radian a second")]', "float",
        "Params.drag declares no unit",
    ),
    "an equation fails": ("environment", "state.rate)", "state.rates)", "part mine: mine.py, line 20: AttributeError"),
    "it divides by nothing": ("environment", "-params.drag,", "1.0 / 0.0,", "mine.py, line 20: ZeroDivisionError"),
    "two numbers of three": ("environment", DRAG, "return (0.0, 0.0)", "torque returns (0.0, 0.0)"),
    "a torque of nothing": ("environment", DRAG, "return None", "torque returns None; allowed: three"),
    "another memory": ("sensor", "params.noise))), memory", "params.noise))), (1.0,)", "a memory in the form of the one"),
    "a reading of two numbers": ("sensor", "Reading(add(add(state.rate, params.bias), dice.vector(0, params.noise)))",
                                 "Reading((0.0, 0.0))", "rate in the form of the body's state"),
    "no pair": ("sensor", ", memory\n", "\n", "a pair of a Reading and the memory"),
    "another effector's rates": ("effector", "return State(state.speed, ", "return (", "numbers in the form of"),
    "a goal of three": ("target", "Goal(params.attitude, ZERO, ZERO)", "(params.attitude, ZERO, ZERO)", "a Goal of four"),
    "an undeclared record": ("effector", 'Annotated[Scalar, Quantity("kg^0.5 m", "deflection of the panel\'s mode")]', "int",
                             "annotated with a Quantity"),
    "a reading that is none of the state": ("sensor", "    rate: Annotated", "    spin: Annotated",
                             'FIRST = {"spin": 0.0}'),
    "a reading that estimators state": ("sensor", "    rate: Annotated", "    is_valid: Annotated",
                                       "found a reading is_valid"),
    "an equation ends the program": ("sensor", "    return Reading(", "    raise SystemExit\n    return Reading(",
                             "mine.py, line 27: SystemExit"),
    "needs that fail": ("estimator", "def remember", "def needs(params):\n    return params.sahre\n\n\ndef remember",
                        "part mine: mine.py, line 27: AttributeError"),
    "needs by its numbers": ("estimator", "def remember", "def needs(params):\n    return ('sun',)\n\n\ndef remember",
                             "no sun, which mine needs; allowed: a sensor that measures sun, such as"),
    "needs of more": ("estimator", "def remember", "def needs(params, period):\n    return ()\n\n\ndef remember",
                      "needs(params, period) must be needs(params)"),
    "about another body": ("environment", "def torque", "def about(params):\n    return 'Mars'\n\n\ndef torque",
                           "found an orbit about Earth; allowed: an orbit about Mars"),
    "its start fails": ("effector", "State(0.0, 0.0)", "State(0.0, nought)", "mine.py, line 36: NameError"),
}  # fmt: skip


@pytest.mark.parametrize("kind", BROKEN)
def test_a_file_that_is_no_part_or_fails(kind, tmp_path):
    role, old, new, said = BROKEN[kind]
    text, keys = PARTS[role]
    (tmp_path / "mine.py").write_text(replaced(text, old, new))
    before = GYRO if role == "estimator" else ""
    assert said in told(tmp_path, BODY + before + part(MINE + keys) + PD)


ENDLESS = {
    "a part": part('file = "/dev/zero"\n') + PD,
    "rows": TABLE.replace("rows.csv", "/dev/zero") + PD,
    "a law": '[[law]]\nfile = "/dev/zero"\n',
    "a history": '[target]\nmode = "history"\nfile = "/dev/zero"\n' + PD,
}


@pytest.mark.parametrize("kind", ENDLESS)
def test_a_file_without_end_is_refused(kind, tmp_path, monkeypatch):
    monkeypatch.setattr(files, "LARGEST", 2**20)
    assert "larger than 1 MiB" in told(tmp_path, BODY + ENDLESS[kind])


def test_a_long_list_in_place_of_a_matrix_costs_no_memory():
    """The diagonal matrix of 40 000 numbers would take 12 GB."""
    tracemalloc.start()
    with pytest.raises(ValueError, match="a number, 3 numbers or a 3x3 matrix"):
        Parameter(shape=(3, 3)).check([1.0] * 40_000)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < 2**22


ROWS = {
    "missing": (None, "rows.csv: No such file"),
    "words": ("time,x,y,z\n0,0,0,much\n1,0,0,0\n", "rows.csv: could not convert string to float"),
    "a column too few": ("0,0,0\n1,0,0\n", "a line without 4 columns; allowed: a CSV file of time, x, y, z"),
    "lines of other lengths": ("0,0,0,1\n1,0,0\n", "a CSV file of time, x, y, z"),
    "nothing": ("time,x,y,z\n", "rows of time, x, y, z"),
    "no number": ("0,0,0,nan\n1,0,0,0\n", "finite"),
    "one row": ("0,0,0,1e-4\n", "at least two rows"),
    "back in time": ("1,0,0,0\n0,0,0,1e-4\n", "times that increase"),
    "bytes": (b"\xff\xfe0,0,0,0\n", "rows.csv: "),
}


@pytest.mark.parametrize("kind", ROWS)
def test_a_table_that_is_none(kind, tmp_path):
    text, said = ROWS[kind]
    if text is not None:
        (tmp_path / "rows.csv").write_bytes(text if isinstance(text, bytes) else text.encode())
    assert said in told(tmp_path, BODY + TABLE + PD)


def test_a_link_that_hides_a_file_of_python_is_not_run(tmp_path):
    (tmp_path / "own.py").write_text("raise SystemExit")
    (tmp_path / "table.csv").symlink_to("own.py")
    with pytest.raises(ValueError, match=r"ends in \.py"):
        read_module(tmp_path / "table.csv")


def test_an_equation_with_other_arguments_than_its_role_has(tmp_path):
    source = Path(find("environment", "constant-torque").module.__file__).read_text()
    assert "def bound(params: Params, envelope: Envelope)" in source
    (tmp_path / "mine.py").write_text(source.replace("params: Params, envelope: Envelope", "params: Params"))
    stderr = told(tmp_path, BODY + part(MINE + "torque = [0.0, 0.0, 1e-6]\n") + PD)
    assert "mine.py: bound(params) must be bound(params, envelope)" in stderr
