"""Scenarios of CubeSats, in pieces; those of laws of modes."""


def cubesat(*tables, duration=300, period=0.5, angles='["20 deg", "-10 deg", "30 deg"]', rate=(0.02, -0.03, 0.025)):
    """A 6U CubeSat on a polar orbit, with these tables; `angles` and `rate` are those at the start."""
    return f"""
name = "own"
[spacecraft]
inertia = [0.05, 0.065, 0.025]
torque_limit = "2 mN m"
[orbit]
position = ["6878 km", 0, 0]
velocity = [0, "-1.017 km/s", "7.544 km/s"]
epoch = "2026-03-05T06:30:00Z"
[initial]
angles = {angles}
rate = {list(rate)}
[simulation]
duration = {duration}
control_period = {period}
{"".join(tables)}"""


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
