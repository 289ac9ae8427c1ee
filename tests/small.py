"""A small scenario in parts, for the tests of certificates: the craft with its run, and laws of each outcome."""

from tests.texts import toml

CRAFT = toml("""
name = "small"
[spacecraft] inertia = [2.0, 3.0, 4.0]; torque_limit = "0.05 N m"
[initial] attitude = [1, 0, 0, 0.1]; rate = [0, 0, 0]
[simulation] duration = 5.0; control_period = 0.1
""")
PD = '[[law]]\ntype = "pd"\nk_rate = 0.09\nk_attitude = 0.009\n'
WEAK = '[[law]]\ntype = "sliding"\nname = "weak"\nsurface_gain = 0.08\nswitching_gain = 1e-6\n'
"""A switching torque below what it must stand."""
MPC = '[[law]]\ntype = "mpc"\nq_attitude = 0.2\nq_rate = 0.2\nr = 50\n'
