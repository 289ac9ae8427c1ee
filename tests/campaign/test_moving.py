"""Numbers of many runs made at once: what each run's own scenario gives, without building one for each."""

import numpy as np
import pytest

import starhold as sh
from starhold.campaign import lanes as lane_making
from starhold.campaign import moving
from starhold.campaign.campaign import with_campaign
from starhold.campaign.job import Job, Source
from starhold.errors import InputError
from starhold.scenario.orbit import LOWEST
from tests.campaign.flown import SMALL, normal, short, uniform

LYAPUNOV, WHEEL = SMALL["law"][1], {"type": "wheel", "k_rate": 1.5, "k_attitude": 0.6}
SHARE = normal("4 %", relative=True)
TOLD = SHARE | {"known_to_law": True}
NUMBERS = {"inertia": 1e-3, "torque_limit": 0.2, "momentum_limit": 4.0, "viscous": 1e-4, "coulomb": 1e-5}
FOUR = {"wheels": NUMBERS, "wheel": [{"axis": axis} for axis in ([1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1])]}
PYRAMID = {"wheels": NUMBERS | {"layout": "pyramid", "allocation": "least-peak"}}
PARTS = {
    "sensor": {},
    "part": [
        {"type": "gyro", "noise": 1e-5, "bias": [1e-4, 0, 0], "scale_error": 0.001},
        {"type": "star-tracker", "cross": 1e-5, "roll": 1e-4, "delay": 0.4},
        {"type": "mekf", "noise": 1e-5, "bias": 1e-4, "bias_walk": 1e-6, "cross": 1e-5, "roll": 1e-4},
    ],
}
ASSUMING = PARTS | {"part": [*PARTS["part"][:2], {"type": "mekf", "noise": 1e-5, "bias": 1e-4, "bias_walk": 1e-6}]}
MAGNET = {
    "orbit": {"altitude": "500 km", "inclination": "50 deg", "eccentricity": 0.0},
    "part": [{"type": "residual-dipole", "dipole": [0.01, 0.02, 0.03]}],
}
ROTATIONS = {"distribution": "rotations"}
LOST = {"fault": [{"time": 2.0, "wheel": 2, "lost": True, "delay": 1.0, "action": "reallocate"}]}
LQR = {"type": "lqr", "form": "II", "q": 1.0, "r": 0.5}
BANDWIDTH = {"type": "pd", "form": "bandwidth", "bandwidth": 0.3, "damping": 0.8}
SETTLING = {"type": "pd", "form": "settling", "time": "60 s"}
CASES = {
    "inertia beside wheels": (WHEEL, FOUR, {"spacecraft.inertia": SHARE}),
    "inertia beside wheels, told": (WHEEL, FOUR, {"spacecraft.inertia": TOLD}),
    "rotors": (WHEEL, FOUR, {"wheels.inertia": SHARE, "spacecraft.inertia[2]": TOLD}),
    "axes": (WHEEL, FOUR, {"wheel[2].axis": normal(0.02), "wheel[1].axis[3]": normal(0.02)}),
    "axes, told": (WHEEL, FOUR, {"wheel[2].axis": normal(0.02, known_to_law=True)}),
    "some axes told": (WHEEL, FOUR, {"wheel[2].axis": normal(0.02, known_to_law=True), "wheel[4].axis": normal(0.02)}),
    "friction": (WHEEL, FOUR, {"wheels.viscous": SHARE, "wheel[3].coulomb": uniform(1e-6, 1e-5)}),
    "limits": (WHEEL, FOUR, {"wheels.torque_limit": SHARE, "spacecraft.torque_limit": uniform(0.05, 0.4)}),
    "a loss": (WHEEL, FOUR | LOST, {"wheels.viscous": SHARE, "spacecraft.inertia": SHARE}),
    "least peak": (WHEEL, PYRAMID, {"wheels.inertia": SHARE, "spacecraft.inertia": SHARE}),
    "sensors": (LYAPUNOV, PARTS, {"part.gyro.scale_error": normal(0.01), "part.gyro.bias": normal(1e-3)}),
    "mounting": (LYAPUNOV, PARTS, {f"part.{name}.mounting_error": normal(0.01) for name in ("gyro", "star-tracker")}),
    "starts beside a filter": (LYAPUNOV, PARTS, {"initial.rate": normal(0.01), "initial.attitude": ROTATIONS}),
    "dipole": (LYAPUNOV, MAGNET, {"part.residual-dipole.dipole": SHARE, "spacecraft.inertia": TOLD}),
    "orbit": (
        LYAPUNOV,
        MAGNET | {"target": {"mode": "orbital"}},
        {"orbit.altitude": uniform(4e5, 6e5), "orbit.raan": uniform(0.0, 6.28), "orbit.inclination": normal(0.1)},
    ),
    "orbit by its axes": (
        WHEEL,
        FOUR | {"orbit": {"semi_major_axis": 1e7, "inclination": 1.0, "eccentricity": 0.2}},
        {"orbit.eccentricity": uniform(0.0, 0.3), "orbit.semi_major_axis": SHARE, "orbit.true_anomaly": uniform(0.0, 6.28)},
    ),
    "orbit by its state": (
        WHEEL,
        FOUR | {"orbit": {"position": [7e6, 0.0, 0.0], "velocity": [0.0, 4e3, 6.4e3]}, "target": {"mode": "orbital"}},
        {"orbit.position": normal(1e4), "orbit.velocity[3]": normal(50.0), "initial.rate": normal(0.01)},
    ),
    "filter": (LYAPUNOV, PARTS, {"part.mekf.noise": SHARE, "part.mekf.cross": SHARE, "part.star-tracker.roll": SHARE}),
    "a tracker's noise that the filter assumes": (
        LYAPUNOV,
        ASSUMING,
        {"part.star-tracker.cross": TOLD, "part.star-tracker.mounting_error": normal(0.01), "part.gyro.bias": normal(1e-3)},
    ),
    "riccati, told": (LQR, {}, {"spacecraft.inertia": TOLD}),
    "weights": (LQR, {}, {"law.lqr.q": SHARE}),
    "weights about axes": (LQR | {"form": "III"}, {}, {"law.lqr.r": SHARE, "spacecraft.inertia": TOLD}),
    "bandwidth": (BANDWIDTH, {}, {"spacecraft.inertia": TOLD, "law.pd.bandwidth": SHARE}),
    "settling": (
        SETTLING,
        {"spacecraft": SMALL["spacecraft"] | {"torque_limit": 1.0}},
        {"spacecraft.inertia": TOLD, "law.pd.damping": uniform(0.6, 0.9)},
    ),
    "all": (
        WHEEL,
        FOUR | PARTS,
        {
            "spacecraft.inertia": SHARE,
            "part.gyro.scale_error": normal(0.01),
            "wheel[3].axis": normal(0.02),
            "wheels.viscous": SHARE,
        },
    ),
}


def lanes_of(law, tables, over, runs=3000):
    """The plan and the lanes of a campaign in which this is drawn."""
    scenario = with_campaign(short(4.0, (law,), **tables), {"over": over, "runs": runs})
    job = Job(Source.of(scenario), scenario.table.campaign)
    return job.plan, job.lanes(scenario.laws[0].name)


def numbers_in(plan, lanes, first, count):
    """All numbers of these runs, by name."""
    ((lot, places, _),) = lanes.lots(plan.columns(first, count), np.arange(first, first + count))
    assert places.tolist() == list(range(count))
    return lane_making._numbers(lot)


@pytest.mark.parametrize("case", CASES)
def test_numbers_made_at_once_are_those_of_each_runs_own_scenario(case):
    plan, lanes = lanes_of(*CASES[case])
    assert lanes.at_once
    together = numbers_in(plan, lanes, 1000, 12)
    lanes.at_once = False
    apart = numbers_in(plan, lanes, 1000, 12)
    assert list(together) == list(apart)
    different = [name for name, row in apart.items() if together[name].tobytes() != row.tobytes()]
    assert different == []
    assert any(np.unique(row).size > 1 for row in apart.values())


ORBITING = PARTS | {"orbit": MAGNET["orbit"], "target": {"mode": "orbital"}}
FILTERED = {"orbit.raan": uniform(0.0, 6.28), "orbit.altitude": normal(1e4)}
FILTERED |= {"part.mekf.cross": SHARE, "part.mekf.bias": SHARE}


@pytest.mark.parametrize("case", [CASES["all"], (LYAPUNOV, ORBITING, FILTERED)])
def test_scenarios_and_equations_made_do_not_grow_with_the_runs(case, monkeypatch):
    """Counts, for times depend on the machine."""
    made = []
    for module, name in ((lane_making, "build"), (moving, "Compiled")):
        plainly = getattr(module, name)
        monkeypatch.setattr(
            module, name, lambda *given, name=name, plainly=plainly, **more: (made.append(name), plainly(*given, **more))[1]
        )
    plan, lanes = lanes_of(*case)
    assert made.count("Compiled") == 1
    # To find out what each draw moves: the first run, two others of each, and the runs on which all is tried.
    assert made.count("build") < 30
    counts = []
    for count in (10, 1500):
        made.clear()
        numbers_in(plan, lanes, 100, count)
        counts.append((made.count("build"), made.count("Compiled")))
    assert counts == [(2, 0), (2, 0)]


FLAT = FOUR | {"wheel": [*FOUR["wheel"][:2], {"axis": [1, 0, 0.004]}]}
HEAVY = FOUR | {"wheels": NUMBERS | {"inertia": 0.8}}
LOW = FOUR | {"orbit": {"semi_major_axis": 6.6e6, "inclination": 1.0, "eccentricity": 0.0}}
DOWN = FOUR | {"orbit": {"position": [6.3785e6, 0.0, 0.0], "velocity": [-80.0, 7e3, 0.0]}}
AWAY = FOUR | {"orbit": {"semi_major_axis": -2e7, "inclination": 1.0, "eccentricity": 1.5}}
IMPOSSIBLE = {
    "axes in a plane": (FLAT, {"wheel[3].axis[3]": normal(0.003)}),
    "rotors heavier than the craft": (HEAVY, {"wheels.inertia": normal("40 %", relative=True)}),
    "a body without its rotors": (HEAVY, {"spacecraft.inertia": normal("30 %", relative=True)}),
    "friction faster than the substeps": (FOUR, {"wheels.viscous": uniform(1e-4, 0.01)}),
    "orbits in the ground": (LOW, {"orbit.semi_major_axis": normal(2e5)}),
    "orbits that come down": (DOWN, {"orbit.velocity[1]": normal(50.0)}),
    "hyperbolas": (AWAY, {"orbit.true_anomaly": normal(2.0, mean=0.0)}),
    "orbits beside wheels": (LOW | HEAVY, {"orbit.semi_major_axis": normal(2e5), "wheels.inertia": SHARE}),
}


@pytest.mark.filterwarnings("ignore:orbit.velocity. the orbit meets the Earth's surface after")
@pytest.mark.parametrize("case", IMPOSSIBLE)
def test_what_no_craft_has_is_left_out_as_its_scenario_is_refused(case):
    tables, over = IMPOSSIBLE[case]
    scenario = with_campaign(short(4.0, (WHEEL,), **tables), {"over": over, "runs": 400})
    job = Job(Source.of(scenario), scenario.table.campaign)
    columns = job.plan.columns(0, 60)
    every = moving.Moving(job.scenario, job.scenario.laws[0], None, job.dispersions).by_key(columns)
    refused = job.scenario.hooks.refused(job.scenario, every)
    expected = []
    for run in range(60):
        change = job.plan.change({name: values[run] for name, values in columns.items()})
        try:
            other = job.scenario.with_(change | {"campaign": None})
            lane_making.build(other, other.laws[0])
            expected.append(False)
        except InputError:
            expected.append(True)
    assert refused.tolist() == expected
    assert 0 < sum(expected) < 60


def test_draws_that_no_equation_follows_are_built_one_by_one():
    """Facets of wheels are tables; what attracts is the craft's number and the orbit's."""
    for law, tables, over in (
        (WHEEL, PYRAMID, {"wheels.torque_limit": SHARE}),
        (LYAPUNOV, MAGNET, {"orbit.gravitational_parameter": normal("0.1 %", relative=True)}),
    ):
        plan, lanes = lanes_of(law, tables, over, runs=40)
        assert not lanes.at_once
        assert numbers_in(plan, lanes, 0, 3)


def test_an_altitude_without_the_unit_that_its_file_would_need_is_left_to_each_runs_own_scenario():
    over = {"orbit.altitude": normal(1e4, mean=1.15e5)}
    scenario = with_campaign(short(4.0, (LYAPUNOV,), **MAGNET), {"over": over, "runs": 40, "seed": 3})
    job = Job(Source.of(scenario), scenario.table.campaign)
    columns, refused = job.plan.columns(0, 40), np.zeros(40, dtype=bool)
    lots = list(job.lanes("lyapunov").lots(columns, np.arange(40), refused))
    assert sum(len(lot.runs) for lot, _, _ in lots) == 40 - refused.sum()
    assert refused.tolist() == (columns["orbit.altitude"] < LOWEST * 6378137.0).tolist()
    assert 0 < refused.sum() < 40


def test_known_and_unknown_flights_of_a_campaign_are_kept_apart_in_its_rows():
    over = {"spacecraft.inertia": SHARE}
    found = sh.campaign(short(4.0, (WHEEL,), **FOUR), runs=20, over=over, threads=1, search=False)
    frame = found.frame()
    assert (frame["flown.craft.with_rotors[1]"] == frame["spacecraft.inertia[1]"]).all()
    assert found.again(7).differs == ()
