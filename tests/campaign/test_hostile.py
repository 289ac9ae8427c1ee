"""Campaigns of what nobody expects: names alike, files that change, results of others, designs flown to their end."""

import math
import warnings

import numpy as np
import pytest

from starhold.campaign.campaign import with_campaign
from starhold.errors import InputError
from starhold.report.campaign_page import write_campaign
from tests.campaign.flown import SMALL, fly, normal, short, small, uniform
from tests.parts.files import ENVIRONMENT
from tests.refusals import refused
from tests.tiers import leading

NORMAL = normal(0.01)


def campaign(folder, scenario=None, **options):
    asked = {"runs": 12, "over": {"initial.rate": NORMAL}, "requirement": []} | options
    return fly(folder, scenario=scenario or short(), **asked)


def laws(*names):
    return [SMALL["law"][0] | {"name": name} for name in names]


def test_names_that_differ_in_case_alone_are_refused(tmp_path):
    """They would be one column in SQL, and one folder on some disks."""
    with pytest.raises(InputError, match="names that differ by more than case"):
        campaign(tmp_path / "c", short(laws=laws("A", "a")))
    alike = [{"id": name, "metric": "effort", "at_most": 3} for name in ("Straße", "STRASSE")]
    with pytest.raises(InputError, match=r"requirement\[2\].id: found \"STRASSE\""):
        campaign(tmp_path / "c", requirement=alike)
    assert not (tmp_path / "c").exists()


def test_columns_of_metrics_and_of_requirements_stay_apart(tmp_path):
    asked = [{"id": "effort", "metric": "final_rate_error", "at_most": 0.5}, {"id": "run", "metric": "lost"}]
    frame = campaign(tmp_path / "c", requirement=asked).frame()
    assert (frame["margin.effort"] == 0.5 - frame["final_rate_error"]).all()
    assert (frame["margin.run"] == 1.0).all()
    assert frame["run"].tolist() == list(range(12))


def test_each_worst_run_has_a_file_of_its_own(tmp_path, brief):
    long = "ü" * 100
    asked = [{"id": name, "metric": "effort", "at_most": bound} for name, bound in (("a b", 3), ("a-b", 2), (long, 1))]
    found = campaign(tmp_path / "c", short(laws=laws(long, "pd")), requirement=asked, search=True, runs=2)
    files = [bracket.file for law in found.laws for bracket in law.brackets]
    assert len({file.casefold() for file in files}) == 6
    assert {"worst-pd-a-b.toml", "worst-pd-a-b-2.toml"} <= {*files}
    assert sorted(path.name for path in found.folder.glob("worst-*")) == sorted(files)


def test_a_metric_that_no_run_has_is_searched_without_a_warning(tmp_path, brief):
    asked = [{"metric": "settling_time", "at_most": 1}]
    found = campaign(tmp_path / "c", requirement=asked, search=True, over={"initial.rate": uniform(1.0, 2.0)})
    assert math.isnan(found.laws[0].brackets[0].flown)


@pytest.mark.parametrize("sampling", leading(["sobol", "morris", "saltelli", "latin-hypercube"], 2))
def test_designs_are_flown_to_their_indices(tmp_path, sampling):
    over = {"spacecraft.inertia[3]": uniform(3.9, 4.1), "law.pd.k_rate": uniform(1.0, 3.0)}
    asked = [{"metric": "final_rate_error", "at_most": 1, "share": 0.5}]
    found = campaign(tmp_path / "c", over=over, requirement=asked, sampling=sampling, runs=96)
    indices = found.laws[0].indices
    assert bool(indices) == (found.laws[0].drivers is None)
    assert found.laws[0].verdicts[0].lower is None
    page = write_campaign(with_campaign(short(), {"over": over, "requirement": asked}), found).read_text()
    assert (sampling in ("morris", "saltelli")) == bool(indices) == ("<h2>Sensitivity indices</h2>" in page)
    if indices:
        index = indices["final_rate_error"]
        told = index.mu_star if sampling == "morris" else index.total
        assert index.names == tuple(over)
        assert told[1] > 5.0 * told[0] > 0.0
        if sampling == "morris":
            # Three quarters of the range lie between the levels.
            gains = found.frame().sort_values("law.pd.k_rate")
            assert gains["law.pd.k_rate"].min() == 1.25
            assert gains["law.pd.k_rate"].max() == 2.75
            ends = gains["final_rate_error"].iloc[[0, -1]].to_numpy()
            assert index.mu[1] == pytest.approx(ends[1] - ends[0], rel=0.1)


def test_a_part_of_ones_own_is_flown_and_its_change_refused(tmp_path):
    (tmp_path / "slow.py").write_text(ENVIRONMENT)
    scenario = short(folder=tmp_path, part=[{"file": "slow.py", "name": "a.b c", "drag": 0.1}])
    over = {"part.a.b c.drag": uniform(0.05, 0.2)}
    found = campaign(tmp_path / "c", scenario, over=over)
    frame = found.frame()
    flown = [name for name in frame.columns if name.startswith("flown.")]
    assert any((frame[name] == frame["part.a.b c.drag"]).all() for name in flown)
    assert found.again(3).differs == ()
    (tmp_path / "slow.py").write_text(ENVIRONMENT.replace("-params.drag", "-2.0 * params.drag"))
    with pytest.raises(InputError, match=r"slow.py: found a file changed since the campaign"):
        found.again(3)
    with pytest.raises(InputError, match=r'campaign.files."slow.py": ".*, was "'):
        campaign(tmp_path / "c", scenario, over=over, resume=True, runs=20)
    (tmp_path / "slow.py").write_text(ENVIRONMENT)
    assert campaign(tmp_path / "c", scenario, over=over, resume=True).flown == 0


@pytest.mark.slow
def test_a_table_that_a_scenario_names_is_part_of_it(tmp_path):
    (tmp_path / "att.csv").write_text("time,q0,q1,q2,q3\n0,1,0,0,0\n10,0.8,0.6,0,0\n")
    scenario = short(folder=tmp_path, target={"mode": "history", "file": "att.csv"})
    assert campaign(tmp_path / "c", scenario).again(1).differs == ()
    (tmp_path / "att.csv").write_text("time,q0,q1,q2,q3\n0,1,0,0,0\n10,0.6,0.8,0,0\n")
    with pytest.raises(InputError, match=r'campaign.files."att.csv"'):
        campaign(tmp_path / "c", scenario, resume=True)
    # By whatever key.
    (tmp_path / "torque.csv").write_text("0,0,0,0\n9,1e-3,0,0\n")
    scenario = short(folder=tmp_path, part=[{"type": "torque-table", "table": "torque.csv"}])
    campaign(tmp_path / "d", scenario)
    (tmp_path / "torque.csv").write_text("0,0,0,0\n9,2e-3,0,0\n")
    with pytest.raises(InputError, match=r'campaign.files."torque.csv"'):
        campaign(tmp_path / "d", scenario, resume=True)


def test_warnings_of_single_runs_are_not_told(tmp_path):
    """A short flight of a craft some of whose orbits meet the ground later on."""
    orbit = {"position": ["7000 km", 0, 0], "velocity": [0, "7.55 km/s", 0]}
    scenario = short(orbit=orbit, environment={"gravity_gradient": True})
    over = {"orbit.velocity": normal("5 km/s")}
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        campaign(tmp_path / "c", scenario, over=over, runs=60)
    assert not told


def test_values_of_other_libraries_and_single_runs(tmp_path):
    over = {"initial.rate": uniform(np.full(3, -0.01), np.float64(0.02))}
    found = campaign(str(tmp_path / "it's"), over=over, runs=np.int64(7), seed=np.int32(3), metrics=("overshoot",))
    frame = found.frame()
    assert len(frame) == 7
    assert frame.filter(like="initial.rate").stack().between(-0.01, 0.02).all()
    single = campaign(tmp_path / "one", over={}, runs=1, requirement=[{"metric": "effort", "at_most": 9}], search=True)
    assert single.laws[0].brackets == ()
    assert single.again(0).differs == ()
    assert write_campaign(short(), single).exists()


WRONG = [
    ({"metrics": "overshoot"}, "campaign.metrics"),
    ({"requirement": {"metric": "lost"}}, "requirement"),
    ({"over": [1]}, "campaign.over"),
    ({"over": {"x" * 10_000: NORMAL}}, 'campaign.over."xxx'),
    ({"over": {"../initial.rate": NORMAL}}, "not a key"),
    ({"over": {"simulation.seed": uniform(1, 4)}}, "a key that all runs share"),
    ({"over": {"initial.rate": NORMAL | {"sigma": math.nan}}}, "sigma: found nan"),
    ({"over": {"initial.rate": uniform(0, math.inf)}}, "high: found inf"),
    ({"over": {"wheel[2].torque_limit": uniform(1, 2)}}, "wheel"),
    ({"over": {"orbit.altitude": uniform("600 km", "700 km")}}, "no [orbit] table"),
    ({"requirement": [{"metric": "effort", "at_most": math.nan}]}, "at_most: found nan"),
    ({"runs": 10**10}, "campaign.runs"),
    ({"law": "../pd"}, "law"),
    ({"over": {"initial.rate": NORMAL, "law.pd.k_rate": NORMAL}, "scenario": small(), "law": "lyapunov"}, "no effect"),
    ({"over": {"settling.rate_tolerance": uniform(0.01, 0.02)}}, "settling.rate_tolerance"),
    ({"over": {"spacecraft.inertia": NORMAL | {"sigma": 1.0}}, "runs": 90}, "moments"),
    ({"requirement": [{"metric": "settling_time"}]}, "at_most or at_least"),
    ({"requirement": [{"metric": "effort", "at_most": "3 deg"}]}, "deg"),
    ({"requirement": [{"metric": "exclusion-cone", "at_least": "3 deg"}]}, "axis"),
    ({"until_decided": True}, "requirement"),
    ({"requirement": [{"metric": "lost"}], "sampling": "sobol", "until_decided": True}, "independent"),
    ({"requirement": [{"metric": "effort", "at_most": 3, "share": 1}]}, "requirement[1].share: found 1.0; allowed: below 1"),
    ({"requirement": [{"metric": "effort", "at_most": 3, "at_least": 2}]}, "either at_most or at_least"),
    ({"requirement": [{"metric": "lost"}, {"metric": "lost"}]}, "requirement[2].id"),
    ({"sampling": "halton"}, "campaign.sampling"),
    ({"threads": 0}, "at least 1"),
]


@pytest.mark.parametrize(("options", "told"), WRONG)
def test_what_is_hostile_is_told_in_a_line(tmp_path, options, told):
    with refused(told) as failure:
        campaign(tmp_path / "c", **options)
    assert len(str(failure.value)) < 600
    assert not list((tmp_path / "c").rglob("*.parquet"))


def test_an_interrupt_leaves_what_can_be_resumed(tmp_path, monkeypatch):
    monkeypatch.setattr("starhold.campaign.campaign.CHUNK", 10)
    told = []

    def interrupt(law, count):
        told.append(count)
        if sum(told) > 25:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        campaign(tmp_path / "c", runs=60, progress=interrupt)
    again = campaign(tmp_path / "c", runs=60, resume=True)
    assert again.flown == 40
    assert again.digest == campaign(tmp_path / "whole", runs=60).digest
