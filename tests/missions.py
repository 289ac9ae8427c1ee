"""Scenarios of CubeSats, in pieces; those of laws of modes."""

from tests.texts import toml


def cubesat(*tables, duration=300, period=0.5, angles='["20 deg", "-10 deg", "30 deg"]', rate=(0.02, -0.03, 0.025)):
    """A 6U CubeSat on a polar orbit, with these tables; `angles` and `rate` are those at the start."""
    head = toml(f"""
name = "own"
[spacecraft] inertia = [0.05, 0.065, 0.025]; torque_limit = "2 mN m"
[orbit] position = ["6878 km", 0, 0]; velocity = [0, "-1.017 km/s", "7.544 km/s"]; epoch = "2026-03-05T06:30:00Z"
[initial] angles = {angles}; rate = {list(rate)}
[simulation] duration = {duration}; control_period = {period}
""")
    return head + "".join(tables)


BASE = toml("""
name = "mission"
[spacecraft] inertia = [0.05, 0.065, 0.025]; torque_limit = 0.002
[initial] attitude = [0.2, 0.7, -0.5, 0.4]; rate = ["6 deg/s", "-5 deg/s", "4 deg/s"]
[simulation] duration = 60.0; control_period = 0.1
[[law]] name = "mission"; type = "modes"; quaternion_sign = "shortest"
""")
DETUMBLE = toml("""
[[law.mode]] name = "detumble"; type = "pd"; k_rate = 0.02; k_attitude = 1e-6
until = { rate_below = "0.5 deg/s", dwell = "2 s" }
""")
POINT = toml("""
[[law.mode]] name = "point"; type = "pid"; k_rate = 0.006; k_attitude = 0.0008; k_integral = 1e-5; integral_limit = 1e-4
""")

HEADS = toml("""
[[part]] type = "gyro"; noise = 2e-5
[[part]] type = "star-tracker"; cross = "10 arcsec"; roll = "60 arcsec"; boresight = [0, -1, 0]; interval = 1.0
outage = [100, 160]
[[part]] type = "mekf"; noise = 2e-5; bias_walk = 1e-5; bias = "0.03 deg/s"; cross = "10 arcsec"; roll = "60 arcsec"
boresight = [0, -1, 0]
""")
"""A gyro and a star tracker, which is lost for a minute, with their filter."""
GUARDED = toml("""
[[law]] name = "mission"; type = "modes"; quaternion_sign = "shortest"; on_loss = "safe"
""")
MONITORS = toml("""
[[law.monitor]] name = "tracker"; kind = "stuck"; reading = "attitude"; limit = "5 s"; modes = ["wait", "point", "sun"]
[[law.monitor]] name = "jump"; kind = "rate"; reading = "rate"; limit = "1 deg/s^2"; times = 2
[[law.monitor]] name = "filter"; kind = "residual"; reading = "attitude"; limit = "5 deg"
[[law.monitor]] name = "divergence"; kind = "range"; estimate = "attitude_deviation"; limit = "3 deg"; times = 20
""")
"""One of each kind."""


def mode(name, *lines):
    """A mode whose law is the same in all modes."""
    head = f'[[law.mode]]\nname = "{name}"\ntype = "lyapunov"\nk_rate = 0.006\nk_attitude = 0.0008\n'
    return "\n".join((head, *lines, ""))


WATCHFUL = (
    cubesat(HEADS, GUARDED, MONITORS)
    + mode(
        "wait",
        'until = { not_before = "2026-03-05T06:30:20.2Z", attitude_deviation_below = "0.1 deg", tracker_age_below = "2 s" }',
    )
    + mode(
        "point",
        'target = { mode = "orbital" }',
        'slew = { rate = "1 deg/s", acceleration = "0.02 deg/s^2", torque_limit = 1e-5, keep_out = "40 deg" }',
        'until = { elevation_below = "5 deg", latitude = "10 deg", longitude = "20 deg", sun_angle_above = "2 deg", '
        'axis = [1, 0, 0], sunlight_above = 0.5, not_after = 280, after = "10 s" }',
    )
    + mode("sun", 'until = { not_before = "200 s", to = "point" }')
    + mode("safe", 'until = { after = "30 s", to = "wait" }')
)
"""A flight with every kind of condition and of monitor, and a slew."""

WHEELS = toml("""
[wheels] layout = "pyramid"; inertia = 2.2e-5; torque_limit = "2 mN m"; momentum_limit = "15 mN m s"
[[part]] type = "magnetometer"
[[part]] type = "magnetorquers"; dipole_limit = "0.2 A m^2"
""")
"""Wheels, and rods that a safe mode flies by."""
SAFE = '[[law.mode]]\nname = "safe"\ntype = "b-dot"\nk = 1e-3\neffectors = ["magnetorquers"]\n'

WATCHED = cubesat(
    HEADS.replace('noise = 2e-5\n[[part]]\ntype = "star', 'noise = 2e-5\ndelay = 0.7\njitter = 0.01\n[[part]]\ntype = "star')
    + 'started_by = "quest"\nstart_deviation = "1 deg"\n',
    toml("""
[[part]] type = "gnss"; delay = 1.0; jitter = 0.1
[[part]] type = "magnetometer"; noise = "50 nT"; delay = 0.2
[[part]] type = "sun-sensor"; jitter = 0.01; delay = 0.5
[[part]] type = "complementary-filter"; attitude_gain = 0.2; bias_gain = 0.01; watches = true; started_by = "mekf"
[[part]] type = "quest"; watches = true
[[law]] type = "lyapunov"; k_rate = 0.006; k_attitude = 0.0008
"""),
)
"""QUEST starts the law's filter, and that another one, which watches as QUEST does; sensors are late."""
