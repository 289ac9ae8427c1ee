"""A law as a module of Basilisk: a class in Python over the compiled C."""

from __future__ import annotations

from starhold.errors import InputError
from starhold.export.code import Code
from starhold.export.law import numbers

SOURCES = {
    "attitude": ("attitude", "self._quaternion(read.sigma_BN)"),
    "rate": ("attitude", "read.omega_BN_B"),
    "position": ("translation", "read.r_BN_N"),
    "velocity": ("translation", "read.v_BN_N"),
}
"""Inputs of laws: the message that tells of them, and what they are in it."""


def files(code: Code) -> dict[str, str]:
    """Return the module. InputError for inputs that no message of Basilisk tells of."""
    wanted = [member.name for member in code.members(2)]
    for name in wanted:
        if name not in SOURCES:
            raise InputError(
                "export basilisk", "", f"the input {name}", f"inputs that messages tell of: {', '.join(SOURCES)}"
            )
    reads: list[str] = []
    for message in ("attitude", "translation"):
        own = [name for name in wanted if SOURCES[name][0] == message]
        if own:
            reads.append(f"        read = self.{message}InMsg()")
            reads += [f"        {name} = {SOURCES[name][1]}" for name in own]
    given = ", ".join(f"*{name}" for name in wanted)
    sizes = {member.name: len(member.type.members) for member in code.members(2)}
    parts = {
        "NAME": code.name,
        "CLASS": "".join(word.capitalize() for word in code.name.split("_")),
        "READS": "\n".join(reads),
        "GIVEN": given,
        "INPUTS": str(sum(sizes.values())),
        "STATE": str(max(1, len(numbers(code.flight.start)))),
        "PERIOD": repr(code.flight.loop.period),
        "SUMMARY": code.flight.loop.law.card.title,
    }
    text = _MODULE
    for key, value in parts.items():
        text = text.replace(f"@{key}@", value)
    return {f"{code.name}_basilisk.py": text}


_MODULE = '''\
"""@SUMMARY@ as a module of Basilisk, over the same C that flies.

    controller = @CLASS@()
    controller.attitudeInMsg.subscribeTo(navigation.attOutMsg)
    actuator.cmdTorqueInMsg.subscribeTo(controller.cmdTorqueOutMsg)
    simulation.AddModelToTask("task", controller)    # a task of @PERIOD@ s

The library is compiled beside this file when the module is first imported, by CC or `cc`.
"""

import ctypes
import os
import subprocess
from pathlib import Path

from Basilisk.architecture import messaging, sysModel

PERIOD = @PERIOD@
"""Seconds between two updates."""
HERE = Path(__file__).resolve().parent


def _library():
    built = HERE / "@NAME@.so"
    source = HERE / "@NAME@.c"
    if not built.exists() or built.stat().st_mtime < source.stat().st_mtime:
        flags = ["-std=c99", "-O2", "-ffp-contract=off", "-shared", "-fPIC"]
        subprocess.run([os.environ.get("CC", "cc"), *flags, "-o", str(built), str(source), "-lm"], check=True)
    return ctypes.CDLL(str(built))


class @CLASS@(sysModel.SysModel):
    """Reads navigation messages and writes the torque on the body (N m, body axes), once each update.

    A message tells of an attitude by Rodrigues parameters, which do not say which of the two quaternions it is: the one is
    taken that is nearer to the last, and at the start the one with the sign of `first_sign` in its scalar part.
    """

    def __init__(self, first_sign=1.0):
        super().__init__()
        self.ModelTag = "@NAME@"
        self.attitudeInMsg = messaging.NavAttMsgReader()
        self.translationInMsg = messaging.NavTransMsgReader()
        self.cmdTorqueOutMsg = messaging.CmdTorqueBodyMsg()
        self._first_sign = first_sign
        self._library = _library()
        self._state = (ctypes.c_double * @STATE@)()
        self._last = None

    def Reset(self, CurrentSimNanos):
        """Begin anew."""
        self._library.@NAME@_init(self._state)
        self._last = None

    def UpdateState(self, CurrentSimNanos):
        """Make one control step."""
@READS@
        command = (ctypes.c_double * 3)()
        self._library.@NAME@_step(self._state, (ctypes.c_double * @INPUTS@)(@GIVEN@), command)
        payload = messaging.CmdTorqueBodyMsgPayload()
        payload.torqueRequestBody = list(command)
        self.cmdTorqueOutMsg.write(payload, CurrentSimNanos, self.moduleID)

    def _quaternion(self, sigma):
        square = sum(s * s for s in sigma)
        q = [(1.0 - square) / (1.0 + square), *(2.0 * s / (1.0 + square) for s in sigma)]
        last = self._last or [self._first_sign, 0.0, 0.0, 0.0]
        if sum(a * b for a, b in zip(q, last)) < 0.0:
            q = [-x for x in q]
        self._last = q
        return q
'''
