"""A spacecraft with wheels on its orbit, with all that disturbs it, as Basilisk flies it with compiled modules of its own.

`in_basilisk` reads a closed loop of starhold and sets up for each of its parts the model that Basilisk has of the same:

* wheels: balanced reaction wheels, and `rwMotorTorque` to share a torque out; a lost motor is one that hardly gives any;
* oblateness: spherical harmonics of degree 2; gravity gradient: the effector of that name;
* residual dipole: torque bars that are always on, in the field of the World Magnetic Model's module, which is given
  starhold's coefficients as its file, for Basilisk's package brings none;
* drag: facets, exponential atmosphere, air that turns with the Earth; solar pressure: facets and `eclipse`, with
  `planetEphemeris` for the Sun and the turn of the Earth;
* magnetic unloading: torque bars and four modules of flight software; magnetometer, gyro, star tracker: its own sensors.

Of the multiplicative Kalman filter Basilisk has nothing. `software` says what flies: gains of Basilisk's own feedback on the
true state, or `FlightCode`, the C that starhold exports of a loop, filter and target included, called by a module in Python.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
from Basilisk.architecture import messaging
from Basilisk.fswAlgorithms import (
    attTrackingError,
    dipoleMapping,
    hillPoint,
    mrpFeedback,
    mtbMomentumManagementSimple,
    rwMotorTorque,
    tamComm,
    torque2Dipole,
)
from Basilisk.simulation import (
    GravityGradientEffector,
    MtbEffector,
    eclipse,
    exponentialAtmosphere,
    facetDragDynamicEffector,
    facetSRPDynamicEffector,
    imuSensor,
    magneticFieldWMM,
    magnetometer,
    planetEphemeris,
    reactionWheelStateEffector,
    simpleNav,
    spacecraft,
    sphericalHarmonicsGravityModel,
    starTracker,
    zeroWindModel,
)
from Basilisk.utilities import (
    RigidBodyKinematics,
    SimulationBaseClass,
    orbitalMotion,
    simIncludeGravBody,
    simIncludeRW,
)

from basilisk_software import FlightCode, FlightModule
from common import state_in_basilisk
from starhold.laws.pd import Gains
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts import magnetic_field, sun
from starhold.parts.bodies.rigid_body import State
from starhold.parts.craft import tensor, total_inertia
from starhold.parts.environments.drag import TURN
from starhold.parts.epoch import SIDEREAL, START, days_of
from starhold.parts.orbit import BODIES

HEAVY = 1e9
"""The hub's mass (kg). starhold's drag and sunlight turn a craft and do not push it; they do not push this one either."""
SOLAR_CONSTANT = 1368.0
"""Basilisk's (W/m2), which cannot be set: plates in the Sun have areas that make up for it."""
LOST = 1e-300
"""The torque limit of a lost wheel (N m), for Basilisk takes zero for none."""
FROM_HILL = ((0.0, 1.0, 0.0), (0.0, 0.0, -1.0), (-1.0, 0.0, 0.0))
"""The axes of starhold's orbital frame in Hill's, whose first is away from the Earth and whose third is along the normal."""


class Vehicle(NamedTuple):
    """A spacecraft in Basilisk. fly(steps) flies so many control steps more; Basilisk holds `kept` by bare pointers."""

    fly: Callable[[int], None]
    body: Any
    wheels: list[Any]
    kept: list[Any]

    def state(self) -> State:
        """Where it is now."""
        return state_in_basilisk(self.body)

    def momenta(self) -> Any:
        """The absolute momenta of its rotors about their axes (N m s)."""
        rate = np.array(self.state().rate)
        return np.array([w.Js * (w.Omega + float(np.ravel(w.gsHat_B) @ rate)) for w in self.wheels])


def epoch_of(loop: ClosedLoop) -> Any:
    """When the loop's flight begins: as the first part says that needs to know."""
    return next((f.params.epoch for f in loop.parts if hasattr(f.params, "epoch")), START)


def in_basilisk(loop: ClosedLoop, software: FlightCode | Gains) -> Vehicle:
    """The craft of a loop with the models of its parts. software: what commands it, or gains of Basilisk's own feedback."""
    return _Builder(loop, software).vehicle()


class _Builder:
    def __init__(self, loop: ClosedLoop, software: FlightCode | Gains) -> None:
        self.loop, self.software = loop, software
        self.tick = round(loop.period * 1e9)
        self.simulation = SimulationBaseClass.SimBaseClass()
        process = self.simulation.CreateNewProcess("process")
        process.addTask(self.simulation.CreateNewTask("task", self.tick))
        self.body = spacecraft.Spacecraft()
        self.kept: list[Any] = []
        self.wheels: list[Any] = []

    def add(self, model: Any) -> Any:
        """Run a model each control step, after those before it."""
        model.ModelTag = f"model {len(self.kept)}"
        self.simulation.AddModelToTask("task", model)
        self.kept.append(model)
        return model

    def params(self, name: str) -> Any:
        """The numbers of a part, or None."""
        found = self.loop.find(name)
        return None if found is None else found.params

    def vehicle(self) -> Vehicle:
        self.hub()
        self.planets()
        with TemporaryDirectory() as folder:
            self.environment(folder)
            gains = self.software if isinstance(self.software, Gains) else None
            torque = self.own_software(gains) if gains is not None else self.exported_software()
            drives, available = self.wheel_drives(torque)
            self.unloading()
            self.simulation.InitializeSimulation()
        done = 0

        def stop_at(step: int) -> None:
            self.simulation.ConfigureStopTime(step * self.tick)
            self.simulation.ExecuteSimulation()

        def fly(steps: int) -> None:
            nonlocal done
            first, done = done, done + steps
            for phase in self.loop.phases(done + 1):
                if phase.last > first:
                    # What changes at a control step has to be changed before Basilisk gets there.
                    stop_at(max(phase.first - 1, 0))
                    self.enter(phase.setup, available)
                    stop_at(min(phase.last - 1, done))

        self.kept += [drives, available]
        return Vehicle(fly, self.body, self.wheels, self.kept)

    def hub(self) -> None:
        body, start = self.body, self.loop.start
        body.hub.mHub = HEAVY
        body.hub.IHubPntBc_B = tensor(total_inertia(self.loop.craft)).tolist()
        body.hub.r_CN_NInit, body.hub.v_CN_NInit = list(start.position), list(start.velocity)
        sign = 1.0 if start.attitude[0] >= 0.0 else -1.0
        body.hub.sigma_BNInit = [[x / (sign + start.attitude[0])] for x in start.attitude[1:]]
        body.hub.omega_BN_BInit = [[x] for x in start.rate]
        self.add(body)
        factory = simIncludeGravBody.gravBodyFactory()
        earth = factory.createEarth()
        earth.mu, earth.isCentralBody = self.loop.craft.gravity, True
        flattening = self.params("oblateness")
        if flattening is not None:
            earth.radEquator = flattening.radius
            field = sphericalHarmonicsGravityModel.SphericalHarmonicsGravityModel()
            field.maxDeg = 2
            field.cBar, field.sBar = (
                [[1.0], [0.0, 0.0], [-flattening.j2 / 5.0**0.5, 0.0, 0.0]],
                [[0.0], [0.0] * 2, [0.0] * 3],
            )
            earth.gravityModel = field
            self.kept.append(field)
        factory.addBodiesTo(body)
        self.kept += [factory, earth]
        if self.loop.has("gravity-gradient"):
            gradient = self.add(GravityGradientEffector.GravityGradientEffector())
            gradient.addPlanetName(earth.planetName)
            body.addDynamicEffector(gradient)

    def planets(self) -> None:
        """The Earth at the origin, turning, and the Sun on the ellipse that it seems to follow."""
        epoch = epoch_of(self.loop)
        numbers = sun.prepared(epoch)
        day = 86400.0
        before, now, after = (
            seen.distance * sun.UNIT * np.array(seen.direction) for seen in (sun.sun(t, numbers) for t in (-day, 0.0, day))
        )
        around_sun = orbitalMotion.rv2elem(orbitalMotion.MU_SUN * 1e9, -now, (before - after) / (2.0 * day))
        around_earth = planetEphemeris.ClassicElements()
        elements = planetEphemeris.ClassicElements()
        for name in ("a", "e", "i", "Omega", "omega", "f"):
            setattr(elements, name, float(getattr(around_sun, name)))
            setattr(around_earth, name, 0.0)
        # The Sun is at the centre, but for a metre: Basilisk's planets are on ellipses.
        around_earth.a = 1.0
        ephemeris = planetEphemeris.PlanetEphemeris()
        ephemeris.setPlanetNames(planetEphemeris.StringVector(["earth", "sun"]))
        ephemeris.planetElements = planetEphemeris.classicElementVector([elements, around_earth])
        ephemeris.zeroBase = "earth"
        greenwich = 2.0 * np.pi * magnetic_field.prepared(epoch).turn
        for name, of_earth in (
            ("lst0", greenwich),
            ("rotRate", 2.0 * np.pi * SIDEREAL / day),
            ("declination", np.pi / 2.0),
            ("rightAscension", 0.0),
        ):
            setattr(ephemeris, name, planetEphemeris.DoubleVector([of_earth, 0.0 if name != "declination" else np.pi / 2.0]))
        self.add(ephemeris)
        self.earth_at, self.sun_at = ephemeris.planetOutMsgs

    def environment(self, folder: str) -> None:
        loop = self.loop
        field = self.field_model(folder)
        self.field_at = field.envOutMsgs[0]
        dipole = self.params("residual-dipole")
        if dipole is not None:
            always = messaging.MTBCmdMsgPayload()
            always.mtbDipoleCmds = list(dipole.dipole)
            command = messaging.MTBCmdMsg().write(always)
            self.kept.append(command)
            self.bars([abs(x) for x in dipole.dipole], command)
        air = self.params("drag")
        if air is not None:
            atmosphere = exponentialAtmosphere.ExponentialAtmosphere()
            atmosphere.planetRadius = BODIES["Earth"].radius
            atmosphere.scaleHeight = air.scale_height
            atmosphere.baseDensity = air.density * np.exp(air.height / air.scale_height)
            atmosphere.addSpacecraftToModel(self.body.scStateOutMsg)
            self.add(atmosphere)
            wind = zeroWindModel.ZeroWindModel()
            wind.planetPosInMsg.subscribeTo(self.earth_at)
            wind.setPlanetOmega_N([0.0, 0.0, air.rotation * TURN])
            wind.addSpacecraftToModel(self.body.scStateOutMsg)
            self.add(wind)
            drag = facetDragDynamicEffector.FacetDragDynamicEffector()
            for area, x, y, z, *centre in air.plates:
                drag.addFacet(area, air.coefficient, _unit((x, y, z)), centre)
            drag.atmoDensInMsg.subscribeTo(atmosphere.envOutMsgs[0])
            drag.windVelInMsg.subscribeTo(wind.envOutMsgs[0])
            self.body.addDynamicEffector(drag)
            self.add(drag)
        light = self.params("solar-pressure")
        if light is not None:
            shadow = eclipse.Eclipse()
            shadow.sunInMsg.subscribeTo(self.sun_at)
            shadow.addPlanetToModel(self.earth_at)
            shadow.addSpacecraftToModel(self.body.scStateOutMsg)
            self.add(shadow)
            plates = facetSRPDynamicEffector.FacetSRPDynamicEffector()
            plates.setNumFacets(len(light.plates))
            share = sun.PRESSURE * 299792458.0 / SOLAR_CONSTANT
            for area, x, y, z, cx, cy, cz, specular, diffuse in light.plates:
                still, axis = np.eye(3).tolist(), [1.0, 0.0, 0.0]
                plates.addFacet(share * area, still, _unit((x, y, z)), axis, [cx, cy, cz], diffuse, specular)
            plates.sunInMsg.subscribeTo(self.sun_at)
            plates.sunEclipseInMsg.subscribeTo(shadow.eclipseOutMsgs[0])
            self.body.addDynamicEffector(plates)
            self.add(plates)
        if loop.used("sensor"):
            self.sensors()

    def field_model(self, folder: str) -> Any:
        """The model of the Earth's field, with starhold's coefficients."""
        file = Path(folder, "field.COF")
        rows = [f"{n} {m} {g} {h} {dg} {dh}" for n, m, g, h, dg, dh in magnetic_field.ROWS]
        file.write_text("\n".join(["2025.0 IGRF-14 11/19/2024", *rows, "9" * 48, ""]), encoding="utf-8")
        epoch = epoch_of(self.loop)
        field = magneticFieldWMM.MagneticFieldWMM()
        field.configureWMMFile(str(file))
        first, last = magnetic_field.FIRST, magnetic_field.LAST
        field.epochDateFractionalYear = 2025.0 + 5.0 * (days_of(epoch) - first) / (last - first)
        field.planetPosInMsg.subscribeTo(self.earth_at)
        field.addSpacecraftToModel(self.body.scStateOutMsg)
        return self.add(field)

    def bars(self, limits: Any, command: Any) -> Any:
        """Three torque bars along the axes, and what tells of them."""
        told = messaging.MTBArrayConfigMsgPayload()
        told.numMTB = 3
        told.GtMatrix_B = np.eye(3).ravel().tolist()
        told.maxMtbDipoles = list(limits)
        known = messaging.MTBArrayConfigMsg().write(told)
        bars = MtbEffector.MtbEffector()
        bars.mtbParamsInMsg.subscribeTo(known)
        bars.magInMsg.subscribeTo(self.field_at)
        if command is not None:
            bars.mtbCmdInMsg.subscribeTo(command)
        self.body.addDynamicEffector(bars)
        self.kept.append(known)
        return self.add(bars), known

    def sensors(self) -> None:
        """Basilisk's own, as good as the loop's. Its gyro has no bias that walks, and its tracker no interval."""
        gyro, tracker, field = (self.params(name) for name in ("gyro", "star-tracker", "magnetometer"))
        if gyro is not None:
            self.imu = imuSensor.ImuSensor()
            deviation = gyro.noise / self.loop.period**0.5
            self.imu.PMatrixGyro, self.imu.AMatrixGyro = np.diag([deviation] * 3).tolist(), np.zeros((3, 3)).tolist()
            self.imu.setWalkBoundsGyro(np.zeros(3))
            self.imu.senRotBias = list(gyro.bias)
            self.imu.scStateInMsg.subscribeTo(self.body.scStateOutMsg)
            self.add(self.imu)
        if tracker is not None:
            self.tracker = starTracker.StarTracker()
            axis = np.array(_unit(tracker.boresight))
            spread = tracker.cross * np.eye(3) + (tracker.roll - tracker.cross) * np.outer(axis, axis)
            self.tracker.PMatrix = spread.tolist()
            self.tracker.setAMatrix(np.zeros((3, 3)))
            self.tracker.setWalkBounds(np.zeros(3))
            self.tracker.scStateInMsg.subscribeTo(self.body.scStateOutMsg)
            self.add(self.tracker)
        if field is not None:
            self.magnetometer = magnetometer.Magnetometer()
            self.magnetometer.stateInMsg.subscribeTo(self.body.scStateOutMsg)
            self.magnetometer.magInMsg.subscribeTo(self.field_at)
            self.magnetometer.senNoiseStd = [field.noise] * 3
            self.magnetometer.senBias = list(field.bias)
            self.magnetometer.scaleFactor = 1.0 + field.scale_error
            self.add(self.magnetometer)

    def own_software(self, gains: Gains) -> Any:
        """Basilisk's own flight software, which sees the true state."""
        craft = self.loop.craft
        sensor = simpleNav.SimpleNav()
        sensor.scStateInMsg.subscribeTo(self.body.scStateOutMsg)
        goal = hillPoint.hillPoint()
        goal.transNavInMsg.subscribeTo(sensor.transOutMsg)
        error = attTrackingError.attTrackingError()
        error.attNavInMsg.subscribeTo(sensor.attOutMsg)
        error.attRefInMsg.subscribeTo(goal.attRefOutMsg)
        error.sigma_R0R = (-RigidBodyKinematics.C2MRP(np.array(FROM_HILL))).tolist()
        law = mrpFeedback.mrpFeedback()
        law.guidInMsg.subscribeTo(error.attGuidOutMsg)
        law.K, law.P, law.Ki, law.controlLawType = gains.k_attitude, gains.k_rate, -1.0, 1
        known = messaging.VehicleConfigMsgPayload()
        known.ISCPntB_B = tensor(craft.inertia).ravel().tolist()
        told = messaging.VehicleConfigMsg().write(known)
        law.vehConfigInMsg.subscribeTo(told)
        self.kept.append(told)
        self.law = law
        for model in (sensor, goal, error, law):
            self.add(model)
        return law.cmdTorqueOutMsg

    def exported_software(self) -> Any:
        """starhold's flight code, in a module in Python."""
        assert isinstance(self.software, FlightCode)
        return self.add(FlightModule(self, self.software)).command

    def wheel_drives(self, torque: Any) -> Any:
        """The wheels and what shares a torque out among them."""
        factory = simIncludeRW.rwFactory()
        found, momenta, rate = self.loop.wheels, self.loop.rotors, np.array(self.loop.start.rate)
        assert found is not None
        for axis, inertia, limit, most, momentum in zip(
            found.axes, found.inertia, found.torque_limit, found.momentum_limit, momenta, strict=True
        ):
            wheel = factory.create("custom", list(axis), Js=inertia, u_max=limit, RWModel=messaging.BalancedWheels)
            wheel.Omega = momentum / inertia - float(np.array(axis) @ rate)
            wheel.Omega_max = most / inertia
            self.wheels.append(wheel)
        effector = reactionWheelStateEffector.ReactionWheelStateEffector()
        factory.addToSpacecraft("wheels", effector, self.body)
        known = factory.getConfigMessage()
        available = messaging.RWAvailabilityMsg().write(messaging.RWAvailabilityMsgPayload())
        shared = rwMotorTorque.rwMotorTorque()
        shared.controlAxes_B = np.eye(3).ravel().tolist()
        shared.vehControlInMsg.subscribeTo(torque)
        shared.rwParamsInMsg.subscribeTo(known)
        shared.rwAvailInMsg.subscribeTo(available)
        self.add(shared)
        effector.rwMotorCmdInMsg.subscribeTo(shared.rwMotorTorqueOutMsg)
        self.add(effector)
        if isinstance(self.software, Gains):
            self.law.rwParamsInMsg.subscribeTo(known)
            self.law.rwSpeedsInMsg.subscribeTo(effector.rwSpeedOutMsg)
        self.effector, self.known = effector, known
        self.kept += [factory, known]
        return shared, available

    def enter(self, setup: Any, available: Any) -> None:
        """Set what a phase of the flight has changed: motors that fail, and wheels that are not counted on any more."""
        wheels = next(p for p in setup.effectors if hasattr(p, "least"))
        for wheel, limit in zip(self.wheels, wheels.torque_limit, strict=True):
            wheel.u_max = limit or LOST
        payload = messaging.RWAvailabilityMsgPayload()
        states = [messaging.AVAILABLE if any(row) else messaging.UNAVAILABLE for row in wheels.least]
        payload.wheelAvailability = states
        available.write(payload)

    def unloading(self) -> None:
        """Torque bars that take momentum out of the wheels, by three modules of Basilisk's flight software."""
        params = self.params("magnetic-unloading")
        if params is None:
            return
        wanted = mtbMomentumManagementSimple.mtbMomentumManagementSimple()
        wanted.Kp = params.gain
        wanted.rwParamsInMsg.subscribeTo(self.known)
        wanted.rwSpeedsInMsg.subscribeTo(self.effector.rwSpeedOutMsg)
        told = tamComm.tamComm()
        told.dcm_BS = np.eye(3).ravel().tolist()
        told.tamInMsg.subscribeTo(self.magnetometer.tamDataOutMsg)
        dipole = torque2Dipole.torque2Dipole()
        dipole.tauRequestInMsg.subscribeTo(wanted.tauMtbRequestOutMsg)
        dipole.tamSensorBodyInMsg.subscribeTo(told.tamOutMsg)
        mapped = dipoleMapping.dipoleMapping()
        mapped.dipoleRequestBodyInMsg.subscribeTo(dipole.dipoleRequestOutMsg)
        mapped.steeringMatrix = np.eye(3).ravel().tolist()
        for model in (wanted, told, dipole, mapped):
            self.add(model)
        _, known = self.bars(params.dipole_limit, mapped.dipoleRequestMtbOutMsg)
        mapped.mtbArrayConfigParamsInMsg.subscribeTo(known)


def _unit(v: Any) -> list[float]:
    return (np.array(v) / np.linalg.norm(v)).tolist()
