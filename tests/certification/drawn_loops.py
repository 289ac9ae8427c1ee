"""Random loops of which a pointing bound may be proved, as texts of scenarios."""

import json
import math

import numpy as np

from starhold.parts.effectors.wheels import CREEP
from tests.certification.hunt import EARTH, random_inertia, unit
from tests.kernel.flights import along

EVERY = {"plans": 0.15, "targets": 0.3, "shaken": 0.25, "integral": 0.15, "lost": 0.5}
"""How often loops of the kind "every" have what the other kinds have: the predictive law, targets that move by themselves,
random torques, a law with an integral, and a wheel that is lost, where a loop has four."""
FASTEST = 9e3
"""The speed of a rotor with its most momentum (rad/s)."""


def random_loop(random, kind=""):
    """The text of a scenario of which a pointing bound may be proved: inertia, orbit, target, wheels, law, gains, period,
    start, and the parts that disturb, measure and estimate, all at random; of a kind what it has for certain."""
    kinds = {name for name, chance in EVERY.items() if random.uniform() < chance} if kind == "every" else {kind}

    def some(*choices):
        return choices[int(random.integers(len(choices)))]

    def size(low, high):
        return float(f"{10.0 ** random.uniform(math.log10(low), math.log10(high)):.6g}")

    def numbers(array):
        return json.dumps([float(f"{x:.9g}") for x in np.ravel(array)])

    J = random_inertia(random, size(1e-3, 1e3))
    scale, w = float(np.linalg.eigvalsh(J)[-1]), size(3e-3, 0.5)
    k, d = w * w * scale, 2.0 * w * scale * random.uniform(0.4, 1.5)
    period = float(f"{random.uniform(0.005, 0.25) / w:.4g}")
    inertia = json.dumps(J.tolist() if np.count_nonzero(J) > 3 else np.diagonal(J).tolist())
    lines = ['name = "hunted"', "[spacecraft]", f"inertia = {inertia}"]
    if random.uniform() < 0.4:
        lines += [f"torque_limit = {size(0.1, 10.0) * k:.6g}", f'limit = "{some("axis", "norm")}"']
    orbit, wheels = random.uniform() < 0.6, random.uniform() < 0.5
    if orbit:
        place, along_it, _ = np.linalg.qr(random.normal(size=(3, 3)))[0]
        r = 6.378e6 + size(3e5, 3.6e7)
        v = math.sqrt(EARTH / r) * some(1.0, 1.0, random.uniform(1.0, 1.05))
        lines += ["[orbit]", f"position = {numbers(r * place)}", f"velocity = {numbers(v * along_it)}"]
        lines += ['epoch = "2027-03-20T12:00:00Z"', "[environment]", f"gravity_gradient = {some('true', 'false')}"]
    attitude, rate = unit(random), some(0.0, 0.1 * w) * random.normal(size=3)
    lines += ["[initial]", f"attitude = {numbers(attitude)}", f"rate = {numbers(rate)}"]
    if "targets" in kinds:
        lines += target_of(random, some, size, numbers, orbit, w)
    else:
        lines += ["[target]", f'mode = "{some("inertial", "orbital") if orbit else "inertial"}"']
    if wheels:
        lines += wheels_of(random, some, size, float(np.linalg.eigvalsh(J)[0]), k, w, w * scale, period)
        if "lost" in kinds and 'layout = "pyramid"' in lines:
            lines += ["[[fault]]", f"time = {3 * period!r}", f"wheel = {int(random.integers(1, 5))}", "lost = true"]
            lines += [f"delay = {2 * period!r}", 'action = "reallocate"']
    law = some("lyapunov", "wheel", "wheel") if wheels else some("lyapunov", "lyapunov", "pd", "matrix-pd", "lqr", "wheel")
    law = "mpc" if "plans" in kinds else "pid" if "integral" in kinds else law
    lines += [*parts_of(random, some, size, numbers, orbit, wheels, k, w, period, "delayed" in kinds)]
    if "late" in kinds:
        lag, limit = size(0.05, 3.0) * period, size(0.3, 30.0) * k * w
        lines[2:2] = [some(f"actuator_lag = {lag:.6g}", f"torque_rate_limit = {limit:.6g}")]
    if "shaken" in kinds:
        lines += ["[[part]]", 'type = "random-torque"', f"deviation = {size(1e-5, 1e-3) * k:.6g}"]
    lines += ["[simulation]", f"duration = {100.0 * period!r}", f"control_period = {period!r}"]
    lines += ["substeps = 64"] * ("late" in kinds)
    lines += ["[certify]", f"disturbance = {size(1e-6, 3e-2) * k:.6g}", "[[law]]", f'type = "{law}"']
    lines += [f'quaternion_sign = "{some("as_published", "shortest", "hysteresis")}"']
    if law == "mpc":
        # Gains of about this stiffness and damping.
        weights = [f"q_rate = {(d / k * random.uniform(0.2, 1.2)) ** 2:.6g}", f"r = {1.0 / k**2:.6g}", "q_attitude = 1.0"]
        horizon, terminal = int(random.integers(1, 13)), some("riccati", "riccati", "riccati", "stage")
        weights += [f"horizon = {horizon}", f'terminal = "{terminal}"', f'limit = "{some("axis", "norm")}"']
        return "\n".join([*lines, *weights]) + "\n"
    if law in ("lyapunov", "pd"):
        return "\n".join([*lines, f"k_rate = {d:.6g}", f"k_attitude = {k:.6g}"]) + "\n"
    if law == "pid":
        limit = f"integral_limit = {size(1e-4, 1e-1) * k:.6g}"
        gains = [f"k_rate = {d:.6g}", f"k_attitude = {k:.6g}", f"k_integral = {size(1e-3, 0.5) * k * d / scale:.6g}", limit]
        return "\n".join([*lines, *gains]) + "\n"
    spread = random.uniform(0.7, 1.4, size=3) if some(0, 1) else np.ones(3)
    # In proportion to the inertia, or not.
    shape = J / scale if some(0, 1) and law != "wheel" else np.eye(3)
    if law == "wheel":
        gains = [f"k_rate = {d:.6g}", f"k_attitude = {numbers(k * spread)}", f"compensation = {some(1.0, 1.0, 0.0)}"]
        return "\n".join([*lines, *gains]) + "\n"
    shape = shape * spread if np.allclose(shape, np.diag(np.diag(shape))) else shape
    gains = [f"k_rate = {json.dumps((d * shape).tolist())}", f"k_attitude = {json.dumps((k * shape).tolist())}"]
    return "\n".join([*lines, *gains, *([f"gyroscopic = {some(0.0, 1.0)}"] if law == "lqr" else [])]) + "\n"


def wheels_of(random, some, size, least, k, w, momentum, period):
    """Lines of wheels on a body of this least moment; momentum: of the body as it turns as fast as its loop."""
    share, layout = 10.0 ** random.uniform(-4, -2), some("orthogonal", "pyramid")
    stored, torque, most = some(0.0, size(1e-3, 0.1) * momentum), size(0.3, 10.0) * k, size(0.5, 10.0) * momentum
    # Neither as fast as no wheel is, nor as heavy as the body.
    most = min(most, float(f"{0.1 * least * FASTEST:.6g}"))
    rotor = max(share * least, most / FASTEST)
    lines = ["[wheels]", f'layout = "{layout}"', f'inertia = "{rotor:.6g} kg m^2"', f"momentum = {stored:.6g}"]
    lines += [f'torque_limit = "{torque:.6g} N m"', f'momentum_limit = "{most:.6g} N m s"']
    viscous, coulomb, rubs = size(1e-6, 1e-3) * w * rotor, size(1e-6, 1e-3) * k, some(0, 1)
    # What is stiffer within a period needs substeps.
    coulomb = min(coulomb, 0.1 * CREEP * rotor / period)
    return lines + [f"viscous = {viscous:.6g}", f"coulomb = {coulomb:.6g}"] * rubs


def target_of(random, some, size, numbers, orbit, w):
    """Lines of a target that moves, by no more than the loop can follow."""
    kind = some("scan", "yaw-steering", "ground-station", "ground-strip", "slew") if orbit else "slew"
    given = ["[[part]]", f'type = "{kind}"']
    if kind == "scan":
        swing = size(0.02, 1.0) * w
        given += [
            f"amplitude = {size(0.05, 1.0):.6g}",
            f"swing = {2 * math.pi / swing:.6g}",
            f'shape = "{some("sinusoidal", "raster")}"',
        ]
    elif kind == "ground-station":
        given += [f"latitude = {random.uniform(-1.5, 1.5):.6g}", f"longitude = {random.uniform(-3.0, 3.0):.6g}"]
        given += [f"elevation = {random.uniform(0.1, 1.3):.6g}"]
    elif kind == "ground-strip":
        ends = random.uniform(-1.4, 1.4), random.uniform(-3.0, 3.0)
        given += [f"{key} = {x:.6g}" for key, x in zip(("latitude", "longitude"), ends, strict=True)]
        given += [f"to_{key} = {x + size(1e-3, 0.1):.6g}" for key, x in zip(("latitude", "longitude"), ends, strict=True)]
        given += ["begin = 0", f"duration = {size(10.0, 300.0):.6g}"]
    elif kind == "slew":
        given += [f"attitude = {numbers(unit(random))}", f"rate = {size(1e-3, 0.2) * w:.6g}"]
        given += [f"acceleration = {size(1e-4, 0.03) * w * w:.6g}"]
    return given


def parts_of(random, some, size, numbers, orbit, wheels, k, w, period, delayed=False):
    """Lines of parts that disturb and measure, each as large as it may be for its bound to be of use."""

    def vector(length):
        return numbers(length * along(random.normal(size=3)))

    def part(name, **keys):
        return ["[[part]]", f'type = "{name}"', *(f"{key} = {value}" for key, value in keys.items())]

    chance = random.uniform(size=8) < 0.35
    if chance[0]:
        yield from part("constant-torque", torque=vector(size(1e-6, 1e-2) * k), axes=some('"body"', '"inertial"'))
    if orbit:
        side = math.sqrt(size(1e-4, 1.0))
        plate = [0.1, *along(random.normal(size=3)), *(side * random.normal(size=3))]
        if chance[1]:
            yield from part("residual-dipole", dipole=vector(size(1e-2, 1e2) * k))
        if chance[2]:
            yield from part("drag", plates=f"[{numbers(plate)}]", density=size(1e-14, 1e-12))
        if chance[3]:
            yield from part("solar-pressure", plates=f"[{numbers([*plate, 0.3, 0.4])}]")
        if chance[4]:
            yield from part("oblateness")
    if delayed and some(0, 1):
        # Late readings without a filter, or with one.
        built = {"delay": size(0.01, 0.1) / w, "scale_error": some(0.0, 1e-3), "mounting_error": vector(size(1e-5, 1e-2))}
        yield from part("gyro", bias=vector(size(1e-5, 1e-2) * w), **built | {"delay": some(0.0, size(0.003, 0.03) / w)})
        late = {"delay": min(built["delay"], 60.0 * period), "interval": period * some(1, 1, 3)}
        yield from part("star-tracker", cross=some(0.0, 1e-5), roll=1e-5, **late)
    elif delayed:
        yield from part("gyro", bias=vector(1e-3 * w), noise=size(1e-6, 1e-4) * w, scale_error=some(0.0, 1e-3))
        late = {"delay": min(some(0.0, size(0.01, 0.1)) / w, 60.0 * period), "interval": period * some(1, 2, 4)}
        yield from part("star-tracker", cross=size(1e-6, 1e-4), roll=size(1e-6, 1e-4), **late)
        gain = size(0.2, 0.9)
        yield from part("complementary-filter", attitude_gain=gain, bias_gain=size(5e-3, 0.1) * gain**2 / late["interval"])
    elif chance[5]:
        # Readings without a filter.
        yield from part("gyro", bias=vector(size(1e-5, 1e-2) * w), noise=some(0.0, size(1e-6, 1e-4) * w * math.sqrt(period)))
        yield from part("star-tracker", cross=some(0.0, 1e-5), roll=some(0.0, 1e-5), mounting_error=vector(size(1e-5, 1e-2)))
    elif chance[6]:
        noise, walk, cross, roll = size(1e-5, 1e-3) * w, size(1e-5, 1e-3) * w, size(1e-5, 1e-3), size(1e-5, 1e-3)
        every = period * some(1, 1, 2, 4)
        same = {"noise": noise, "bias_walk": walk}
        yield from part("gyro", bias=vector(1e-3 * w), **same)
        yield from part("star-tracker", cross=cross, roll=roll, interval=every)
        yield from part("mekf", bias=1e-3 * w, **same)
    if orbit and wheels and chance[7]:
        yield from part("magnetometer", noise=size(1e-9, 1e-7), bias=vector(size(1e-9, 1e-7)))
        yield from part("magnetic-unloading", gain=size(1e-4, 1e-2) * w, dipole_limit=size(1e-2, 1.0) * k / 1e-5)
