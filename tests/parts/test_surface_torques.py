"""Drag and sunlight against Basilisk, an independent simulator in C++."""

import numpy as np

from starhold.conformance.bench import CRAFT
from starhold.parts import sun
from starhold.parts.contract import Envelope
from starhold.parts.environments import drag, solar_pressure
from starhold.parts.plates import BOX, cosines, plates_of, total
from starhold.parts.sun import EARTH
from tests.oracles.basilisk import need, simulation
from tests.parts.fields import states

PERIOD = 0.5
EPOCH = (2026.0, 10.0, 9.0, 8.0, 7.0, 6.0)
PLATES = (*BOX[:5], (0.05, 0.6, 0.0, -0.8, 0.1, -0.2, 0.3))
"""Along the axes, of which kernels make constants, and a slanting one."""
AIR = drag.Params(PLATES, 2.1, 3.5e-12, 4e5, 5.8515e4, 1.2)
SIDES = tuple((*row, 0.1 * k, 0.5 - 0.1 * k) for k, row in enumerate(PLATES))
LIGHT = solar_pressure.Params(SIDES, EPOCH)


def torque(part, params, state, step=0):
    """The torque of a part at a state (N m, body axes)."""
    numbers = part.prepare(params, PERIOD)
    memory = part.update(part.remember(numbers), state, numbers, None, step)
    return np.array(part.torque(state, numbers, CRAFT, memory))


def in_basilisk(effector, state):
    """The torque (N m, body axes) that an effector of Basilisk gives a spacecraft at a state."""
    from Basilisk.simulation import spacecraft
    from Basilisk.utilities import RigidBodyKinematics

    craft = spacecraft.Spacecraft()
    craft.hub.mHub, craft.hub.IHubPntBc_B = 12.0, np.diag([2.0, 3.0, 4.0]).tolist()
    craft.hub.sigma_BNInit = RigidBodyKinematics.EP2MRP(np.array(state.attitude)).tolist()
    craft.hub.r_CN_NInit, craft.hub.v_CN_NInit = list(state.position), list(state.velocity)
    craft.addDynamicEffector(effector)
    _running, run_to = simulation(1e-6, craft, effector)
    run_to(2e-6)
    return np.array(effector.torqueExternalPntB_B).ravel()


def test_two_sides_of_a_box_share_products_without_rounding():
    rows = (*BOX, (0.05, 0.6, 0.0, -0.8, 0.1, -0.2, 0.3))
    _, normals, centres = plates_of(rows)
    for direction in [*np.random.default_rng(3).normal(size=(200, 3)).tolist(), [0.0, -1.0, 0.0]]:
        along = [float(np.array([n * d for n, d in zip(normal, direction, strict=True)]).sum()) for normal in normals]
        seen = cosines(normals, direction)
        assert seen[:6] == tuple(max(x, 0.0) for x in along[:6])
        one_by_one = [0.0, 0.0, 0.0]
        for weight, centre in zip(seen, centres, strict=True):
            one_by_one = [x + weight * c for x, c in zip(one_by_one, centre, strict=True)]
        assert total(seen, centres, normals) == tuple(one_by_one)


def test_drag_against_basilisk():
    need()
    from Basilisk.architecture import messaging
    from Basilisk.simulation import facetDragDynamicEffector

    for state in states(12):
        effector = facetDragDynamicEffector.FacetDragDynamicEffector()
        for area, nx, ny, nz, *centre in PLATES:
            effector.addFacet(area, AIR.coefficient, [nx, ny, nz], centre)
        air = messaging.AtmoPropsMsgPayload()
        height = np.linalg.norm(state.position) - EARTH
        air.neutralDensity = AIR.density * np.exp(-(height - AIR.height) / AIR.scale_height)
        density = messaging.AtmoPropsMsg().write(air)
        effector.atmoDensInMsg.subscribeTo(density)
        moving = messaging.WindMsgPayload()
        moving.v_air_N = np.cross((0.0, 0.0, AIR.rotation * drag.TURN), state.position).tolist()
        wind = messaging.WindMsg().write(moving)
        effector.windVelInMsg.subscribeTo(wind)
        expected = in_basilisk(effector, state)
        found = torque(drag, AIR, state)
        assert np.abs(found - expected).max() < 1e-8 * np.abs(expected).max(), (found, expected)


def test_sunlight_against_basilisk():
    need()
    from Basilisk.architecture import messaging
    from Basilisk.simulation import facetSRPDynamicEffector

    shaded = 0
    for step, state in enumerate(states(12)):
        seen = sun.sun(step * PERIOD, sun.prepared(EPOCH))
        effector = facetSRPDynamicEffector.FacetSRPDynamicEffector()
        effector.setNumFacets(len(SIDES))
        for area, nx, ny, nz, x, y, z, specular, diffuse in SIDES:
            effector.addFacet(area, np.eye(3).tolist(), [nx, ny, nz], [1.0, 0.0, 0.0], [x, y, z], diffuse, specular)
        place = messaging.SpicePlanetStateMsgPayload()
        # In the direction from the Earth's centre, which the craft's differs from by 0.003 deg.
        place.PositionVector = (np.array(state.position) + seen.distance * sun.UNIT * np.array(seen.direction)).tolist()
        sun_at = messaging.SpicePlanetStateMsg().write(place)
        effector.sunInMsg.subscribeTo(sun_at)
        shadow = messaging.EclipseMsgPayload()
        shadow.illuminationFactor = sun.in_view(state.position, seen)
        eclipse = messaging.EclipseMsg().write(shadow)
        effector.sunEclipseInMsg.subscribeTo(eclipse)
        shaded += shadow.illuminationFactor == 0.0
        expected = in_basilisk(effector, state)
        found = torque(solar_pressure, LIGHT, state, step)
        # Its solar constant is 1368 W/m2.
        assert np.abs(1368.0 / 1361.0 * found - expected).max() <= 1e-7 * np.abs(expected).max(), (found, expected)
        assert np.linalg.norm(found) < solar_pressure.bound(LIGHT, Envelope(1.0, 0.0, 0.0, 0.0)).torque
    assert 0 < shaded < 12
