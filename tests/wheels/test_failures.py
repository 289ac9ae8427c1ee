"""What is left after the loss of one or two wheels."""

import csv
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from starhold.analysis.rigid_body import measure
from starhold.cli.show import print_blocks
from starhold.parts.effectors.layouts import pyramid
from starhold.report.commands.failures import present
from starhold.report.figures import save
from starhold.report.tables import write_table
from starhold.scenario.bodies.rigid_body.craft import wheels_of
from starhold.scenario.building import build
from starhold.scenario.reading import builtin_text, load, parse
from starhold.simulation.lane import fly, label
from starhold.studies.failures import FULL, Failure, _flown, _left, saturation, study
from tests.refusals import complains, replaced
from tests.running import starhold

BUILTIN = builtin_text("wheels-orbital")


@pytest.fixture(scope="module")
def scenario():
    return load("wheels-orbital")


@pytest.fixture(scope="module")
def found(scenario):
    heard = []
    failures = study(scenario, scenario.laws[0], lambda done, total, name: heard.append((done, total, name)))
    assert [(done, total) for done, total, _ in heard] == [(k, 11) for k in range(12)]
    assert heard[0][2] == "none"
    return failures


def changed(*pairs):
    return parse(replaced(BUILTIN, *pairs), "here")


@pytest.mark.slow
def test_a_pyramid_bears_every_single_loss_and_no_double_one(found):
    assert [failure.lost for failure in found] == [(), (1,), (2,), (3,), (4,), *combinations((1, 2, 3, 4), 2)]
    singles, doubles = found[1:5], found[5:]
    assert all(failure.controllable for failure in found[:5])
    assert [failure.authority for failure in singles] == pytest.approx([singles[0].authority] * 4, rel=1e-12)
    assert found[0].share == 1.0
    assert 0.0 < singles[0].share < 1.0
    axes = np.array(pyramid())
    for failure in doubles:
        assert not failure.controllable
        assert (failure.authority, failure.share, failure.condition) == (0.0, 0.0, np.inf)
        assert (failure.gains, failure.eta, failure.settling, failure.saturation) == (None, None, None, None)
        left = [k for k in range(4) if k + 1 not in failure.lost]
        assert len(failure.lacking) == 1
        assert np.abs(axes[left] @ failure.lacking[0]).max() < 1e-10
        assert np.linalg.norm(failure.lacking[0]) == pytest.approx(1.0, abs=1e-10)


@pytest.mark.slow
def test_less_torque_gives_a_smaller_degree_of_stability_and_a_later_settling(found):
    for failure in found[1:5]:
        assert failure.eta_intact == found[0].eta
        assert 0.0 < failure.eta < failure.eta_intact
        assert failure.gains["k_attitude"] < found[0].gains["k_attitude"]
        assert failure.settling > found[0].settling
        assert failure.diverged_at is None
        assert 0.0 < failure.momentum_share < FULL


@pytest.mark.slow
def test_degree_of_stability_and_gains_are_those_of_a_design_for_the_torque_left(scenario, found):
    entry = scenario.laws[0]
    left = entry.spec._replace(torque=entry.spec.torque * found[1].share)
    told = dict(entry.law.explain(scenario.craft, left))
    assert found[1].eta == pytest.approx(told["degree of stability (1/s)"], rel=1e-9)
    designed = entry.law.design(scenario.craft, left)
    assert found[1].gains["k_rate"] == pytest.approx(designed.k_rate, rel=1e-12)


def test_three_orthogonal_wheels_name_the_axis_of_each_loss():
    scenario = changed(('"pyramid"', '"orthogonal"'))
    found = study(scenario, scenario.laws[0])
    assert len(found) == 1 + 3 + 3
    for failure in found[1:4]:
        assert np.abs(failure.lacking) == pytest.approx(np.eye(3)[[failure.lost[0] - 1]], abs=1e-12)
    for failure in found[4:]:
        gone = np.eye(3)[[k - 1 for k in failure.lost]]
        assert np.array(failure.lacking).T @ np.array(failure.lacking) == pytest.approx(gone.T @ gone, abs=1e-12)


@pytest.mark.slow
def test_five_wheels_bear_double_losses_and_a_law_with_given_gains_keeps_them():
    axes = ([1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1], [1, 2, -1])
    wheels = "".join(f"\n[[wheel]]\naxis = {axis}\n" for axis in axes)
    given = '\n[[law]]\ntype = "wheel"\nname = "given"\nk_rate = 0.3\nk_attitude = 0.003\n[settling]'
    parts = ('layout = "pyramid"', "#"), ('allocation = "least-squares"', wheels.strip()), ("[settling]", given)
    scenario = changed(*parts, ("control_period = 0.1", "control_period = 1.0"))
    left = [_left(wheels_of(scenario), lost, 0.02) for lost in combinations(range(1, 6), 2)]
    assert all(failure.controllable for failure in left)
    flown = _flown(scenario, scenario.pick("given"), left[0])
    assert flown.eta is None
    assert (flown.gains["k_rate"], flown.gains["k_attitude"]) == (0.3, (0.003,) * 3)
    assert flown.settling is not None


def test_the_intact_set_settles_as_in_a_run(scenario, found):
    loop = build(scenario, scenario.laws[0])
    recording = label(loop, *fly(loop, scenario.table.simulation.steps), 1)
    limits = scenario.table.settling
    assert found[0].settling == measure(recording, limits.attitude_tolerance, limits.rate_tolerance)["settling_time"]


def test_losses_replace_the_faults_of_the_file(found):
    scenario = parse(BUILTIN + "\n[[fault]]\ntime = 20\nwheel = 2\nlost = true\n", "here")
    intact = replace(_left(wheels_of(scenario), (), found[0].authority), eta_intact=found[0].eta)
    assert _flown(scenario, scenario.laws[0], intact) == found[0]


@pytest.mark.slow
def test_an_extrapolated_time_is_met_in_a_longer_flight():
    """A craft held against gravity gathers momentum; the first orbit foretells, to within one, when a wheel is full."""
    small = (
        ('mode = "orbital"', 'mode = "inertial"'),
        ('momentum_limit = "0.4 N m s"', 'momentum_limit = "0.09 N m s"'),
        ("control_period = 0.1", "control_period = 1.0"),
    )
    known = []
    for duration in ("10 min", "4000 min"):
        scenario = changed(*small, ('"10 min"', f'"{duration}"'))
        intact = Failure((), (), 1.0, 0.02, 1.0)
        known.append(_flown(scenario, scenario.laws[0], intact).saturation)
    told, met = known
    assert (told.known, met.known) == ("extrapolated", "flown")
    assert told.window == pytest.approx(5675.8, abs=1.0)
    assert met.time > 3.0 * told.window
    assert told.time == pytest.approx(met.time, abs=told.window)
    assert told.wheel == met.wheel


def test_the_growth_of_a_made_up_momentum_is_carried_on_to_within_an_orbit():
    times = np.linspace(0.0, 1000.0, 1001)
    swing = 0.1 * np.sin(2.0 * np.pi * times / 500.0)
    filled = np.column_stack([swing, 0.2 - 1e-4 * times + swing, 0.5 + 0.0 * times])
    known = saturation(times, filled, 500.0)
    assert (known.known, known.wheel, known.window) == ("extrapolated", 2, 500.0)
    further = np.linspace(0.0, 20000.0, 20001)
    true = further[np.argmax(np.abs(0.2 - 1e-4 * further + 0.1 * np.sin(2.0 * np.pi * further / 500.0)) > FULL)]
    assert known.time == pytest.approx(true, abs=500.0)
    assert saturation(times, filled[:, [0, 2]], 500.0).known == "none"
    flown = saturation(times, np.column_stack([swing, 1e-3 * times]), 500.0)
    assert (flown.known, flown.wheel, flown.time) == ("flown", 2, pytest.approx(991.0))


def test_the_table_reads_back(scenario, found, tmp_path):
    write_table(present(scenario, scenario.laws[0], found).numbers, tmp_path / "failures.csv")
    rows = list(csv.DictReader((tmp_path / "failures.csv").read_text(encoding="utf-8").splitlines()))
    assert len(rows) == len(found)
    for row, failure in zip(rows, found, strict=True):
        assert tuple(map(int, row["lost wheels"].split())) == failure.lost
        assert float(row["torque authority (N m)"]) == failure.authority
        assert float(row["condition number"]) == failure.condition
        if failure.controllable:
            assert float(row["degree of stability after (1/s)"]) == failure.eta
            assert float(row["settling time (s)"]) == failure.settling
            assert tuple(map(float, row["k_attitude (N m)"].split())) == failure.gains["k_attitude"]
        else:
            directions = [tuple(map(float, text.split())) for text in row["directions without authority"].split(";")]
            assert directions == list(failure.lacking)
            assert row["degree of stability after (1/s)"] == row["k_rate (N m s)"] == row["settling time (s)"] == ""


def test_the_command(tmp_path):
    (tmp_path / "wheels.toml").write_text(BUILTIN.replace('"pyramid"', '"orthogonal"'))
    assert "1 and 2" in starhold("failures", "wheels.toml", cwd=tmp_path, code=0).stdout
    folder = tmp_path / "results" / "wheels-orbital-failures"
    assert sorted(path.name for path in folder.iterdir()) == ["failures.csv", "failures.png"]
    complains(starhold("failures", "wheels.toml", cwd=tmp_path))
    assert starhold("failures", "wheels.toml", "--law", "uncompensated", "--force", cwd=tmp_path).returncode == 0


@pytest.mark.parametrize("words", [("three-laws",), ("wheels-orbital", "--law", "nobody")])
def test_what_cannot_be_is_said_in_one_line(words, tmp_path):
    complains(starhold("failures", *words, cwd=tmp_path))
    assert not list(tmp_path.iterdir())


def intact_and_struck(law, folder, capsys):
    """A law flown for an instant on all wheels and on three: what is found, what is printed of it, and its table."""
    scenario = parse(f"{BUILTIN}\n[[law]]\n{law}", "here")
    entry, table = scenario.laws[-1], scenario.table.simulation.model_copy(update={"duration": 0.2})
    short = replace(scenario, table=scenario.table.model_copy(update={"simulation": table}))
    found = [_flown(short, entry, _left(wheels_of(short), lost, 0.02)) for lost in ((), (1,))]
    result = present(short, entry, found)
    print_blocks(result.blocks)
    write_table(result.numbers, folder / "table.csv")
    assert save(result.figure(), folder / "picture.png").is_file()
    rows = csv.DictReader((folder / "table.csv").read_text(encoding="utf-8").splitlines())
    return found, " ".join(capsys.readouterr().out.split()), list(rows)


def test_names_among_the_gains_are_told_as_they_are_written(tmp_path, capsys):
    law = 'type = "mpc"\nq_attitude = 0.2\nq_rate = 0.2\nr = 50.0\nlimit = "norm"\n'
    _, said, rows = intact_and_struck(law, tmp_path, capsys)
    assert "The gains are the same in all of them." in said
    assert [row["limit (1)"] for row in rows] == ["norm", "norm"]


@pytest.mark.slow
def test_the_losses_that_a_mode_waits_for_are_no_gain(tmp_path, capsys):
    gains = 'type = "wheel"\nk_rate = 0.6\nk_attitude = 0.01\n'
    law = 'type = "modes"\nquaternion_sign = "shortest"\non_loss = "safe"\nwheels_lost = 2\n'
    law += f'[[law.mode]]\nname = "work"\n{gains}[[law.mode]]\nname = "safe"\n{gains}'
    _, said, _ = intact_and_struck(law, tmp_path, capsys)
    assert "wheels_lost" not in said
    assert ("not settled: judged at the end of the flight" in said) == ("not settled" in said.replace("not settled:", ""))
    assert "The gains are the same in all of them." in said


def test_a_law_that_what_is_left_does_not_suit_leaves_the_rest_of_the_study(tmp_path, capsys):
    law = 'type = "pd"\nk_rate = 0.3\nk_attitude = 0.013\nlimit = "axis"\n'
    (intact, struck), said, rows = intact_and_struck(law, tmp_path, capsys)
    assert intact.gains is not None
    assert intact.refused == ""
    assert struck.gains is None
    assert struck.authority > 0.0
    words = 'without 1 not flown: limit = "axis" needs k_attitude below the torque limit of 0.011547 N m, not 0.013 N m'
    assert words in said
    assert [bool(row["not flown because"]) for row in rows] == [False, True]
