"""A certificate compared with a scenario whose laws, or wheels, are not what they take themselves for."""

import pytest

import starhold as sh
from starhold.certification.certificate import write
from starhold.scenario.building import build
from starhold.studies.body import study_of
from starhold.studies.certificates import compare_programs, left_open

WHEELS = {"layout": "pyramid", "inertia": 1e-3, "torque_limit": "20 mN m", "momentum_limit": "0.4 N m s"}
CRAFT = {
    "name": "own",
    "spacecraft": {"inertia": [2.0, 3.0, 4.0], "torque_limit": 0.05},
    "initial": {"angles": ["40 deg", 0.0, "10 deg"]},
    "simulation": {"duration": "60 s", "control_period": 0.1},
    "law": [{"type": "pd", "k_rate": 0.5, "k_attitude": 0.05}],
}
OTHER = {"inertia": [1.0, 3.0, 3.5], "torque_limit": 0.05}


@pytest.fixture(scope="module")
def proved(tmp_path_factory):
    """Certificates with wheels and without, by the file."""
    folder = tmp_path_factory.mktemp("proved")
    for name, more in (("bare", {}), ("wheels", {"wheels": WHEELS})):
        scenario = sh.scenario(CRAFT | more)
        made = study_of(scenario.body).certify(scenario, scenario.laws[0], build(scenario, scenario.laws[0]), pointing=False)
        write([one.certificate for one in made], "own", folder / name)
    return folder


def compared(proved, name, **more):
    return compare_programs(proved / name, sh.scenario(CRAFT | more))


def test_a_law_that_takes_another_craft_for_true_is_another(proved):
    assert compared(proved, "bare") == []
    apart = compared(proved, "bare", nominal={"spacecraft": OTHER})
    assert apart == ["pd: craft.inertia.0 is another number", "pd: craft.inertia.2 is another number"]
    # The flying body counts too.
    assert "pd: body.inertia.0.0 is another number" in compared(proved, "bare", spacecraft=OTHER)


def test_wheels_that_give_another_torque_than_is_allocated_are_others(proved):
    said = "pd: its wheels do not give the torque that is allocated to them"
    assert compared(proved, "wheels", wheels=WHEELS) == []
    assert said in compared(proved, "wheels", wheels=WHEELS | {"mounting_error": ["5 deg", 0.0, 0.0]})
    assert said in compared(proved, "wheels", wheels=WHEELS, nominal={"wheels": WHEELS | {"layout": "nasa-standard"}})


def test_a_lower_limit_that_nothing_computes_with_makes_no_other_loop(proved):
    """The law does not read it, the allocation is the same: so is the flight, bit by bit."""
    weak = {"wheels": WHEELS, "nominal": {"wheels": WHEELS | {"torque_limit": "5 mN m"}}}
    assert compared(proved, "wheels", **weak) == []
    one, other = (sh.simulate(sh.scenario(CRAFT | more)) for more in ({"wheels": WHEELS}, weak))
    assert (one["torque"].values == other["torque"].values).all()


def test_claims_about_wheels_on_other_axes_say_why_there_are_none():
    (certificate,) = sh.certify(sh.scenario(CRAFT | {"wheels": WHEELS | {"mounting_error": ["5 deg", 0.0, 0.0]}}))
    assert certificate.claims == ()
    assert certificate.subject["no_pointing"] == "the allocation takes wheels to be mounted otherwise than they are"


ORBIT = {"orbit": {"altitude": "400 km", "inclination": "50 deg"}}
PANEL = {"type": "flexible-modes", "modes": [[2.0, 0.005, 0.1, 0.0, 0.1, 0.0]]}
EVERY, SET = "pd: convergence, torque-limit, inertia, sampling: ", "; the flight starts outside of its set"
TURNS = "the target turns"


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({}, []),
        ({"sensor": {"attitude_noise": "10 arcsec"}}, [f"{EVERY}without the sensor gaussian"]),
        ({"spacecraft": CRAFT["spacecraft"] | {"actuator_lag": 0.3}}, [f"{EVERY}without the actuator lag"]),
        ({"part": [PANEL]}, [f"{EVERY}without the effector flexible-modes"]),
        (ORBIT | {"part": [{"type": "oblateness"}]}, [f"{EVERY}without the environment oblateness"]),
        (ORBIT | {"environment": {"gravity_gradient": True}}, [f"{EVERY}the gravity gradient acts"]),
        (
            ORBIT | {"target": {"mode": "orbital"}},
            [f"pd: convergence, inertia, sampling: {TURNS}", f"pd: torque-limit: {TURNS}{SET}"],
        ),
    ],
)
def test_a_check_says_what_proofs_leave_out_of_a_scenario(more, said, proved):
    """Programs and numbers are those of the proofs, and the scenario has parts and motions that these are not about."""
    scenario = sh.scenario(CRAFT | more)
    assert compare_programs(proved / "bare", scenario) == []
    assert left_open(proved / "bare", scenario) == said


def test_a_check_says_where_wheels_have_what_proofs_leave_out(proved):
    friction = sh.scenario(CRAFT | {"wheels": WHEELS | {"coulomb": 1e-4}})
    assert compare_programs(proved / "wheels", friction) == []
    assert left_open(proved / "wheels", friction) == [
        "pd: convergence, inertia: the wheels have friction",
        f"pd: wheels: the wheels have friction{SET}",
    ]
