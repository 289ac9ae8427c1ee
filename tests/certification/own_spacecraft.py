"""A spacecraft with late sensors, used directly and through a filter."""

from functools import cache

from starhold.scenario.building import build
from starhold.scenario.reading import parse
from starhold.studies.bodies.rigid_body import certified_loops

OWN = """
name = "own"
[spacecraft]
inertia = [1.0, 1.2, 0.8]
[initial]
angles = ["20 deg", "-10 deg", "5 deg"]
[target]
mode = "inertial"
[simulation]
duration = 200.0
control_period = 0.25
[certify]
disturbance = "1e-5 N m"
[[law]]
type = "lyapunov"
form = "bandwidth"
bandwidth = 0.1
damping = 0.9
"""
LATE = """
[[part]]
type = "star-tracker"
cross = 0.0
roll = 0.0
delay = 0.6
interval = 0.5
[[part]]
type = "gyro"
delay = "0.1 s"
scale_error = 0.001
"""
FILTERED = """
[[part]]
type = "star-tracker"
cross = "10 arcsec"
roll = "60 arcsec"
interval = 0.5
delay = 0.2
[[part]]
type = "gyro"
noise = 2e-5
bias = ["0.02 deg/s", "-0.01 deg/s", "0.015 deg/s"]
bias_walk = 1e-5
[[part]]
type = "complementary-filter"
attitude_gain = 0.2
bias_gain = 0.01
"""
PARTS = {"late": LATE, "filtered": FILTERED}


@cache
def loop_with(parts):
    scenario = parse(OWN + PARTS[parts], "own.toml", None)
    entry = scenario.laws[0]
    (loop,) = certified_loops(scenario, entry, build(scenario, entry)).values()
    return scenario, loop
