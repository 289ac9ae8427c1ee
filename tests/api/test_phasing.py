"""Sheets of signs and axes: what they show, and whether mistakes that are planted are found by name."""

import csv
import io
import random
from functools import cache

import numpy as np
import pytest

import starhold as sh
from starhold.studies.phasing_verdict import NEAR, Mistake, explained, mistakes_of, outputs
from tests.refusals import complains, refused
from tests.running import starhold
from tests.tiers import leading

LOOPS = ("cubesat-nadir", "three-laws", "cubesat-detumble")
EASY, PLANTED = 8, 200


@cache
def sheet_of(name):
    return sh.phasing(name).sheet


def simulated(sheet, mistakes, noise=0.0, seed=0):
    """The column `seen` of a sheet with these mistakes, by a hand that is not quite exact."""
    draw, values, shown = random.Random(seed), [], {}
    picks = {mistake.stage: mistake.place for mistake in mistakes}
    for place, stimulus in enumerate(sheet.stimuli):
        said = {}
        for number, stage in enumerate(sheet.stages):
            if stage in stimulus.live:
                (shown[place, number],) = outputs(stimulus, stage, said, [picks.get(stage, 0)])
                said[stage] = shown[place, number]
    for cell in sheet.cells:
        largest = np.abs(shown[cell.at][slice(*cell.block)]).max()
        error = noise * draw.uniform(-1.0, 1.0) * largest
        values.append((180.0 / np.pi if "deg" in cell.unit else 1.0) * float(shown[cell.at][cell.place] + error))
    return values


def planted(sheet, seed):
    """One or two random mistakes of different stages that the sheet shows."""
    draw = random.Random(seed)
    stages = [sheet.stages[k] for k in sorted({cell.at[1] for cell in sheet.cells})]
    chosen = sorted(draw.sample(stages, draw.choice((1, 2))), key=stages.index)
    return tuple(Mistake(stage, draw.randrange(1, len(mistakes_of(stage)))) for stage in chosen)


def expected_sizes(sheet):
    """For each cell the largest expected number of its vector."""
    cells = sheet.cells
    return np.array([max(abs(c.value) for c in cells if (c.at, c.block) == (cell.at, cell.block)) for cell in cells])


@pytest.mark.parametrize(("first", "last"), leading([(0, EASY), (EASY, PLANTED)]))
def test_planted_mistakes_are_found_by_name(first, last):
    alone = 0
    for seed in range(first, last):
        sheet = sheet_of(LOOPS[seed % len(LOOPS)])
        mistakes = planted(sheet, seed)
        found = explained(sheet, simulated(sheet, mistakes, noise=0.05, seed=seed))
        assert mistakes in found, (seed, [mistake.sentence for mistake in mistakes])
        exact = simulated(sheet, mistakes)
        for other in found:
            # Nothing else is named but what differs by less than the hand does.
            gap = np.abs(np.subtract(simulated(sheet, other), exact))
            assert (gap <= NEAR * expected_sizes(sheet)).all(), (seed, other)
        alone += found == [mistakes]
    assert alone >= 0.98 * (last - first)


@pytest.mark.slow
def test_what_no_row_tells_apart_is_named_together():
    sheet = sheet_of("cubesat-nadir")
    reversed_ = next(stage for stage in sheet.stages if stage.kind == "share" and stage.part == "wheels")
    everything = next(k for k, matrix in enumerate(mistakes_of(reversed_)) if (matrix == -np.eye(4)).all())
    values = simulated(sheet, [Mistake(reversed_, everything)])
    whole = [mistake.sentence for found in explained(sheet, values) for mistake in found]
    assert whole == ["wheels, by wheel: all reversed"]
    # Whoever reads the torque on the body alone cannot tell a cable from a mounting.
    torque = [value if "torque on" in cell.stage else None for cell, value in zip(sheet.cells, values, strict=True)]
    torque = [value if "wheels" in cell.stage else None for cell, value in zip(sheet.cells, torque, strict=True)]
    left = {mistake.sentence for found in explained(sheet, torque) for mistake in found}
    assert left == {"wheels, by wheel: all reversed", "wheels as mounted: all reversed"}


def test_the_sheet_of_a_cubesat_has_every_sensor_and_actuator():
    cells = sheet_of("cubesat-nadir").cells
    signs = {}
    for cell in cells:
        signs.setdefault((cell.stimulus, cell.stage), []).append(cell.sign)
    for k, axis in enumerate("xyz"):
        along = ["+" if place == k else "0" for place in range(3)]
        against = [sign.replace("+", "-") for sign in along]
        turning = f"turn at +10 deg/s about {axis}"
        assert signs[turning, "gyro: rate"] == signs[turning, "mekf: rate"] == along
        # The law damps, whichever way the craft turns.
        assert signs[turning, "lyapunov: command"] == signs[turning, "wheels: torque on the body"] == against
        turned = f"turn by +10 deg about {axis}"
        assert signs[turned, "star-tracker: attitude"] == signs[turned, "mekf: attitude"] == along
        assert signs[turned, "lyapunov: command"] == against
        assert signs[f"magnetic field along +{axis}", "magnetometer: magnetic field"] == along
        assert signs[f"torque +{axis}", "wheels: torque on the body"] == along
        assert signs[f"momentum +{axis}, field +{'yzx'[k]}", "magnetic-unloading: torque on the body"] == against
        # What wheels of a pyramid take is minus the body's torque along their axes.
        axes = np.array(sh.stepper("cubesat-nadir").loop.wheels.axes)[:, k]
        assert signs[f"torque +{axis}", "wheels: motor torque"] == ["-" if share > 0 else "+" for share in axes]
    gyro = next(cell for cell in cells if cell.stage == "gyro: rate")
    assert gyro.value == pytest.approx(10.02), "10 deg/s and the bias"


def test_a_loop_without_sensors_says_so():
    shown = sh.phasing("three-laws")
    assert shown.outcome == "met"
    assert shown.sheet.notes == ["The loop has no sensors: the law is given the true state."]
    assert {cell.stage for cell in shown.sheet.cells} == {"lyapunov: command", "actuators: torque on the body"}
    quiet = sheet_of("cubesat-detumble")
    assert quiet.notes == ["b-dot: this law commands nothing at its first instant; the sheet begins with a torque."]


@pytest.mark.slow
def test_a_sheet_is_written_filled_in_and_judged(tmp_path):
    done = starhold("phasing", "cubesat-nadir", "-o", "out", cwd=tmp_path, code=0)
    assert "magnetic-unloading: dipole" in done.stdout
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["phasing.csv", "phasing.html", "phasing.md"]
    page = (tmp_path / "out" / "phasing.html").read_text(encoding="utf-8")
    assert "turn at +10 deg/s about x" in page
    text = (tmp_path / "out" / "phasing.csv").read_text(encoding="utf-8")
    rows = list(csv.DictReader(io.StringIO(text)))
    assert len(rows) == len(sheet_of("cubesat-nadir").cells)
    assert set(rows[0]) == {"stimulus", "stage", "axis", "expected sign", "expected value", "unit", "seen"}

    def judge(code, seen):
        with (tmp_path / "seen.csv").open("w", encoding="utf-8", newline="") as file:
            table = csv.DictWriter(file, list(rows[0]))
            table.writeheader()
            table.writerows(row | {"seen": seen(row)} for row in rows)
        words = ("phasing", "cubesat-nadir", "--check", "seen.csv", "-o", "judged", "--force")
        return starhold(*words, cwd=tmp_path, code=code)

    assert "All signs are right." in judge(0, lambda row: row["expected sign"]).stdout
    judged = (tmp_path / "judged" / "phasing.csv").read_text(encoding="utf-8")
    assert [row["seen"] for row in csv.DictReader(io.StringIO(judged))] == [row["expected sign"] for row in rows]
    assert "of 162 rows are empty" in judge(4, lambda row: row["expected sign"] if row["axis"] == "x" else "").stdout
    small = judge(4, lambda row: float(row["expected value"]) / (57.3 if row["stage"] == "gyro: rate" else 1.0)).stdout
    assert "gyro: rate: 0.017 times the expected magnitude" in small
    wheels = simulated(sheet_of("cubesat-nadir"), [Mistake(sheet_of("cubesat-nadir").stages[5], 1)])
    values = iter(wheels)
    assert "A sign is wrong. wheels, by wheel: 1 reversed." in judge(3, lambda row: next(values)).stdout
    assert "no mistake of one or two parts explains" in judge(3, lambda row: "0").stdout
    complains(judge(2, lambda row: "maybe"), "seen.csv: row 2, seen: found maybe; allowed: a number, or a sign")
    complains(judge(2, lambda row: ""), "seen.csv: seen: found nothing filled in")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a,b\n1,2\n", ["no column stimulus"]),
        (
            "stimulus,stage,axis,seen\ntorque +w,gyro: rate,x,+\n",
            ["row 2, stimulus: found torque +w", "did you mean torque +"],
        ),
        ("stimulus,stage,axis,seen\ntorque +x,gyro: rate,x,+\n", ["row 2", "gyro: rate x under this stimulus"]),
        ("stimulus,stage,axis,seen\n" + 2 * "turn at +10 deg/s about x,gyro: rate,x,+\n", ["row 3", "twice"]),
        ("stimulus,stage,axis,seen\nturn at +10 deg/s about x,gyro: rate,x\n", ["nothing filled in"]),
        (
            "stimulus,stage,axis,expected sign,seen\nturn at +10 deg/s about x,gyro: rate,x,-,-\n",
            ["row 2, expected sign: found -; allowed: +", "another scenario"],
        ),
    ],
)
def test_a_bad_sheet_is_refused_in_one_line(tmp_path, text, words):
    (tmp_path / "seen.csv").write_text(text, encoding="utf-8")
    with refused(*words, start=str(tmp_path / "seen.csv")):
        sh.phasing("cubesat-nadir", check=str(tmp_path / "seen.csv"))


def test_no_sheet_is_no_fault_of_the_program():
    with refused("No such file", start="none.csv"):
        sh.phasing("cubesat-nadir", check="none.csv")
