"""What laws know of the numbers that a campaign draws: what the file has, unless they are told each drawn value."""

import re

import pytest

import starhold as sh
from starhold.campaign.campaign import begin, with_campaign
from starhold.errors import InputError
from starhold.scenario.building import build
from starhold.studies.body import study_of
from starhold.studies.compare import compare, record
from tests.campaign.flown import SMALL, fly, normal, short, uniform

INERTIA = normal("4 %", relative=True)
LIMIT = uniform(0.05, 0.2)
LYAPUNOV = SMALL["law"][1]
DESIGNED = {"type": "lqr", "form": "II", "q": 1.0, "r": 0.5}


def turn(laws=(LYAPUNOV,), **tables):
    """Ten seconds from a turn at rest."""
    return short(10.0, laws, **{"initial": {"attitude": [0.9, 0.1, -0.3, 0.2]}} | tables)


def measured(scenario):
    """The metrics of a scenario's first law, from a recording of every control step."""
    return study_of(scenario.body).metrics_of(record(scenario, build(scenario, scenario.laws[0])))


def drawn(row, key="spacecraft.inertia"):
    return [row[f"{key}[{k}]"] for k in (1, 2, 3)]


def test_a_drawn_inertia_is_not_told_to_the_law_unless_it_is_said():
    """Against what needs no campaign: a fault at the start that nobody notices, or another craft."""
    scenario, flown = turn(), []
    for known in ({}, {"known_to_law": True}):
        frame = fly(scenario=scenario, over={"spacecraft.inertia": INERTIA | known}, requirement=[], runs=8).frame()
        assert (frame["flown.craft.inertia[1]"] == frame["spacecraft.inertia[1]"]).all()
        efforts = []
        for _, row in frame.iterrows():
            inertia = drawn(row)
            unnoticed = {"fault": [{"time": 0.0, "inertia": inertia, "action": "none"}]}
            other = scenario.with_({"spacecraft.inertia": inertia} if known else unnoticed)
            efforts.append(measured(other.with_({"simulation.run": int(row["run"])}))["effort"])
        assert frame["effort"].to_numpy() == pytest.approx(efforts, rel=1e-12)
        flown.append(frame["effort"])
    assert (flown[0] != flown[1]).all()


def test_gains_stay_designed_for_the_nominal_craft():
    scenario = turn((DESIGNED,))
    for told in (False, True):
        over = {"spacecraft.inertia": INERTIA | {"known_to_law": told}}
        found = fly(scenario=scenario, over=over, requirement=[], runs=5)
        again = found.again(3).scenario
        own = build(again, again.laws[0])
        nominal = build(scenario, scenario.laws[0])
        assert (own.gains == nominal.gains) != told
        assert (own.known.inertia == nominal.craft.inertia) != told
        assert own.craft.inertia == pytest.approx(drawn(found.frame().iloc[3]), rel=1e-15)


def test_a_torque_is_shared_out_among_wheels_as_they_are_supposed_to_be():
    laws = ({"type": "wheel", "k_rate": 1.5, "k_attitude": 0.6},)
    wheels = {"inertia": 1e-3, "torque_limit": 0.2, "momentum_limit": 4.0}
    scenario = turn(laws, wheels=wheels, wheel=[{"axis": axis} for axis in ([1, 0, 0], [0, 1, 0], [0, 0, 1])])
    over = {"wheel[2].axis[1]": normal(0.02), "wheels.inertia": INERTIA}
    again = fly(scenario=scenario, over=over, requirement=[], runs=3).again(2).scenario
    own, nominal = (build(one, one.laws[0]).wheels for one in (again, scenario))
    assert own.axes != nominal.axes
    assert own.least == nominal.least


def test_the_verdict_says_what_the_law_knows():
    asked = [{"metric": "effort", "at_most": 9, "share": 0.5}]
    over = {"spacecraft.inertia": INERTIA, "spacecraft.torque_limit": LIMIT | {"known_to_law": True}}
    (law,) = fly(scenario=turn(), over=over, requirement=asked, runs=5).laws
    told = law.verdicts[0].sentence()
    assert told.endswith(
        "The law assumes the file's value of spacecraft.inertia, and knows each drawn value of spacecraft.torque_limit."
    )
    for action, told in (
        ("none", "never learns the drawn value of"),
        ("reallocate", "learns at the diagnosis each drawn value of"),
    ):
        scenario = turn(fault=[{"time": 1.0, "inertia": [2.2, 3.1, 4.4], "action": action}])
        (law,) = fly(scenario=scenario, over={"fault[1].inertia": INERTIA}, requirement=asked, runs=5).laws
        assert law.verdicts[0].sentence().endswith(f"The law {told} fault[1].inertia.")
    rate = {"initial.rate": normal(0.01)}
    (law,) = fly(scenario=turn(), over=rate, requirement=asked, runs=5).laws
    assert "The law" not in law.verdicts[0].sentence()


@pytest.mark.parametrize(
    ("over", "told"),
    [
        ({"spacecraft.inertia": INERTIA | {"known": True}}, "known: found an old name; allowed: judged_apart, its new name"),
        ({"sensor.rate_noise": LIMIT | {"known_to_law": True}}, "false, because no law receives it"),
        ({"law.lyapunov.k_rate": LIMIT | {"known_to_law": True}}, "false, because no law receives it"),
        ({"initial.rate[1]": LIMIT | {"known_to_law": True}}, "false, because no law receives it"),
        (
            {"fault[1].inertia": INERTIA | {"known_to_law": True}},
            "false, because the action on a fault determines what laws learn about it",
        ),
    ],
)
def test_what_no_law_can_know_and_the_old_name_are_refused(over, told):
    unnoticed = {"time": 1.0, "inertia": [2.2, 3.1, 4.4], "action": "none"}
    scenario = turn(initial={"rate": [0.01, 0.0, 0.0]}, fault=[unnoticed])
    with pytest.raises(InputError, match=re.escape(told)):
        begin(with_campaign(scenario, {"over": over, "runs": 3}), ["lyapunov"])


MODELLED = """
from typing import Annotated, NamedTuple
from starhold.parts.contract import Card, Parameter
CARD = Card("A leak", "M = const", ("none",), ("constant",))
ROLE = "environment"
MODELLED = True
class Params(NamedTuple):
    torque: Annotated[tuple, Parameter("N m", shape=(3,), text="of the leak")]
def torque(state, params, craft, memory):
    return params.torque
def examples():
    return [Params((1e-3, 0.0, 0.0))]
"""


@pytest.mark.slow
def test_what_every_command_is_computed_with_is_drawn_only_as_known(tmp_path):
    """Else a verdict would be that of a law that is told, and not say so."""
    (tmp_path / "leak.py").write_text(MODELLED, encoding="utf-8")
    leak = {"file": "leak.py", "torque": [1e-3, 0.0, 0.0]}
    thrusters = {"type": "thrusters", "torque": [0.2, 0.2, 0.2]}
    asked = [{"metric": "effort", "at_most": 9, "share": 0.5}]
    for part, key in ((leak, "part.leak.torque"), (thrusters, "part.thrusters.torque")):
        scenario = short(4.0, [LYAPUNOV], folder=tmp_path, part=[part])
        with pytest.raises(
            InputError, match="known_to_law: found false; allowed: true, because laws compute their commands"
        ):
            begin(with_campaign(scenario, {"over": {key: normal(1e-4)}, "runs": 3}), ["lyapunov"])
        over = {key: normal(1e-4, known_to_law=True)}
        (law,) = fly(scenario=scenario, over=over, requirement=asked, runs=5).laws
        assert law.verdicts[0].sentence().endswith(f"The law knows each drawn value of {key}.")
    over = {"part.thrusters.lever": normal(0.1)}
    (law,) = fly(scenario=scenario, over=over, requirement=asked, runs=5).laws
    assert "The law" not in law.verdicts[0].sentence()


def test_a_scenario_may_say_what_its_laws_suppose():
    supposed = turn().with_({"nominal": {"spacecraft": {"inertia": [2.5, 3.0, 4.0], "torque_limit": 0.3}}})
    own = build(supposed, supposed.laws[0])
    assert (own.craft.inertia, own.known.inertia) == ((2.0, 3.0, 4.0), (2.5, 3.0, 4.0))
    unnoticed = turn().with_(
        {"spacecraft.inertia": [2.5, 3.0, 4.0], "fault": [{"time": 0.0, "inertia": [2.0, 3.0, 4.0], "action": "none"}]}
    )
    assert measured(supposed)["effort"] == measured(unnoticed)["effort"]
    assert compare(supposed)[0].certificates == ()
    with pytest.raises(InputError, match=r"nominal: found a \[nominal\] table that differs from the craft"):
        sh.certify(supposed)
    with pytest.raises(InputError, match=r"nominal.sensor: found a table that laws are not designed for"):
        supposed.with_({"nominal.sensor": {"rate_noise": 0.1}})
    with pytest.raises(InputError, match=r"nominal.spacecraft.inertia: found nothing"):
        supposed.with_({"nominal.spacecraft": {"torque_limit": 0.1}})
    # A campaign over it leaves what the file says of the law's knowledge.
    found = fly(scenario=supposed, over={"spacecraft.inertia": INERTIA}, requirement=[], runs=3)
    again = found.again(1).scenario
    assert build(again, again.laws[0]).known.inertia == (2.5, 3.0, 4.0)


def test_after_a_diagnosed_loss_a_law_keeps_to_the_limit_that_it_takes_for_true():
    inertia = sh.load("wheels-orbital").table.spacecraft.inertia
    told = {"nominal": {"spacecraft": {"inertia": inertia, "torque_limit": 1e-4}}}
    lost = {"time": 2.0, "wheel": 2, "lost": True, "action": "reallocate", "delay": 1.0}
    scenario = sh.load("wheels-orbital").with_({**told, "fault": [lost], "simulation.duration": 10.0})
    events = build(scenario, scenario.laws[0]).events
    assert {event.nominal.torque_limit for event in events} == {1e-4}
