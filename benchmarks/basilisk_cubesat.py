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

import ctypes
import os
import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
from Basilisk.architecture import messaging, sysModel
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

from common import as_law, as_quaternion, state_in_basilisk
from starhold.algebra.quaternion import multiply, relative, vector_part
from starhold.algebra.structure import flatten
from starhold.algebra.vector import Vector, add, apply, cross, scale
from starhold.export.code import make_code
from starhold.export.source import texts
from starhold.laws.catalogue import Law
from starhold.laws.interface import Measurement, NoMemory
from starhold.laws.pd import Gains
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts import magnetic_field, sun
from starhold.parts.bodies.rigid_body import State
from starhold.parts.craft import Craft, tensor, total_inertia
from starhold.parts.environments.drag import TURN
from starhold.parts.epoch import SIDEREAL, START, days_of
from starhold.parts.orbit import BODIES
from starhold.parts.part import Fitted

HEAVY = 1e9
"""The hub's mass (kg). starhold's drag and sunlight turn a craft and do not push it; they do not push this one either."""
SOLAR_CONSTANT = 1368.0
"""Basilisk's (W/m2), which cannot be set: plates in the Sun have areas that make up for it."""
LOST = 1e-300
"""The torque limit of a lost wheel (N m), for Basilisk takes zero for none."""
FROM_HILL = ((0.0, 1.0, 0.0), (0.0, 0.0, -1.0), (-1.0, 0.0, 0.0))
"""The axes of starhold's orbital frame in Hill's, whose first is away from the Earth and whose third is along the normal."""


def pointing(seen: Measurement, gains: Gains, craft: Craft, memory: NoMemory) -> tuple[Vector, NoMemory]:
    """u = -K sigma - P w + w_abs x (J w_abs + H) + J w_target': Basilisk's `mrpFeedback`, sigma = q/(1 + q0)."""
    q = seen.attitude
    feedback = add(scale(-gains.k_attitude / (1.0 + q[0]), vector_part(q)), scale(-gains.k_rate, seen.rate))
    momentum = add(apply(craft.inertia, seen.body_rate), seen.wheel_momentum)
    model = add(cross(seen.body_rate, momentum), apply(craft.inertia, seen.target_acceleration))
    return add(feedback, model), memory


POINTING = as_law("pointing", pointing)


def without(loop: ClosedLoop, *words: str) -> ClosedLoop:
    """A loop without the parts of these roles or names, also in what its events change it to."""

    def less(parts: tuple[Fitted, ...]) -> tuple[Fitted, ...]:
        return replace(loop, parts=parts).without(*words).parts

    return replace(loop, parts=less(loop.parts), events=tuple(e._replace(parts=less(e.parts)) for e in loop.events))


def under(loop: ClosedLoop, law: Law, gains: Any) -> ClosedLoop:
    """A loop under another law throughout."""
    return replace(loop, law=law, gains=gains, events=tuple(event._replace(gains=gains) for event in loop.events))


def with_numbers(loop: ClosedLoop, name: str, **numbers: Any) -> ClosedLoop:
    """A loop with other numbers of one of its parts throughout."""

    def changed(parts: tuple[Fitted, ...]) -> tuple[Fitted, ...]:
        return tuple(replace(f, params=f.params._replace(**numbers)) if f.part.name == name else f for f in parts)

    return replace(loop, parts=changed(loop.parts), events=tuple(e._replace(parts=changed(e.parts)) for e in loop.events))


def as_in_basilisk(loop: ClosedLoop) -> ClosedLoop:
    """A loop without what Basilisk has otherwise: its magnetometer draws other numbers, so there is no noise, and its torque
    bars are cut off at their limit each on its own."""
    return with_numbers(with_numbers(loop, "magnetometer", noise=0.0), "magnetic-unloading", limited=1)


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


class Errors(NamedTuple):
    """What sensors of starhold told wrong in a flight, control step by control step: rates (steps, 3; rad/s), turns from the
    true attitude (steps, 4), and whether an attitude was new (steps,)."""

    rate: Any
    attitude: Any
    new: Any


def errors_of(run: Any) -> Errors:
    """The errors of a recording of every control step."""
    turns = [relative(tuple(a), tuple(b)) for a, b in zip(run["attitude"], run["star_tracker_attitude"], strict=True)]
    return Errors(run["gyro_rate"] - run["rate"], np.array(turns), run["star_tracker_attitude_is_new"])


class FlightCode:
    """The C that starhold exports of a loop's law, compiled. errors: of its sensors; with none it has Basilisk's sensors."""

    def __init__(self, loop: ClosedLoop, errors: Errors | None = None) -> None:
        self.errors = errors
        code = make_code(loop, "flight")
        text = texts(code, "in Basilisk", "flight")
        with TemporaryDirectory() as folder:
            Path(folder, "flight.h").write_text(text.header, encoding="utf-8")
            Path(folder, "flight.c").write_text(text.source, encoding="utf-8")
            flags = ["-std=c99", "-O2", "-ffp-contract=off", "-shared", "-fPIC", "-o", f"{folder}/flight.so"]
            subprocess.run([os.environ.get("CC", "cc"), *flags, f"{folder}/flight.c", "-lm"], check=True)
            self.library = ctypes.CDLL(f"{folder}/flight.so")
        self.names = [member.name for member in code.members(2)]
        self.state = (ctypes.c_double * max(1, len(flatten(code.flight.start))))()
        self.library.flight_init(self.state)

    def __call__(self, told: dict[str, Any]) -> list[float]:
        """The torque asked for (N m, body axes)."""
        given = np.concatenate([np.ravel(told[name]) for name in self.names])
        command = (ctypes.c_double * 3)()
        self.library.flight_step(self.state, (ctypes.c_double * len(given))(*given), command)
        return list(command)


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
        return self.add(_Module(self, self.software)).command

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


class _Module(sysModel.SysModel):
    """Calls starhold's flight code with what sensors tell."""

    def __init__(self, of: _Builder, software: FlightCode) -> None:
        super().__init__()
        self.of, self.software = of, software
        self.command = messaging.CmdTorqueBodyMsg()
        self.last, self.step = np.array(of.loop.start.attitude), 0

    def Reset(self, CurrentSimNanos: int) -> None:  # noqa: N802 Basilisk calls it by this name
        pass

    def UpdateState(self, CurrentSimNanos: int) -> None:  # noqa: N802
        reached = self.of.body.scStateOutMsg.read()
        rate = np.array(reached.omega_BN_B)
        attitude, measured, new = self.measured(np.array(as_quaternion(reached.sigma_BN)), rate)
        # Rodrigues parameters do not tell which of the two quaternions they are.
        self.last = attitude if attitude @ self.last >= 0.0 else -attitude
        speeds = self.of.effector.rwSpeedOutMsg.read().wheelSpeeds
        momenta = [w.Js * (speed + np.ravel(w.gsHat_B) @ rate) for w, speed in zip(self.of.wheels, speeds, strict=False)]
        told = {"attitude": self.last, "rate": measured, "position": reached.r_BN_N, "velocity": reached.v_BN_N}
        payload = messaging.CmdTorqueBodyMsgPayload()
        payload.torqueRequestBody = self.software(told | {"attitude_is_new": new, "wheels": momenta})
        self.command.write(payload, CurrentSimNanos, self.moduleID)
        self.step += 1

    def measured(self, attitude: Any, rate: Any) -> tuple[Any, Any, float]:
        """Attitude and rate as they are measured, and whether the attitude is a new one."""
        errors, k = self.software.errors, self.step
        if errors is not None:
            turned = multiply(tuple(attitude.tolist()), tuple(errors.attitude[k].tolist()))
            return np.array(turned), rate + errors.rate[k], errors.new[k]
        every = max(1, round(self.of.params("star-tracker").interval / self.of.loop.period))
        # Before its second update the sensor shows nothing.
        shown = self.of.imu.sensorOutMsg.read().AngVelPlatform if k else rate
        return np.array(self.of.tracker.sensorOutMsg.read().qInrtl2Case), shown, float(k % every == 0)
