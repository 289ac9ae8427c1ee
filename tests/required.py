"""A small scenario with requirements, one or more for each method."""

import starhold as sh

TURN = {
    "name": "turn",
    "spacecraft": {"inertia": [2, 3, 4], "torque_limit": "0.05 N m"},
    "initial": {"angles": ["8 deg", "5 deg", "-6 deg"], "rate": ["0.05 deg/s", 0, 0]},
    "sensor": {"rate_noise": 1e-6},
    "simulation": {"duration": 400, "control_period": 0.5},
    "settling": {"attitude_tolerance": "0.1 deg", "rate_tolerance": "0.01 deg/s"},
    "campaign": {"runs": 60, "over": {"initial.rate": {"distribution": "shell", "high": "0.2 deg/s"}}},
    "budget": {"runs": 2},
    "law": [{"type": "pd", "k_rate": 0.3, "k_attitude": 0.03}],
}
SETTLES = {"id": "settles", "method": "flight", "metric": "settling_time", "at_most": "5 min"}
STILL = {"id": "still", "method": "flight", "metric": "peak_attitude_error", "at_most": "20 arcsec", "after": "5 min"}
OFF = {"id": "off", "method": "flight", "metric": "exclusion-cone", "at_least": "1 deg", "axis": [0, 0, 1]}
OFF |= {"direction": [1, 0, 0]}
BETWEEN = {"id": "between", "method": "flight", "metric": "peak_rate", "at_most": "1 deg/s", "window": [50, "2 min"]}
PHASE = {"id": "phase", "method": "margin", "metric": "phase_margin", "at_least": "40 deg"}
ERROR = {"id": "error", "method": "budget", "metric": "ape", "at_most": "1 mas"}
MANY = {"id": "many", "method": "campaign", "metric": "settling_time", "at_most": "300 s", "share": 0.9}
KEPT = {"id": "kept", "method": "campaign", "metric": "lost", "share": 0.9}
PROOF = {"id": "proof", "method": "proof", "metric": "peak_attitude_error", "at_most": "1 deg", "after": "1 h"}
ALL = [SETTLES, STILL, OFF, BETWEEN, PHASE, ERROR, MANY, KEPT, PROOF]


def turn(*required, **changes):
    """The small scenario with these requirements."""
    return sh.scenario(TURN | {"requirement": list(required)} | changes)
