"""A campaign with a verdict

2000 flights from attitudes uniform on the rotation group, with the inertia known to 5 % and a torque limit that ages.
The title is the verdict: it holds with 90 % confidence for independent draws from these distributions."""

import sys

import matplotlib.pyplot as plt

import starhold as sh

scenario = sh.scenario(
    {
        "name": "acceptance",
        "spacecraft": {"inertia": [12.0, 14.0, 9.0], "torque_limit": "50 mN m"},
        "sensor": {"attitude_noise": "10 arcsec", "rate_noise": "0.001 deg/s"},
        "simulation": {"duration": "4 min", "control_period": 0.2},
        "settling": {"attitude_tolerance": "0.2 deg", "rate_tolerance": "0.02 deg/s"},
        "law": [{"type": "pd", "k_rate": 2.0, "k_attitude": 0.18, "quaternion_sign": "shortest"}],
    }
)
result = sh.campaign(
    scenario,
    runs=2000,
    over={
        "initial.attitude": {"distribution": "rotations"},
        "initial.rate": {"distribution": "shell", "high": "0.5 deg/s"},
        "spacecraft.inertia": {"distribution": "normal", "sigma": "5 %", "relative": True},
        "spacecraft.torque_limit": {"distribution": "uniform", "low": "30 mN m", "high": "50 mN m"},
    },
    requirement=[{"metric": "settling_time", "at_most": "130 s", "share": "95 %", "confidence": "90 %"}],
    search=False,
)
runs = result.frame()
(verdict,) = result.laws[0].verdicts

figure, axes = plt.subplots(figsize=(6, 3.2), layout="constrained")
axes.hist(runs["settling_time"], bins=60)
axes.axvline(130, color="red", linewidth=1)
axes.set(xlabel="settling time, s", ylabel="flights", title=f"at most 130 s in 95 % of flights: {verdict.outcome}")
figure.savefig(sys.argv[1], dpi=80)
