"""Scenarios of laws of modes, in pieces."""

BASE = """
name = "mission"
[spacecraft]
inertia = [0.05, 0.065, 0.025]
torque_limit = 0.002
[initial]
attitude = [0.2, 0.7, -0.5, 0.4]
rate = ["6 deg/s", "-5 deg/s", "4 deg/s"]
[simulation]
duration = 60.0
control_period = 0.1
[[law]]
name = "mission"
type = "modes"
quaternion_sign = "shortest"
"""
DETUMBLE = """
[[law.mode]]
name = "detumble"
type = "pd"
k_rate = 0.02
k_attitude = 1e-6
until = { rate_below = "0.5 deg/s", dwell = "2 s" }
"""
POINT = """
[[law.mode]]
name = "point"
type = "pid"
k_rate = 0.006
k_attitude = 0.0008
k_integral = 1e-5
integral_limit = 1e-4
"""
