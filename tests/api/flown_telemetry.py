"""A CubeSat that records every control step, and its recording as a table."""

from functools import cache
from pathlib import Path

import starhold as sh
from starhold.scenario.building import build
from starhold.scenario.reading import parse
from starhold.studies.telemetry_files import MappingTable, table_of
from tests.texts import toml

FILE = toml("""
name = "short"
[spacecraft] inertia = [0.05, 0.065, 0.025]
[orbit] altitude = "500 km"; inclination = "97.4 deg"; epoch = "2026-03-20T12:00:00Z"
[initial] rate = ["0.3 deg/s", "-0.2 deg/s", "0.1 deg/s"]
[target] mode = "orbital"
[wheels] layout = "pyramid"; inertia = 2.2e-5; torque_limit = "2 mN m"; momentum_limit = "15 mN m s"
[[part]] type = "gyro"; noise = 2e-5; bias = ["0.02 deg/s", "-0.01 deg/s", "0.015 deg/s"]
[[part]] type = "star-tracker"; cross = "10 arcsec"; roll = "60 arcsec"; interval = 1.0
[[part]] type = "mekf"; noise = 2e-5; bias_walk = 1e-5; bias = "0.03 deg/s"; cross = "10 arcsec"; roll = "60 arcsec"
[[part]] type = "magnetometer"; noise = "100 nT"
[simulation] duration = 60.0; control_period = 0.5
[[law]] type = "wheel"; k_rate = 0.022; k_attitude = 7e-4
""")


@cache
def flown():
    """The scenario, its loop, and its run."""
    scenario = parse(FILE, "short.toml", Path())
    return scenario, build(scenario, scenario.pick(None)), sh.simulate(scenario)


def table():
    """The run as a table that may be changed."""
    return table_of(flown()[2], Path("run"), MappingTable())[0].copy()
