"""Several estimators in a loop: one that the law uses, others that watch, or that give another one its first attitude."""

from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

import starhold as sh
from starhold.algebra.structure import flatten, leaves
from starhold.analysis.validity_notes import column_of
from starhold.certification.unmodelled import named
from starhold.export.law import flight_law
from starhold.loop.kernels import make_step
from starhold.parts.estimators import complementary_filter, quest
from starhold.report.attitude_plots import unsure
from starhold.scenario.building import build
from tests.parts.trackers import COMPLEMENTARY, FILTER, FIRST, GYRO, ORBIT, scenario
from tests.refusals import refused

SENSORS = (
    GYRO,
    {"type": "gnss"},
    {"type": "magnetometer", "noise": "30 nT"},
    {"type": "sun-sensor", "noise": "0.1 deg", "outage": [0.0, 5.0]},
    FIRST | {"outage": [0.0, 20.0]},
)
QUEST = {"type": "quest", "watches": True}
STARTED = COMPLEMENTARY | {"watches": True, "started_by": "quest"}


def flown(*estimators, **more):
    given = scenario(*SENSORS, *estimators, orbit=ORBIT, record_every=1, **more)
    return given, sh.simulate(given)


def test_who_watches_changes_nothing():
    """All that is recorded without watchers has the same bits with them; only their estimates are new."""
    (_, alone), (given, watched) = flown(FILTER), flown(FILTER, QUEST, STARTED)
    for name in alone:
        assert np.array_equal(alone[name].values, watched[name].values), name
    new = {name for name in watched if name not in alone}
    assert new == {f"quest_{name}" for name in quest.Estimate._fields} | {
        f"complementary_filter_{name}" for name in complementary_filter.Estimate._fields
    }
    # The law's estimate says whether the flight has a valid one, in metrics, figures and pages.
    assert column_of(watched, watched.attrs) == "mekf_is_valid"
    flight = sh.compare(given)[0]
    assert flight.metrics["invalid_share"] == 40 / 81
    assert unsure([flight]) == ((0.0, 20.0),)


def test_a_watcher_of_a_law_that_reads_its_sensors_says_nothing_of_the_law():
    given, run = flown(QUEST)
    assert column_of(run, run.attrs) is None
    assert "invalid_share" not in sh.compare(given)[0].metrics
    assert 0.1 < 1.0 - run["quest_is_valid"].values.mean() < 0.2


def test_a_watcher_makes_of_the_readings_what_its_equation_does():
    """Its file, called by hand on what was recorded, in a loop of its own."""
    given, run = flown(FILTER, QUEST, STARTED)
    loop = build(given, given.laws[0])
    fitted = {f.called: f for f in loop.parts}
    names = {"gyro": ("rate",), "gnss": ("position", "velocity"), "star-tracker": ("attitude", "attitude_is_new")}
    names |= {"magnetometer": ("magnetic_field", "magnetic_field_is_new"), "sun-sensor": ("sun", "sun_is_seen")}
    params = [fitted[name].prepared(loop.period) for name in ("quest", "complementary-filter")]
    memories = [quest.remember(params[0], loop.start), complementary_filter.remember(params[1], loop.start)]
    for k in range(len(run["time"])):
        every = [
            SimpleNamespace(**{n: _number(run[f"{part.replace('-', '_')}_{n}"].values[k]) for n in fields})
            for part, fields in names.items()
        ]
        readings = SimpleNamespace(**{n: x for one in every for n, x in vars(one).items()}, every=tuple(every))
        first, memories[0] = quest.estimate(readings, memories[0], params[0], loop.known, loop.period)
        readings.fix = first
        then, memories[1] = complementary_filter.estimate(readings, memories[1], params[1], loop.known, loop.period)
        for name, estimate in (("quest", first), ("complementary_filter", then)):
            for field, value in estimate._asdict().items():
                assert np.array_equal(run[f"{name}_{field}"].values[k], value), (k, name, field)


def _number(value):
    return float(value) if np.ndim(value) == 0 else tuple(value.tolist())


def test_an_estimator_gives_another_its_first_attitude():
    """QUEST sees Sun and field from 5 s on, the tracker stars from 20 s on: until then the filter carries QUEST's attitude
    on with the deviation stated for it, and a tracker's attitude is weighed against that as covariances say."""
    _, run = flown(FILTER | {"started_by": "quest", "start_deviation": "1 arcmin"}, QUEST)
    valid, time = run["mekf_is_valid"].values, run["time"].values
    assert valid.tolist() == (time >= 5.0).astype(float).tolist()
    begin, seen = np.flatnonzero(time == 5.0)[0], np.flatnonzero(time == 20.0)[0]
    assert np.array_equal(run["mekf_attitude"].values[begin], run["quest_attitude"].values[begin])
    deviation = run["mekf_attitude_deviation"].values
    np.testing.assert_allclose(deviation[begin], np.radians(1.0 / 60.0), rtol=1e-12)
    # It is carried on by the gyro, and QUEST's later attitudes are not taken.
    assert not np.allclose(run["mekf_attitude"].values[seen - 1], run["quest_attitude"].values[seen - 1], atol=1e-6)
    # Farrenkopf's model for 15 s, with the bias as uncertain as the filter takes it to be; rates are small.
    bias, noise = FILTER["bias"], FILTER["noise"]
    carried = np.sqrt(np.radians(1.0 / 60.0) ** 2 + noise**2 * 14.5 + (bias * 14.5) ** 2)
    np.testing.assert_allclose(deviation[seen - 1], carried, rtol=0.02)
    tracker = np.array([FIRST["cross"], FIRST["cross"], FIRST["roll"]])
    ahead = np.sqrt(np.radians(1.0 / 60.0) ** 2 + noise**2 * 15.0 + (bias * 15.0) ** 2)
    np.testing.assert_allclose(deviation[seen], 1.0 / np.sqrt(ahead**-2 + tracker**-2), rtol=1e-3)


def test_the_law_may_use_the_estimator_that_starts_one_that_watches():
    _, run = flown({"type": "quest"}, FILTER | {"watches": True, "started_by": "quest"})
    begin = np.flatnonzero(run["time"].values == 5.0)[0]
    assert np.array_equal(run["mekf_attitude"].values[begin], run["quest_attitude"].values[begin])
    assert column_of(run, run.attrs) == "quest_is_valid"


def test_flight_code_has_the_estimator_that_starts_and_not_the_one_that_watches():
    """The step that is exported commands what the loop's own step does."""
    given = scenario(*SENSORS, FILTER | {"started_by": "quest"}, QUEST, COMPLEMENTARY | {"watches": True}, orbit=ORBIT)
    loop = build(given, given.laws[0])
    law = flight_law(loop)
    assert [part.name for part in law.parts.watchers] == ["quest"]
    equation, step, state = law.equation(), make_step(loop.composition()), law.start
    carry, setup = loop.carry(), loop.setup()
    for k in range(20):
        sensed = step.sense(carry, k, (loop.seed, 0), loop.gains, loop.known, setup)
        told = {n: x for one in sensed.readings for n, x in one._asdict().items()}
        inputs = law.inputs._replace(**{n: told[n] for n in law.inputs._fields if n in told})
        carry = step.update(carry, k, (loop.seed, 0), loop.gains, loop.known, setup)
        command, state = equation(law.parameters, state, inputs)
        assert flatten(command) == list(carry.command)
        carry = step.propagate(carry, loop.craft, setup)
    assert list(leaves(state.watchers.quest)) == list(leaves(carry.memories.watchers[0]))


@cache
def certified():
    """The claims about a law with a filter."""
    return sh.certify(scenario(GYRO, FIRST, FILTER, orbit=ORBIT), "lyapunov")[0].claims


def left_out(*parts):
    """The parts that each of these claims leaves out, by its kind, in a loop of these parts."""
    given = scenario(*parts, orbit=ORBIT)
    claims = named([replace(one, assumptions=()) for one in certified()], build(given, given.laws[0]))
    return {one.kind: {x.removeprefix("without:") for x in one.assumptions if x.startswith("without:")} for one in claims}


def test_claims_name_neither_who_only_watches_nor_what_it_alone_reads():
    """They name sensors that the law's estimator reads too, and those of an estimator that starts it."""
    gyro, *directions, _ = SENSORS
    loop = {"sensor gyro", "sensor star-tracker", "estimator mekf"}
    seen = {"sensor gnss", "sensor magnetometer", "sensor sun-sensor"}
    alone, watched = left_out(gyro, FIRST, FILTER), left_out(gyro, *directions, FIRST, FILTER, QUEST)
    assert watched == alone
    assert (alone["convergence"], alone["pointing"]) == (loop, set())
    started = left_out(gyro, *directions, FIRST, FILTER | {"started_by": "quest"}, QUEST)
    assert (started["convergence"], started["pointing"]) == (loop | seen | {"estimator quest"}, seen | {"estimator quest"})
    # Of a filter with directions no claim knows the errors.
    taking = left_out(gyro, *directions, FIRST, FILTER | {"sun": 0.01}, QUEST)
    assert taking["convergence"] == taking["pointing"] == loop | {"sensor sun-sensor"}
    # Without an estimator the law has the position that satellite navigation gives.
    assert left_out(gyro, *directions, QUEST)["pointing"] == {"sensor gyro", "sensor gnss"}


@pytest.mark.parametrize(
    ("estimators", "said"),
    [
        (
            (FILTER, {"type": "quest"}),
            "part quest: found a second estimator, beside mekf; allowed: one estimator for the law",
        ),
        ((FILTER | {"started_by": "qest"}, QUEST), 'mekf: started_by: found "qest"; did you mean quest?'),
        ((FILTER | {"started_by": "mekf"}, QUEST), 'found "mekf"; allowed: one of quest'),
        ((FILTER | {"started_by": "quest"},), "the name of another estimator, which watches"),
        ((FILTER, QUEST | {"started_by": "mekf"}), "quest, which no other starts; allowed: a complementary-filter or mekf"),
        (
            (FILTER | {"started_by": "complementary-filter"}, COMPLEMENTARY | {"watches": True, "started_by": "mekf"}),
            "mekf started by complementary-filter started by mekf; allowed: an estimator that begins by itself",
        ),
        ((FILTER | {"watches": 2},), "part[6].watches: found 2; allowed: true or false"),
        ((FILTER, {"type": "constant-torque", "torque": 0.0, "watches": True}), "an unknown key"),
    ],
)
def test_wrong_words_are_refused(estimators, said):
    with refused(said):
        flown(*estimators)
