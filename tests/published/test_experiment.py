"""The published comparison of three laws: what the publication concludes, reproduced or refuted."""

import numpy as np
import pytest

from starhold.algebra.structure import flatten
from starhold.analysis.cost import call_costs
from starhold.analysis.metrics import stays_within
from starhold.analysis.rigid_body import METRICS, measure
from starhold.scenario.building import build
from starhold.scenario.reading import builtin_text, load, parse
from starhold.simulation.lane import Recording, fly, label
from starhold.simulation.lanes import simulate_many


@pytest.fixture(scope="module")
def flights():
    scenario = load("three-laws")
    found = {}
    for entry in scenario.laws:
        loop = build(scenario, entry)
        samples, carry = fly(loop, scenario.table.simulation.steps)
        found[entry.name] = (loop, samples, label(loop, samples, carry, 1))
    return found


@pytest.fixture(scope="module")
def metrics(flights):
    return {name: measure(run, 2e-3, 1e-3) for name, (_, _, run) in flights.items()}


def test_torque_stays_within_the_limit_of_each_axis(flights):
    for _, samples, _ in flights.values():
        assert np.abs(samples[13:16]).max() <= 0.01


def test_predictive_law_is_first_within_1e_3(metrics):
    mpc = metrics["mpc"]["iterations_1e-3"]
    assert 1100 < mpc < 1400
    assert mpc < 0.5 * metrics["lyapunov"]["iterations_1e-3"]
    for k in (1, 2, 3):
        counts = {name: row[f"iterations_1e-{k}"] for name, row in metrics.items()}
        assert counts["mpc"] == min(count for count in counts.values() if count is not None)


def test_lyapunov_law_needs_over_3000_steps_but_reaches_any_accuracy(metrics):
    # The published figure, "more than 3000", is what a longer run makes of it; a run of 600 s gave 5649.
    assert metrics["lyapunov"]["iterations_1e-3"] == 6320
    text = builtin_text("three-laws").replace("duration = 2000.0", "duration = 6000.0")
    scenario = parse(text, "long")
    samples, _ = fly(build(scenario, scenario.pick("lyapunov")), 60_000)
    deviation = np.linalg.norm(samples[20:23], axis=0)
    # At 2e-8 the gravity torque, known at the control instants and held in between, is what remains.
    reached = [stays_within(deviation, 10.0**-k) for k in range(1, 8)]
    assert None not in reached
    assert reached == sorted(reached)


def test_no_time_is_cut_off_by_the_end_of_the_run(metrics):
    """Three times as long a run settles at the same steps."""
    text = builtin_text("three-laws").replace("duration = 2000.0", "duration = 6000.0")
    scenario = parse(text, "long")
    for entry in scenario.laws:
        loop = build(scenario, entry)
        longer = measure(label(loop, *fly(loop, 60_000), 1), 2e-3, 1e-3)
        times = {name for name in longer if "iterations" in name or "settling" in name}
        assert len(times) == 15
        assert {name: longer[name] for name in times} == {name: metrics[entry.name][name] for name in times}
        assert metrics[entry.name]["cut_off"] == []


def test_what_is_reached_at_the_very_end_does_not_count(flights):
    """The Lyapunov law cut off at 600 s would be within 1e-3 from step 5649 on, and leaves again after the end."""
    run = flights["lyapunov"][2]
    short = Recording({name: values[:6001] for name, values in run.arrays.items()}, run.attrs)
    assert stays_within(np.linalg.norm(short["attitude_error"][:, 1:], axis=1), 1e-3) == 5649
    found = measure(short, 2e-3, 1e-3)
    assert found["iterations_1e-3"] is None
    assert found["iterations_1e-2"] == 4261
    assert set(found["cut_off"]) >= {"iterations_1e-3", "settling_time", "attitude_settling_time"}
    assert "settling_time" not in measure(run, 2e-3, 1e-3)["cut_off"]
    assert METRICS.told("settling_time", found) == "— †"
    assert METRICS.late({"lyapunov": found}) != ""
    assert METRICS.late({"lyapunov": measure(run, 2e-3, 1e-3)}) == ""


def test_sliding_law_stalls_between_1e_2_and_1e_3_by_chatter(flights, metrics):
    row = metrics["sliding"]
    assert row["iterations_1e-2"] is not None
    assert row["iterations_1e-3"] is None
    torque = flights["sliding"][1][13:16, -1500:]
    changes = (np.diff(np.sign(torque), axis=1) != 0).mean(axis=1)
    assert changes.min() > 0.2
    assert row["chatter"] > 100 * metrics["lyapunov"]["chatter"]


def test_overshoot_and_settling_are_measured_on_the_run(metrics):
    assert metrics["mpc"]["settling_time"] < metrics["lyapunov"]["settling_time"]
    assert metrics["sliding"]["settling_time"] is None


def test_predictive_law_costs_by_far_the_most(flights):
    costs = {
        name: call_costs(loop, samples[:16].T, calls=2000)["cost_median"] for name, (loop, samples, _) in flights.items()
    }
    # Two orders stand between them; a noisy machine cannot turn that round.
    assert costs["mpc"] > 20 * max(costs["lyapunov"], costs["sliding"])


def test_all_laws_survive_the_noise():
    scenario = load("three-laws-noise")
    for entry in scenario.laws:
        samples, carry = fly(build(scenario, entry), scenario.table.simulation.steps)
        assert carry.lost_at < 0
        deviation = np.linalg.norm(samples[20:23, -1000:], axis=0)
        assert deviation.max() < 0.2


def test_published_start_breaks_the_stated_limit_in_norm():
    """Erratum: the Lyapunov law asks 1.38e-2 N m at the start, above the stated bound on the norm, but not on any axis."""
    loop = build(load("three-laws"), load("three-laws").pick("lyapunov"))
    first = fly(loop, 1)[0][16:19, 0]
    assert np.linalg.norm(first) == pytest.approx(1.38e-2, rel=2e-3)
    assert np.abs(first).max() < 1e-2


def test_every_law_arrives_from_the_published_random_starts():
    """Attitudes uniform, 0.02 < |w| < 0.07 rad/s, as in the publication's Monte Carlo."""
    scenario = load("three-laws")
    random = np.random.default_rng(2022)
    allowed = {"lyapunov": 5e-2, "sliding": 1e-2, "mpc": 1e-3}
    for name, lanes in {"lyapunov": 1000, "sliding": 1000, "mpc": 20}.items():
        loop = build(scenario, scenario.pick(name))
        attitudes, rates = random.normal(size=(4, lanes)), random.normal(size=(3, lanes))
        starts = np.repeat(np.array(flatten(loop.start))[:, None], lanes, axis=1)
        starts[:4] = attitudes / np.linalg.norm(attitudes, axis=0)
        starts[4:7] = rates / np.linalg.norm(rates, axis=0) * random.uniform(0.02, 0.07, size=lanes)
        batch = simulate_many(loop, starts, 6000)
        assert (batch.lost_at == -1).all()
        assert np.linalg.norm(batch.states[1:4], axis=0).max() < allowed[name]
