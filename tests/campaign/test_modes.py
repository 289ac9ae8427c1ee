"""Campaigns count when modes begin, false alarms and missed detections as the recordings of their runs have them."""

import numpy as np
import pytest

import starhold as sh
from starhold.errors import InputError
from starhold.scenario.reading import parse
from starhold.studies.compare import record
from starhold.studies.verification import by_flight
from tests.making import built
from tests.missions import GUARDED, SAFE, WHEELS, cubesat, mode
from tests.refusals import refused, replaced
from tests.texts import toml

FAULT = '[[part]]\ntype = "gyro"\nnoise = 1e-5\n[[fault]]\ntime = 40\nwheel = 1\nlost = true\ndelay = 30\n'
SPIN = '[[law.monitor]]\nname = "spin"\nkind = "range"\nreading = "rate"\nlimit = "2.4 deg/s"\n'
ASKED = toml("""
[[requirement]] id = "FDIR-1"; method = "campaign"; metric = "mode_begins"; in_mode = "safe"; at_most = "0.01 orbits"
[[requirement]] id = "FDIR-2"; method = "campaign"; metric = "missed_detections"; at_most = 0
[campaign] runs = 24
[campaign.over] "initial.rate" = { distribution = "normal", sigma = "0.7 deg/s" }
""")
DRAWN = '"fault[1].time" = { distribution = "uniform", low = 5, high = 95 }\n'

GUARD = GUARDED.replace('"safe"', '"safe"\nfault_action = "reallocate"')
TEXT = cubesat(WHEELS, FAULT, ASKED, DRAWN, GUARD, SPIN, duration=100, rate=(0.02, -0.01, 0.02))
TEXT = TEXT.replace('torque_limit = "2 mN m"\n[orbit]', "[orbit]") + mode("work", 'effectors = ["wheels"]') + SAFE


def own_flight(text, row, run):
    """The recording of a run's own scenario."""
    drawn = {name: row[name] for name in row.index if name == "fault[1].time"}
    rate = [row[f"initial.rate[{k}]"] for k in (1, 2, 3)]
    own = parse(text, "m.toml").with_({**drawn, "initial.rate": rate, "simulation.run": run})
    return record(own, built(own))


@pytest.mark.slow
def test_alarms_are_those_of_each_runs_own_flight(tmp_path):
    text = TEXT[: TEXT.index("[[requirement]]")] + TEXT[TEXT.index("[campaign]") :]
    frame = sh.campaign(parse(text, "m.toml"), tmp_path / "c").frame()
    for run, row in frame.iterrows():
        flight, struck = own_flight(text, row, run), round(row["fault[1].time"] / 0.5)
        trips = flight["trips"]
        assert row["false_alarms"] == trips[struck - 1]
        assert row["missed_detections"] == float(trips[-1] == trips[struck - 1])
    assert 2 < (frame["false_alarms"] > 0.0).sum() < 22
    assert 2 < (frame["missed_detections"] > 0.0).sum() < 22


PARTS = toml("""
[[requirement]] id = "EARLY"; method = "campaign"; metric = "peak_attitude_error"; window = ["10 s", "20 s"]
at_most = "20 deg"
[[requirement]] id = "LATE"; method = "campaign"; metric = "peak_rate_error"; in_mode = "safe"; after = "5 s"
at_most = "2 deg/s"
[campaign]""")


def test_errors_in_a_window_or_a_mode_are_those_of_each_runs_own_flight():
    text = replaced(TEXT[: TEXT.index("[[requirement]]") - 1] + TEXT[TEXT.index("[campaign]") :], "[campaign]", PARTS)
    frame, never = sh.campaign(parse(text, "m.toml"), search=False).frame(), 0
    for run, row in frame.iterrows():
        flight = own_flight(text, row, run)
        angles = 2.0 * np.arcsin(np.linalg.norm(flight["attitude_error"][20:41, 1:], axis=1))
        assert row["peak_attitude_error of EARLY"] == pytest.approx(angles.max(), rel=1e-12)
        late = (flight["mode"] == 2.0) & (flight["time_in_mode"] >= 5.0)
        rates = np.linalg.norm(flight["rate_error"][late], axis=1)
        never += not late.any()
        if late.any():
            assert row["peak_rate_error of LATE"] == pytest.approx(rates.max(), rel=1e-12)
            assert row["margin.LATE"] == np.radians(2.0) - row["peak_rate_error of LATE"]
        else:
            assert np.isnan(row["peak_rate_error of LATE"])
            assert row["margin.LATE"] == -np.inf
    assert 2 < never < 22
    for old, new, *words in (
        ('in_mode = "safe"', 'in_mode = "rest"', "requirement[2].in_mode", "a mode of every law that is flown"),
        ('"20 s"]', '"200 s"]', "requirement[1].window", "between 0 s and the flight's 100 s"),
        ('"peak_rate_error"', '"effort"', "peak_attitude_error or peak_rate_error, of runs in a mode or a window"),
    ):
        with refused(*words):
            sh.campaign(parse(replaced(text, old, new), "m.toml"), search=False)


@pytest.mark.slow
def test_begins_are_those_of_each_runs_own_flight(tmp_path):
    text = replaced(TEXT, DRAWN, "")
    frame = sh.campaign(parse(text, "m.toml"), tmp_path / "c").frame()
    for run, row in frame.iterrows():
        flight = own_flight(text, row, run)
        assert row["begin of safe"] == flight["time"][np.argmax(flight["mode"] == 2.0)]
    late = frame["begin of safe"] > 0.01 * 5677.0
    assert (late == (frame["margin.FDIR-1"] < 0.0)).all()
    assert 2 < late.sum() < 22


def test_a_flight_is_asked_when_a_mode_begins():
    asked = replaced(
        TEXT[: TEXT.index("[campaign]")] + TEXT[TEXT.index("[[law]]") :],
        '"campaign"\nmetric = "mode',
        '"flight"\nmetric = "mode',
    )
    asked = asked.replace(
        '[[requirement]]\nid = "FDIR-2"\nmethod = "campaign"\nmetric = "missed_detections"\nat_most = 0\n', ""
    )
    scenario = parse(asked, "m.toml")
    verdict = by_flight(scenario, scenario.laws[0], record(scenario, built(scenario)))["requirement[1]"]
    assert (verdict.verdict, verdict.number, verdict.typed_unit) == ("missed", 70.0, "orbits")
    assert verdict.limit == pytest.approx(0.01 * 5677.0, rel=1e-3)


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        (
            'in_mode = "safe"\n',
            "",
            'requirement[1].in_mode: found nothing; allowed: the name of the mode, with metric = "mode_b',
        ),
        ('in_mode = "safe"', 'in_mode = "save"', 'requirement[1].in_mode: found "save"; allowed: a mode of every law'),
        ('in_mode = "safe"', 'in_mode = "safe"\nafter = 5', "requirement[1].after: found 5; allowed: no such key, with"),
        ('"0.01 orbits"', '"2 laps"', 'requirement[1].at_most: found "2 laps"; allowed: a quantity in s'),
    ],
)
def test_a_requirement_on_a_mode_that_cannot_be_is_told_in_one_line(tmp_path, old, new, told):
    with pytest.raises(InputError) as caught:
        sh.campaign(parse(replaced(TEXT, old, new), "m.toml"), tmp_path / "c")
    assert told in str(caught.value)
