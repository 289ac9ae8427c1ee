"""Flexible appendages: hinged panels against Basilisk, modes against their coupled equations, integrated by SciPy."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import starhold as sh
from starhold.algebra.cosines import from_angles
from starhold.parts.catalogue import fit
from starhold.scenario.reading import parse
from tests.making import HUB, flown, hub
from tests.oracles.basilisk import need, simulation
from tests.parts.files import BODY, PD, part
from tests.refusals import refused

MASS = 30.0
ROWS = np.array(
    [
        (0.4, 0.5, 0.1, 0.0, 0.1, 1.0, 0.2, 0.6, 0.1, 0.05, 0.010, 0.005, 0.015, 0.20, 0.0, 0.15),
        (0.3, -0.5, 0.0, 0.1, 0.1, 1.0, 0.0, -0.7, 0.1, 0.05, 0.012, 0.005, 0.016, 0.30, 0.0, -0.1),
        (0.2, 0.0, 0.4, 0.1, 1.0, 0.0, 0.3, 0.0, 0.5, 0.0, 0.004, 0.002, 0.006, 0.10, 0.0, 0.0),
    ]
)
RATE, ANGLES = (0.12, -0.2, 0.15), (0.4, -0.3, 0.2)


def panels(damping, count=3):
    """Rows of the part with these dampers."""
    rows = ROWS[:count].copy()
    rows[:, 14] = damping
    return tuple(map(tuple, rows.tolist()))


def free(part, substeps=20):
    """A craft on which nothing acts from outside; the inertia of the whole is HUB, panels at rest."""
    return hub(part, rate=RATE, attitude=from_angles(*ANGLES), substeps=substeps, command_limit=0.0)


def dyad(x):
    """The inertia of a unit mass at a place."""
    return x @ x * np.eye(3) - np.outer(x, x)


def bodies(rows):
    """Hub and panels as (mass, inertia about the own centre, hinge, axis, centre from the hinge), panels at rest: what makes
    the whole have its mass and inertia about its centre of mass."""
    found, inertia, moment = [], HUB.copy(), np.zeros(3)
    for row in np.array(rows):
        hinge, axis, centre = row[1:4], row[4:7] / np.linalg.norm(row[4:7]), row[7:10]
        out = centre - axis * (axis @ centre)
        frame = np.array([axis, out / np.linalg.norm(out), np.cross(axis, out / np.linalg.norm(out))])
        own = frame.T @ np.diag(row[10:13]) @ frame
        found.append((row[0], own, hinge, axis, centre))
        inertia -= own + row[0] * dyad(hinge + centre)
        moment -= row[0] * (hinge + centre)
    mass = MASS - sum(body[0] for body in found)
    hub = mass, inertia - mass * dyad(moment / mass), moment / mass
    assert np.linalg.eigvalsh(hub[1])[0] > 0.0
    return hub, found


def test_panels_swing_as_in_basilisk():
    need()
    from Basilisk.simulation import hingedRigidBodyStateEffector, spacecraft

    rows = panels(0.02)
    run = flown(free(fit("effector", "hinged-panels", MASS, rows)), 200)
    craft = spacecraft.Spacecraft()
    (mass, inertia, centre), others = bodies(rows)
    craft.hub.mHub, craft.hub.IHubPntBc_B, craft.hub.r_BcB_B = mass, inertia.tolist(), [[x] for x in centre]
    craft.hub.omega_BN_BInit = [[x] for x in RATE]
    made = []
    for row, (mass, _, hinge, axis, centre) in zip(rows, others, strict=True):
        panel = hingedRigidBodyStateEffector.HingedRigidBodyStateEffector()
        out = centre - axis * (axis @ centre)
        length = np.linalg.norm(out)
        # Its panels lie along the negative first axis from the hinge, which is their second.
        frame = np.array([-out / length, axis, np.cross(-out / length, axis)])
        panel.mass, panel.d, panel.k, panel.c, panel.thetaInit = mass, length, row[13], row[14], row[15]
        panel.IPntS_S = np.diag([row[11], row[10], row[12]]).tolist()
        panel.r_HB_B, panel.dcm_HB = [[x] for x in hinge + centre - out], frame.tolist()
        craft.addStateEffector(panel)
        made.append(panel)
    logs = [craft.scStateOutMsg.recorder(), *(panel.hingedRigidBodyOutMsg.recorder() for panel in made)]
    _running, run_to = simulation(0.005, craft, *made, *logs)
    run_to(20.0)
    assert np.abs(run["rate"] - logs[0].omega_BN_B[::20]).max() < 1e-9
    assert np.abs(run["panel_angle"] - np.array([log.theta[::20] for log in logs[1:]]).T).max() < 1e-9


COUPLING = np.array([(0.5, 0.2, 0.9), (-0.3, 0.6, 0.1)])
FREQUENCY = np.array([2.0, 3.5])


def modes(damping, deflection=0.03):
    """Rows of the part with these dampers."""
    columns = FREQUENCY, (damping, damping), *COUPLING.T, (deflection, 0.0)
    return tuple(tuple(float(x) for x in row) for row in zip(*columns, strict=True))


@pytest.mark.parametrize("damping", [0.0, 0.05])
def test_modes_move_as_the_coupled_equations_say_and_keep_energy_and_momentum(damping):
    run = flown(free(fit("effector", "flexible-modes", modes(damping)), substeps=40), 200 if damping else 1800)
    mass = np.block([[HUB, COUPLING.T], [COUPLING, np.eye(2)]])
    w, x, v = run["rate"], run["mode_deflection"], run["mode_rate"]

    def slope(_, y):
        w, x, v = y[:3], y[3:5], y[5:]
        spring = FREQUENCY * (2.0 * damping * v + FREQUENCY * x)
        *spin, first, second = np.linalg.solve(mass, [*-np.cross(w, HUB @ w + v @ COUPLING), *-spring])
        return [*spin, *v, first, second]

    times = run["time"][:201]
    exact = solve_ivp(slope, (0.0, times[-1]), [*w[0], *x[0], *v[0]], "DOP853", times, rtol=1e-12, atol=1e-14).y.T
    assert np.abs(np.hstack([w, x, v])[:201] - exact).max() < 1e-9
    turns = Rotation.from_quat(run["attitude"], scalar_first=True)
    momentum = turns.apply(w @ HUB + v @ COUPLING)
    assert np.abs(momentum - momentum[0]).max() < 1e-10 * np.linalg.norm(momentum[0])
    moving = np.hstack([w, v])
    energy = 0.5 * np.einsum("ti,ij,tj->t", moving, mass, moving) + 0.5 * np.sum((FREQUENCY * x) ** 2, 1)
    if damping:
        assert np.diff(energy).max() < 0.0
        assert energy[-1] < 0.99 * energy[0]
    else:
        assert np.abs(energy / energy[0] - 1.0).max() < 1e-10
        assert np.ptp(x, axis=0).min() > 0.005


def test_a_fault_that_leaves_the_hub_no_inertia_is_refused():
    modes = part('type = "flexible-modes"\nmodes = [[0.6, 0.005, 2.0, 0, 0, 0]]\n')
    sh.simulate(parse(BODY + modes + PD, "own"))
    fault = '[[fault]]\ntime = 1.0\ninertia = [3.9, 4.0, 4.0]\naction = "none"\n'
    with refused("part flexible-modes: the modes carry more inertia"):
        sh.simulate(parse(BODY + modes + fault + PD, "own"))
