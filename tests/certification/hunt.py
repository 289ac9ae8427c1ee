"""Random scenarios, certified, checked and flown: whatever breaks between certifier, checker and flights is a fault."""

import json
import math
import re
from dataclasses import replace

import numpy as np

from starhold.analysis.departure import start_inside
from starhold.analysis.trial import fly_claims
from starhold.certification.certificate import write
from starhold.certification.certify import certify
from starhold.certification.wording import evidence, sentence
from starhold.checker import check_file, passed
from starhold.errors import InputError
from starhold.parts.craft import check_inertia
from starhold.scenario.building import build
from starhold.scenario.reading import load, parse
from starhold.studies.bodies.rigid_body import certify_law
from starhold.studies.compare import fly_law, prove

EARTH, RADIUS = 3.986e14, 6.4e6


def random_scenario(random, folder):
    """The text of a scenario: spacecraft, orbit, target, wheels, a law and a [certify] table, all at random. A history that
    the target follows is written into the folder."""

    def some(*choices):
        return choices[int(random.integers(len(choices)))]

    def size(low, high):
        return float(f"{10.0 ** random.uniform(math.log10(low), math.log10(high)):.6g}")

    def numbers(array):
        return json.dumps(np.asarray(array).tolist())

    def maybe(chance):
        return random.uniform() < chance

    J = random_inertia(random, size(1e-3, 1e3))
    scale = float(np.trace(J)) / 3.0
    lines = ['name = "hunted"', "[spacecraft]", f"inertia = {numbers(J if J.any() else np.diagonal(J))}"]
    if maybe(0.7):
        lines += [f"torque_limit = {size(1e-4, 1e-1) * scale:.6g}", f'limit = "{some("axis", "norm", "axis", "none")}"']
    orbit = maybe(0.5)
    if orbit:
        place, along, _ = np.linalg.qr(random.normal(size=(3, 3)))[0]
        r = RADIUS * random.uniform(1.05, 3.0)
        v = math.sqrt(EARTH / r) * (some(1.0, 1.0, random.uniform(0.99, 1.4)) * along + some(0.0, 0.02) * place)
        lines += ["[orbit]", f"position = {numbers(r * place)}", f"velocity = {numbers(v)}"]
        lines += ["[environment]", f"gravity_gradient = {some('true', 'true', 'false')}"]
    period = some(0.1, 0.1, 0.5, 1.0, 0.02, size(0.01, 100.0))
    steps = int(random.integers(4, 400))
    lines += [
        "[initial]",
        f"attitude = {numbers(unit(random))}",
        f"rate = {numbers(size(1e-5, 0.3) * random.normal(size=3))}",
    ]
    mode = some("inertial", "orbital" if orbit else "inertial", "history")
    lines += ["[target]", f'mode = "{mode}"']
    if mode == "history":
        write_history(random, folder / "history.csv", steps * period)
        lines.append('file = "history.csv"')
    elif mode == "inertial" and maybe(0.5):
        lines.append(f"attitude = {numbers(unit(random))}")
    if maybe(0.4):
        lines += ["[wheels]", f'layout = "{some("orthogonal", "pyramid", "nasa-standard")}"']
        lines += [
            f'inertia = "{size(1e-5, 1e-2) * scale:.6g} kg m^2"',
            f"momentum = {some(0.0, size(1e-5, 1e-2) * scale):.6g}",
        ]
        lines += [f'torque_limit = "{size(1e-4, 1e-1) * scale:.6g} N m"' if maybe(0.8) else 'torque_limit = "1e9 N m"']
        lines += [
            f'momentum_limit = "{size(1e-3, 1.0) * scale:.6g} N m s"' if maybe(0.7) else 'momentum_limit = "1e9 N m s"'
        ]
        lines += [f"viscous = {size(1e-8, 1e-4) * scale:.6g}"] if maybe(0.2) else []
        lines += ['allocation = "least-peak"'] if maybe(0.15) else []
    lines += ["[simulation]", f"duration = {steps * period!r}", f"control_period = {period!r}"]
    lines.append("[certify]")
    lines += [some('rate = "any"', f"rate = {size(1e-6, 1.0)}")] if maybe(0.3) else []
    lines += [f"slew_angle = {some(size(1e-9, 1e-2), random.uniform(0.01, math.pi), math.pi)!r}"] if maybe(0.4) else []
    lines += [f"inertia_tolerance = {some(size(1e-6, 1.0), 1.0)}"] if maybe(0.3) else []
    lines += [f"disturbance = {size(1e-8, 1e-3) * scale:.6g}"] if maybe(0.4) else []
    lines += [f"momentum = {some(0.0, size(1e-4, 1.0) * scale):.6g}"] if maybe(0.2) else []
    lines += random_law(random, some, size, numbers, J, scale)
    return "\n".join(lines) + "\n"


def unit(random):
    """A quaternion of length 1, uniform."""
    found = random.normal(size=4)
    return found / np.linalg.norm(found)


def random_inertia(random, scale):
    """A tensor: full or of principal axes, of a ball, a plate, a rod, or next to it."""
    kind = random.integers(5)
    moments = [
        random.uniform(1.0, 2.0, size=3),
        np.array([1.0, 1.0, 1.0]),
        np.array([1.0, 1.0, 2.0]) + np.array([0.0, 0.0, -1.0]) * 10.0 ** random.uniform(-16, -1),
        np.array([10.0 ** random.uniform(-14, -1), 1.0, 1.0]),
        random.uniform(1.0, 2.0, size=3),
    ][kind]
    J = np.diag(random.permutation(scale * moments))
    if random.uniform() < 0.5:
        turned = np.linalg.qr(random.normal(size=(3, 3)))[0]
        J = turned @ J @ turned.T
        J = (J + J.T) / 2.0
    try:
        check_inertia(J)
    except ValueError:
        return np.diag(scale * random.uniform(1.0, 1.9, size=3))
    return J


def write_history(random, path, duration):
    """Attitudes at times that cover the run: at rest, turning evenly, or tumbling."""
    count = int(random.integers(2, 12))
    times = np.concatenate([[0.0], np.sort(random.uniform(0.02, 0.98, size=count)) * duration, [duration * 1.0001]])
    times[1:-1] += np.arange(count) * 1e-3 * duration
    times = np.sort(times)
    step = [0.0, 0.05, 0.5, 1.0][random.integers(4)]
    axis = random.normal(size=3)
    q, rows = random.normal(size=4), []
    for t in times:
        rows.append([t, *(q / np.linalg.norm(q))])
        turn = step * (axis if step == 0.05 else random.normal(size=3))
        half = np.concatenate([[1.0], turn / 2.0])
        q = np.array([q[0] * half[0] - q[1:] @ half[1:], *(q[0] * half[1:] + half[0] * q[1:] + np.cross(q[1:], half[1:]))])
    path.write_text("time,q0,q1,q2,q3\n" + "\n".join(",".join(repr(float(x)) for x in row) for row in rows) + "\n")


def random_law(random, some, size, numbers, J, scale):
    """The lines of a law, its quaternion sign included."""
    w = size(1e-3, 3.0)
    k, d = w * w * scale, 2.0 * w * scale * random.uniform(0.05, 2.0)
    spread = random.uniform(0.5, 2.0, size=3)

    def matrix(c):
        if random.uniform() < 0.5:
            return numbers(c * spread)
        slant = random.normal(size=(3, 3)) * 0.2
        return numbers(c * (np.eye(3) + (slant + slant.T) / 2.0 + some(0.0, 0.0, 0.1) * (slant - slant.T)))

    kind = some("pd", "lyapunov", "matrix-pd", "lqr", "lqr-form", "sliding", "modal", "wheel", "wheel")
    name = kind.removesuffix("-form")
    lines = ["[[law]]", f'type = "{name}"', f'quaternion_sign = "{some("as_published", "shortest", "hysteresis")}"']
    if random.uniform() < 0.3:
        lines.append(f"hysteresis_width = {random.uniform(0.01, 0.99):.4g}")
    if kind in ("pd", "lyapunov"):
        lines += [f"k_rate = {d:.6g}", f"k_attitude = {k:.6g}"]
        lines += [f'limit = "{some("none", "axis")}"'] if kind == "pd" else []
    elif kind in ("matrix-pd", "lqr"):
        stiff = some(numbers(2.0 * w * w * J), matrix(k), matrix(k))
        lines += [f"k_rate = {matrix(d)}", f"k_attitude = {stiff}"]
        lines += [f"gyroscopic = {some(0.0, 1.0, random.uniform()):.4g}"] if kind == "lqr" else []
    elif kind == "lqr-form":
        lines += ['form = "I"', f"a = {size(1e-3, 10.0)}", f"b = {w * w:.6g}", f"gyroscopic = {some(0.0, 1.0)}"]
    elif kind == "sliding":
        slope = some(f"{w:.6g}", matrix(w))
        lines += [f"surface_gain = {slope}", f"switching_gain = {size(1e-6, 1e-2) * scale:.6g}"]
        lines += [f"boundary_layer = {some(0.0, size(1e-6, 1.0)):.6g}"]
    elif kind == "modal":
        b = f"b = {-size(1e-4, 10.0)}"
        lines += some([f"phi_0 = {-w:.6g}", f"phi_1 = {-w:.6g}", b], ['form = "equal"', f"a = {-w:.6g}", b])
    else:
        lines += [f"k_rate = {d:.6g}", f"k_attitude = {some(numbers([k] * 3), numbers(k * spread))}"]
        lines += [f"compensation = {some(1.0, 1.0, 0.0, random.uniform()):.4g}"]
    return lines


PARTS = (
    '[[part]]\ntype = "lag"\nlag = {:.6g}\n',
    '[[part]]\ntype = "random-torque"\ndeviation = {:.6g}\n',
    '[[part]]\ntype = "constant-torque"\ntorque = [{:.6g}, 0.0, 0.0]\n',
    '[[fault]]\ntime = {:.6g}\ninertia = [1.0, 1.1, 1.2]\naction = "none"\n',
    '[[fault]]\ntime = {:.6g}\nwheel = 1\nlost = true\naction = "none"\n',
)
"""What a flight may have besides: claims are to leave it out by name, take it in, or end where it acts."""
DECAYS = 30.0
"""Time constants of the slowest root of the sampled loop after which a flight has come to its end."""


def contradicted(text, random, folder):
    """Which proved claim a long flight of a scenario contradicts though it keeps to all that the claim assumes; "" for none.
    Some of `PARTS` are added at random."""
    # Few flights would meet the assumptions otherwise.
    text = re.sub(r"(gravity_gradient = ).*", r"\1false", re.sub(r"(?s)torque_limit = .*?\nlimit = .*?\n", "", text))
    text += "".join(more.format(10.0 ** random.uniform(-4.0, 1.0)) for more in PARTS if random.uniform() < 0.15)
    try:
        scenario = parse(text, "hunted.toml", folder)
        entry = scenario.laws[0]
        loop = build(scenario, entry)
        sampled = certify(replace(loop, events=())).claim("sampling")
        steps = -DECAYS / math.log(sampled.numbers["radius"]) if sampled and sampled.outcome == "proved" else 400.0
        if scenario.table.target.mode != "history":
            scenario = scenario.with_({"simulation.duration": math.ceil(min(steps, 1e5)) * loop.period})
            loop = build(scenario, entry)
    except InputError:
        return ""
    flight = prove(scenario, entry, loop, fly_law(scenario, entry, loop))
    run, ended = flight.recording, len(flight.recording["time"]) > min(steps, 1e5)
    angle, rate = np.linalg.norm(run["attitude_error"][:, 1:], axis=1), np.linalg.norm(run["rate_error"], axis=1)
    for place, certificate in enumerate(flight.certificates):
        for claim in certificate.claims:
            told = claim.numbers
            if claim.outcome != "proved" or claim.kind == "sampling" or flight.left(place, claim.kind) or place:
                continue
            if claim.kind == "torque-limit" and np.abs(run["command"]).max() > told["limit"] * (1.0 + 1e-12):
                return f"{claim.kind}: a torque of {np.abs(run['command']).max():g} N m"
            if ended and steps < 1e5:
                bound = told.get("angle", 0.0), told.get("rate", 0.0) if "angle" in told else 0.0
                found = 2.0 * math.asin(min(1.0, angle[-1])), rate[-1]
                # With momentum stored in wheels the roots are others, and the motion may still be on its way.
                coming = angle[-1] < 0.5 * angle[len(angle) // 2]
                if not coming and (found[0] > bound[0] + 1e-3 or found[1] > bound[1] + 1e-3 * max(rate.max(), 1e-3)):
                    return f"{claim.kind}: it ends {found[0]:g} rad and {found[1]:g} rad/s from the target"
    return ""


def fault_in(text, folder, flights=2_000):
    """What is wrong with what the program does with a scenario; "" where nothing is, or it is refused in one line."""
    path = folder / "hunted.toml"
    path.write_text(text, encoding="utf-8")
    try:
        scenario = load(path)
        entry = scenario.laws[0]
        loop = build(scenario, entry)
    except InputError:
        return ""
    for certificate, now, *_ in certify_law(scenario, entry, loop):
        start_inside(certificate, now)
        for claim in certificate.claims:
            sentence(claim, certificate.subject)
            for obligation in claim.obligations:
                evidence(obligation)
        write([certificate], "hunted", folder / "certificate.json")
        findings = check_file(folder / "certificate.json")
        if not passed(findings):
            return "; ".join(
                f"{f.claim}, {f.obligation}: {f.reason}" for f in findings if f.verdict in ("fails", "not checked")
            )
        fly_claims(now, certificate, flights)
    return ""
