"""Shells over the same C: a module of Basilisk flies the same loop there, an FMU gives the same commands."""

import importlib.util
import io
import math
import re
import zipfile

import numpy as np
import pytest

from starhold.errors import InputError
from starhold.export.code import make_code
from starhold.export.shells import shell_files
from starhold.export.vectors import vectors
from starhold.laws.catalogue import catalogue
from starhold.simulation.lane import fly
from tests.export.flown import code_of, need, put
from tests.tiers import leading

ATTITUDE = 1e-7
"""Largest difference (rad) over an orbit: Basilisk integrates Rodrigues parameters, starhold quaternions."""
ORBIT = 2.0 * math.pi * math.sqrt(7e6**3 / 3.986e14)


@pytest.mark.parametrize("steps", [3000, pytest.param(round(ORBIT / 0.1), marks=pytest.mark.slow)])
def test_basilisk_flies_the_same_loop(steps, tmp_path):
    need("cc")
    pytest.importorskip("Basilisk", reason="Basilisk comes with the test extra where it has a wheel")
    from benchmarks import common

    law = catalogue()["lyapunov"]
    loop = common.problem(law, law.examples()[0], common.START, torque_limit=0.01, limit="axis")
    code = make_code(loop, "lyapunov")
    put(tmp_path, code, "basilisk")
    spec = importlib.util.spec_from_file_location("lyapunov_basilisk", tmp_path / "lyapunov_basilisk.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)

    from Basilisk.simulation import simpleNav

    simulation, body, actuator, kept = common.body_in_basilisk(common.START)
    # The actuator's model runs first, on the torque that is held; the law's model after it.
    sensors, controller = simpleNav.SimpleNav(), module.Lyapunov()
    sensors.scStateInMsg.subscribeTo(body.scStateOutMsg)
    controller.attitudeInMsg.subscribeTo(sensors.attOutMsg)
    controller.translationInMsg.subscribeTo(sensors.transOutMsg)
    actuator.cmdTorqueInMsg.subscribeTo(controller.cmdTorqueOutMsg)
    for model in (sensors, controller, actuator):
        simulation.AddModelToTask("task", model)
    simulation.InitializeSimulation()
    simulation.ConfigureStopTime(steps * round(loop.period * 1e9))
    simulation.ExecuteSimulation()
    angle, rate, _ = common.gap(fly(loop, steps, steps)[1].state, common.state_in_basilisk(body))
    assert angle < ATTITUDE
    assert rate < ATTITUDE
    # It turned: what is compared is not the start.
    assert common.gap(loop.start, common.state_in_basilisk(body))[0] > 0.1
    assert kept


def test_basilisk_refuses_what_no_message_tells_of():
    with pytest.raises(InputError, match="the input wheels"):
        shell_files(code_of("wheel"), ["basilisk"])
    with pytest.raises(InputError, match=r"shell: found simulink; allowed: one of basilisk, fmu, cfs, fprime"):
        shell_files(code_of("lyapunov"), ["simulink"])


@pytest.mark.slow
@pytest.mark.parametrize("name", leading(["wheel", "lyapunov"]))
def test_fmu_gives_the_same_bits(name, tmp_path):
    need("cmake", "cc")
    fmpy = pytest.importorskip("fmpy", reason="fmpy comes with the export extra")
    from fmpy.build import build_platform_binary
    from fmpy.fmi3 import FMU3Slave
    from fmpy.validation import validate_fmu

    code = code_of(name)
    put(tmp_path, code, "fmu")
    archive = tmp_path / f"{name}.fmu"
    assert archive.read_bytes() == shell_files(code, ["fmu"])[archive.name]
    assert not validate_fmu(str(archive))
    unzipped = fmpy.extract(str(archive), str(tmp_path / "fmu"))
    (tmp_path / "build").mkdir()
    build_platform_binary(unzipped, tmp_path / "build")
    description = fmpy.read_model_description(unzipped)
    told = {v.name: v.valueReference for v in description.modelVariables}
    ins = [v.valueReference for v in description.modelVariables if v.causality == "input"]
    outs = [told[f"torque.{axis}"] for axis in "xyz"]
    own = FMU3Slave(
        guid=description.guid,
        unzipDirectory=unzipped,
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="law",
    )
    own.instantiate()
    period = code.flight.loop.period
    assert float(description.coSimulation.fixedInternalStepSize) == period
    cases, begun = vectors(code)[:64], 0
    for k, case in enumerate(cases):
        if case.first:
            if k:
                own.reset()
            own.enterInitializationMode(startTime=0.0)
            own.exitInitializationMode()
            begun = k
        own.setFloat64(ins, case.inputs)
        own.doStep((k - begun) * period, period)
        found = np.array(own.getFloat64(outs))
        assert np.array_equal(found, case.command, equal_nan=True)
    own.terminate()
    own.freeInstance()


def test_shells_of_a_law_that_reads_the_time():
    code = code_of("every function, the time")
    header, source = (shell_files(code, ["process"])[name] for name in ("starhold_link.h", f"{code.name}_process.c"))
    place = re.search(r"STARHOLD_AT_MEASUREMENT_TIME = (\d+)", header)[1]
    assert re.search(rf"places\[\d+\] = \{{[^}}]*\b{place}\b", source)
    with zipfile.ZipFile(io.BytesIO(shell_files(code, ["fmu"])[f"{code.name}.fmu"])) as archive:
        names = re.findall(r'<Float64 name="([^"]+)"', archive.read("modelDescription.xml").decode())
    assert len(names) == len(set(names))
    assert {"time", "time_since_start"} < set(names)
    with pytest.raises(InputError, match="found the input time; allowed: inputs that messages contain"):
        shell_files(code, ["basilisk"])
