"""Forces of air, sunlight and thrusters move the orbit: against SciPy, the decay of a circle, and impulses."""

import math
from dataclasses import replace
from types import SimpleNamespace

import erfa
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import starhold as sh
from starhold.parts.catalogue import find, fit
from starhold.parts.contract import Envelope
from starhold.parts.craft import EARTH as GRAVITY
from starhold.parts.environments import drag
from starhold.parts.epoch import days_of
from starhold.parts.plates import BOX
from starhold.parts.sun import EARTH, PRESSURE
from tests.making import flown, hub, orbited
from tests.refusals import refused
from tests.texts import toml

MASS, TURN = 12.0, (0.6, 0.0, 0.8, 0.0)
BODY = Rotation.from_quat(TURN, scalar_first=True)
"""Turns body axes to inertial ones; without a torque the craft rests so."""
PLATES = ((0.9, 1.0, 0.0, 0.0), (0.5, -1.0, 0.0, 0.0), (0.4, 0.0, 0.6, 0.8), (0.7, 0.0, -0.6, -0.8))
AREAS, NORMALS = np.array(PLATES)[:, 0], BODY.apply(np.array(PLATES)[:, 1:])
ROWS = tuple((*plate, 0.0, 0.0, 0.0) for plate in PLATES)
HEIGHTS, FLUXES = (2.8e5, 3.1e5, 3.6e5, 4.2e5), (80.0, 200.0)
AIR = {(h, f): 3e-11 * math.exp(-(h - 3e5) / (3.5e4 + 0.1 * (h - 2.8e5)) + f / 300.0) for h in HEIGHTS for f in FLUXES}
TABLE = tuple((*pair, density) for pair, density in AIR.items())


def orbiting(part, height=3.2e5, inclination=0.9, period=1.0):
    """A craft at rest on a circular orbit."""
    r, v = EARTH + height, math.sqrt(GRAVITY / (EARTH + height))
    loop = hub(fit("environment", "two-body"), *part, rate=(0.0, 0.0, 0.0), attitude=TURN, period=period, substeps=1)
    speed = (0.0, v * math.cos(inclination), v * math.sin(inclination))
    return replace(loop, start=loop.start._replace(position=(r, 0.0, 0.0), velocity=speed), command_limit=0.0)


def integrated(loop, push, times):
    """Positions and velocities (n, 6) from the start of a loop, with this acceleration beside the attraction."""
    return orbited(loop.start.position, loop.start.velocity, times, push)


def by_drag(density, rotation=1.0):
    def push(t, r, v):
        wind = v - np.cross((0.0, 0.0, rotation * drag.TURN), r)
        area = AREAS @ np.maximum(NORMALS @ wind / np.linalg.norm(wind), 0.0)
        return -0.5 * density(np.linalg.norm(r) - EARTH) * 2.2 * area / MASS * np.linalg.norm(wind) * wind

    return push


def by_table(flux):
    share = (flux - FLUXES[0]) / (FLUXES[1] - FLUXES[0])
    logs = [(1.0 - share) * math.log(AIR[h, FLUXES[0]]) + share * math.log(AIR[h, FLUXES[1]]) for h in HEIGHTS]
    return lambda h: math.exp(np.interp(h, HEIGHTS, logs))


@pytest.mark.parametrize("air", ["exponential", "table"])
def test_drag_against_scipy(air):
    more = {"table": TABLE, "flux": 130.0} if air == "table" else {"density": 3e-11, "height": 3e5, "scale_height": 5e4}
    density = by_table(130.0) if air == "table" else lambda h: 3e-11 * math.exp((3e5 - h) / 5e4)
    part = find("environment", "drag").params(ROWS, moves_orbit=1, mass=MASS, **more)
    loop, errors = orbiting([fit("environment", "drag", *part)]), []
    for period, steps in ((4.0, 700), (1.0, 2800)):
        run = flown(replace(loop, period=period), steps)
        expected = integrated(loop, by_drag(density), [0.0, 2800.0])[-1, :3]
        free = integrated(loop, None, [0.0, 2800.0])[-1, :3]
        moved = np.linalg.norm(expected - free)
        errors.append(np.linalg.norm(run["position"][-1] - expected) / moved)
    assert moved > 300.0
    # Held for a control period, the force is late by half of one.
    assert errors[1] < 2e-3
    assert errors[0] == pytest.approx(4.0 * errors[1], rel=0.1)


def test_no_torque_in_the_air_of_a_table_exceeds_the_bound():
    """Below, between and above the rows."""
    params, random = find("environment", "drag").params(BOX, table=TABLE, flux=130.0), np.random.default_rng(3)
    numbers = drag.prepare(params, 1.0)
    for place in EARTH + np.linspace(2.5e5, 4.8e5, 12):
        speed, torques = math.sqrt(GRAVITY / place), []
        for attitude in Rotation.random(200, random_state=random).as_quat().tolist():
            state = SimpleNamespace(position=(place, 0.0, 0.0), velocity=(0.0, -speed, 0.0), attitude=attitude)
            memory = drag.update(None, state, numbers, None, 0)
            torques.append(np.linalg.norm(drag.torque(state, numbers, None, memory)))
        bound = drag.bound(params, Envelope(place, speed, 0.0, 0.0)).torque
        assert 0.5 * bound < max(torques) <= bound


def test_a_circle_decays_as_its_derivative_says():
    density, height = 1e-11, 4e5
    part = find("environment", "drag").params(ROWS, 2.2, density, 0.0, 1e12, 0.0, moves_orbit=1, mass=MASS)
    ball = part._replace(plates=(*((1.0, *row[1:]) for row in ROWS[:2]), (1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0)))
    loop = orbiting([fit("environment", "drag", *ball)], height)
    orbit = math.tau * math.sqrt((EARTH + height) ** 3 / GRAVITY)
    run = flown(replace(loop, period=orbit / 3000.0), 3000)
    r, v = run["position"][[0, -1]], run["velocity"][[0, -1]]
    found = np.diff(1.0 / (2.0 / np.linalg.norm(r, axis=1) - (v * v).sum(1) / GRAVITY))[0]
    course = run["velocity"][:-1] / np.linalg.norm(run["velocity"][:-1], axis=1)[:, None]
    area = np.maximum(np.stack([ball.plates[k][1:4] for k in range(3)]) @ BODY.inv().apply(course).T, 0.0).sum(0).mean()
    # da/dt = -C_D A/m rho sqrt(mu a), all the way round.
    assert found == pytest.approx(-2.2 * area / MASS * density * math.sqrt(GRAVITY * (EARTH + height)) * orbit, rel=1e-3)


def test_sunlight_against_scipy():
    epoch, height = (2026.0, 3.0, 20.0, 12.0, 0.0, 0.0), 1.2e6
    days = days_of(epoch)
    seen = -erfa.pmat06(2451545.0, days) @ erfa.epv00(2451545.0, days)[0]["p"]
    sun = seen / np.linalg.norm(seen)
    shares = ((0.2, 0.3), (0.1, 0.5), (0.0, 0.4), (0.6, 0.1))
    rows = tuple((*row, *share) for row, share in zip(ROWS, shares, strict=True))
    part = find("environment", "solar-pressure").params(rows, epoch, moves_orbit=1, mass=1e-3 * MASS)
    # Towards the Sun along the first axis on this day: over the poles it is always in view.
    loop = orbiting([fit("environment", "solar-pressure", *part)], height, math.pi / 2.0)
    r, v = loop.start.position[0], loop.start.velocity
    loop = replace(loop, start=loop.start._replace(position=(0.0, r, 0.0), velocity=v))

    def push(*_):
        cosines = np.maximum(NORMALS @ sun, 0.0)
        mirrored, scattered = np.array(shares).T
        along = AREAS * cosines * 2.0 * (mirrored * cosines + scattered / 3.0)
        force = (AREAS * cosines * (1.0 - mirrored)).sum() * sun + along @ NORMALS
        return -PRESSURE / np.linalg.norm(seen) ** 2 * force / (1e-3 * MASS)

    run = flown(loop, 3000)
    expected, free = (integrated(loop, by, [0.0, 3000.0])[-1, :3] for by in (push, None))
    assert np.linalg.norm(run["position"][-1] - expected) < 1e-3 * np.linalg.norm(expected - free)


ARM, FORCE, SPECIFIC = 0.5, 0.4, 60.0
PLACED = (((0.0, ARM, 0.0), (0.0, 0.0, 1.0)), ((0.0, 0.0, ARM), (1.0, 0.0, 0.0)), ((ARM, 0.0, 0.0), (0.0, 1.0, 0.0)))
LAYOUT = [(k, s, *r, *(s * FORCE * x for x in f)) for k, (r, f) in enumerate(PLACED, 1) for s in (1.0, -1.0)]


def test_thrusters_push_by_their_impulse():
    params = find("effector", "thrusters").params((ARM * FORCE,) * 3, 0.02, (0.01,) * 3, (0.005,) * 3, 0, ARM, SPECIFIC)
    params = params._replace(layout=tuple(LAYOUT), moves_orbit=1, mass=MASS)
    run = flown(hub(fit("effector", "thrusters", *params), rate=(0.1, -0.2, 0.15), substeps=8, period=0.25), 120)
    turns = Rotation.from_quat(run["attitude"], scalar_first=True)
    forces = FORCE * np.array([f for _, f in PLACED])
    speed = np.zeros(3)
    for k, times in enumerate(run["thruster_time"][:-1]):
        # A pulse begins with the period; the body turns on at its mean rate.
        rate = (turns[k].inv() * turns[k + 1]).as_rotvec() / 0.25
        middles = [turns[k] * Rotation.from_rotvec(0.5 * abs(t) * rate) for t in times]
        speed += sum(m.apply(t * force) for m, t, force in zip(middles, times, forces, strict=True)) / MASS
    assert np.linalg.norm(speed) > 0.02
    assert np.linalg.norm(run["velocity"][-1] - speed) < 2e-3 * np.linalg.norm(speed)
    # The propellant of all impulses, by the rocket equation, is that recorded, but for the mass that it takes away.
    total, exhaust = np.abs(run["thruster_time"][:-1]).sum() * FORCE / MASS, SPECIFIC * 9.80665
    assert run["propellant"][-1] == pytest.approx(MASS * -math.expm1(-total / exhaust), rel=total / exhaust)


TEXT = toml("""
name = "decay"
[spacecraft] inertia = [2.0, 3.0, 4.0]; mass = "12 kg"
[orbit] altitude = "320 km"; inclination = "51 deg"
[simulation] duration = 10.0; control_period = 0.5
[[part]] type = "drag"; plates = [[1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0], [1.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0]]
moves_orbit = "yes"; table = "air.csv"; flux = 100
[[law]] type = "pd"; k_rate = 0.5; k_attitude = 0.1
""")
CSV = "height,flux,density\n" + "\n".join(",".join(map(str, row)) for row in TABLE)


def read(folder, change=("", ""), csv=CSV):
    (folder / "air.csv").write_text(csv)
    (folder / "own.toml").write_text(TEXT.replace(*change))
    return sh.load(folder / "own.toml")


@pytest.mark.parametrize(
    ("change", "csv", "said"),
    [
        (('mass = "12 kg"\n', ""), CSV, "part drag: a force that moves the orbit needs the spacecraft's mass"),
        (("flux = 100", "flux = 300"), CSV, "a flux of 300 is outside the table's, 80 to 200"),
        (("320 km", "500 km"), CSV, "the table of densities has heights of 280 to 420 km, the orbit has 500 to 500 km"),
        (("", ""), CSV.rsplit("\n", 1)[0], "the table needs one row for each pair of its heights"),
        (("", ""), CSV.replace("280000.0,", "500000.0,"), "densities above 0 that fall with the height"),
        (('"yes"', "1"), CSV, "moves_orbit: found 1; allowed: one of no, yes"),
        (("type = \"drag\"", "type = \"drag\"\nmass = 3"), CSV, "a key that the whole flight shares"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_refused_in_one_line(change, csv, said, tmp_path):
    with refused(said):
        sh.simulate(read(tmp_path, change, csv))


def test_a_layout_must_give_the_torque():
    params = find("effector", "thrusters").params((ARM * FORCE,) * 3, layout=tuple(LAYOUT[:-1]))
    with pytest.raises(ValueError, match=r"axis 3 and sense -1 give \[0, 0, 0\] N m, not \[0, 0, -0\.2\]"):
        find("effector", "thrusters").module.prepare(params, 0.5)


@pytest.mark.slow
def test_a_claim_names_the_force_that_it_leaves_out(tmp_path):
    for on in (True, False):
        scenario = read(tmp_path, ('moves_orbit = "yes"\n', "") if not on else ("", ""))
        claims = sh.certify(scenario)[0].claims
        assert all(
            any("environment drag" in one for one in claim.assumptions) == on for claim in claims if claim.kind == "pointing"
        )
