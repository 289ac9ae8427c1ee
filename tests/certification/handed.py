"""Certificates of modes, and of the hand-over from one to the next."""

from starhold.scenario.building import build
from starhold.scenario.reading import parse
from starhold.studies.bodies.rigid_body import STUDY
from tests.missions import BASE, DETUMBLE

POINT = """
[[law.mode]]
name = "point"
type = "lyapunov"
k_rate = 0.006
k_attitude = 0.0008
"""


def issued(modes, text=BASE):
    scenario = parse(text + modes, "mission.toml")
    entry = scenario.laws[0]
    return {one.certificate.name: one for one in STUDY.certify(scenario, entry, build(scenario, entry))}


def bounded(rate, angle=None):
    told = f', angle_below = "{angle}"' if angle else ""
    return DETUMBLE.replace('rate_below = "0.5 deg/s"', f'rate_below = "{rate}"{told}')


def handed(modes, text=BASE):
    return issued(modes, text)["mission: detumble to point"].certificate
