"""What commands a craft in Basilisk: the C that starhold exports of a loop, or a law equal to Basilisk's own feedback.

And the loops that are flown for the comparison."""

from __future__ import annotations

import ctypes
import os
import subprocess
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
from Basilisk.architecture import messaging, sysModel

from common import as_law, as_quaternion
from starhold.algebra.quaternion import multiply, relative, vector_part
from starhold.algebra.structure import flatten
from starhold.algebra.vector import Vector, add, apply, cross, scale
from starhold.export.code import make_code
from starhold.export.source import texts
from starhold.laws.catalogue import Law
from starhold.laws.interface import Measurement, NoMemory
from starhold.laws.pd import Gains
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.craft import Craft
from starhold.parts.part import Fitted


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
        self.names = [member.name for member in code.inputs]
        self.state = (ctypes.c_double * max(1, len(flatten(code.flight.start))))()
        self.library.flight_init(self.state)

    def __call__(self, told: dict[str, Any]) -> list[float]:
        """The torque asked for (N m, body axes)."""
        given = np.concatenate([np.ravel(told[name]) for name in self.names])
        command = (ctypes.c_double * 3)()
        self.library.flight_step(self.state, (ctypes.c_double * len(given))(*given), command)
        return list(command)


class FlightModule(sysModel.SysModel):
    """Calls starhold's flight code with what sensors tell; of: what builds the craft, with its body, wheels and sensors."""

    def __init__(self, of: Any, software: FlightCode) -> None:
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
