"""The commands `serve`, `run --law-process`, `export c --shell process` and `export link`."""

import re
import signal
import socket
import subprocess
import sys

import numpy as np
import pytest
import xarray as xr

import starhold as sh
from starhold.link.protocol import Kind
from tests.export.flown import STRICT, build_in, need
from tests.link.clients import PATIENCE, Client
from tests.running import starhold


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--port", "70000"], "serve: --port: found 70000; allowed: 0 to 65535"),
        (["--missing", "guess"], "serve: --missing: found guess; allowed: one of hold, zero, stop"),
        (["--rate", "0"], "serve: --rate: found 0; allowed: a finite number above 0"),
        (["--rate", "nan"], "serve: --rate: found nan; allowed"),
        (["--rate", "inf"], "serve: --rate: found inf; allowed"),
        (["--law", "none"], "none"),
        (["--host", "192.0.2.1"], "serve: --host, --port: found 192.0.2.1:5750"),
        (["--host", "no such host"], "serve: --host, --port: found no such host:5750"),
        (["--udp", "--zmq"], "serve: --zmq: found --udp too; allowed: one of the two"),
        (["--zmq", "--host", "no such host"], "serve: --host, --port: found no such host:5750"),
        (["--serial", "/nowhere"], "serve: --serial, --baud: found /nowhere at 115200 baud, No such file"),
        (["--serial", "/dev/null"], "serve: --serial, --baud: found /dev/null at 115200 baud, "),
        (["--serial", "/dev/null", "--baud", "-1"], "serve: --serial, --baud: found /dev/null at -1 baud, "),
    ],
)
def test_a_wrong_argument_is_one_line(words, message, tmp_path):
    done = starhold("serve", "three-laws", "-o", "out", *words, cwd=tmp_path, code=2)
    assert not (tmp_path / "out").exists()
    assert message in done.stderr
    assert done.stderr.count("\n") == 1


def test_a_port_in_use_and_a_time_without_seconds(tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        done = starhold("serve", "three-laws", "--port", str(port), cwd=tmp_path, code=2)
    assert f"found 127.0.0.1:{port}" in done.stderr
    done = starhold("serve", "l2-circle", "--rate", "1", cwd=tmp_path, code=2)
    assert "a scenario whose time is in 1/Omega" in done.stderr


@pytest.mark.parametrize(("option", "package"), [({"zmq": True}, "zmq"), ({"serial": "/dev/null"}, "serial")])
def test_an_extra_that_is_missing_is_named(option, package, monkeypatch):
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(sh.InputError, match=rf"^serve --{package}: need {package}: pip install 'starhold\[{package}\]'$"):
        sh.serve("three-laws", **option)


def test_results_that_are_there_are_kept(tmp_path):
    (tmp_path / "run.nc").touch()
    done = starhold("serve", "three-laws", "--port", "0", "-o", ".", cwd=tmp_path, code=2)
    assert "results already there (run.nc)" in done.stderr


def test_interrupted_tells_where_and_keeps_the_recording(tmp_path):
    command = [sys.executable, "-m", "starhold", "serve", "three-laws", "--port", "0", "-o", "kept"]
    with subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            said = process.stdout.readline()
            address = re.fullmatch(r"Listening on (tcp://127\.0\.0\.1:\d+)\. Ctrl-C ends it\.\n", said)[1]
            client = Client(address)
            client.greet()
            for step in range(5):
                client.send(Kind.COMMAND, step, (1e-3, 0.0, 0.0))
                client.until(Kind.READINGS)
            process.send_signal(signal.SIGINT)
            assert client.until(Kind.STOP).text == "interrupted"
            client.close()
            out, err = process.communicate(timeout=PATIENCE)
        finally:
            process.kill()
    assert process.returncode == 130, err
    assert re.match(r"Ended at step 5 of \d+ \(.* s\): interrupted\. Commands heeded: 5\.\n", out)
    assert err == ""
    with xr.open_dataset(tmp_path / "kept" / "run.nc", engine="h5netcdf") as run:
        assert run["command"].shape == (5, 3)
        assert run.attrs["law_process"] == "a peer"


@pytest.mark.slow
def test_a_law_leaves_and_flies_in_a_process(tmp_path):
    need("gcc")
    starhold("export", "c", "three-laws", "--shell", "process", "--no-certify", "-o", "c", cwd=tmp_path, code=0)
    name = sh.load("three-laws").laws[0].name
    build_in(tmp_path, "gcc", *STRICT, "-o", "flight", *(f"c/{name}{end}.c" for end in ("", "_process")), "-lm")
    done = starhold(
        "run", "three-laws", "--law-process", "./flight", "--pictures", "page", "-o", "out", cwd=tmp_path, code=0
    )
    assert "The commands came from ./flight: nothing is proved about it." in done.stdout
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "commands from ./flight" in page
    assert f"Flights in this page are commanded by the file&#x27;s law {name}, not by ./flight." in page
    assert not (tmp_path / "out" / "certificate.json").exists()
    whole = sh.simulate("three-laws")
    with xr.open_dataset(tmp_path / "out" / "run.nc", engine="h5netcdf") as run:
        assert set(run.data_vars) == set(whole.data_vars)
        for quantity in whole.data_vars:
            assert np.array_equal(run[quantity], whole[quantity]), quantity
        assert run.attrs["law_process"] == "./flight"
        assert "law_program" not in run.attrs
    brief = sh.load("three-laws").with_({"simulation.duration": 20.0})
    assert sh.simulate(brief, process=str(tmp_path / "flight")).equals(sh.simulate(brief))
    done = starhold("run", "three-laws", "--law-process", "./none", "-o", "no", cwd=tmp_path, code=2)
    assert done.stderr.startswith("starhold: run: --law-process: found ./none; allowed: a program that runs")
    starhold("run", "three-laws", "--law-process", "./flight", "--check-step", cwd=tmp_path, code=2)
    # Killed in the middle of a frame: ten thousand bytes are a hello, some commands, and a part of one.
    (tmp_path / "cut.sh").write_text("./flight | { dd bs=1 count=10000 status=none; kill -9 $$; }\n")
    done = starhold("run", "three-laws", "--law-process", "sh cut.sh", "-o", "cut", cwd=tmp_path, code=2)
    step = int(re.search(r"sh cut\.sh, at step (\d+), a process that ended with -9", done.stderr)[1])
    assert step == (10000 - 20) // 44
    with xr.open_dataset(tmp_path / "cut" / "run.nc", engine="h5netcdf") as run:
        assert np.array_equal(run["command"], whole["command"][:step])
    assert not (tmp_path / "cut" / "summary.json").exists()
    # A plant that is killed there.
    done = subprocess.run([tmp_path / "flight"], input=b"SHLK\x01", capture_output=True, check=False)
    assert (done.returncode, done.stderr) == (1, f"{name}_process: the plant is gone\n".encode())


def test_the_header_is_written_for_flight_software_of_any_make(tmp_path):
    starhold("export", "link", "wheels-orbital", "-o", "link.h", cwd=tmp_path, code=0)
    assert "STARHOLD_AT_EFFECTORS_WHEELS_" in (tmp_path / "link.h").read_text()
    done = starhold("export", "link", "wheels-orbital", "-o", "link.h", cwd=tmp_path, code=2)
    assert "a file already there" in done.stderr
    need("g++")
    (tmp_path / "both.cpp").write_text('#include "link.h"\nint main() { return starhold_crc(nullptr, 0) != 0; }\n')
    build_in(tmp_path, "g++", "-Wall", "-Wextra", "-pedantic", "-Werror", "-o", "both", "both.cpp")
    assert subprocess.run([tmp_path / "both"], check=False).returncode == 0
