"""kernel.pyz beside a certificate.json: run by Python alone it proves what `starhold check` reports, in the same words."""

import hashlib
import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

import starhold as sh
from starhold import kernel
from starhold.certification.certificate import kernel_bundle
from starhold.kernel.check import check
from starhold.laws.program import law_digest
from starhold.scenario.building import build
from tests.running import starhold
from tests.tiers import leading

WRITTEN = {
    "attitude": ("certify", "three-laws", "--law", "lyapunov"),
    "station": ("certify", "l2-circle", "--law", "smooth"),
    "set": ("invariant", "hahn"),
}
NEEDLESS = {"attitude": {"cells", "taylor"}, "station": {"held", "near"}, "set": {"loops"}}
"""Files of the kernel without which these are checked."""


@pytest.fixture(scope="module", params=leading(WRITTEN))
def made(request, tmp_path_factory):
    """A folder that a command wrote a certificate and the kernel into."""
    folder = tmp_path_factory.mktemp(request.param)
    starhold(*WRITTEN[request.param], "-o", "out", cwd=folder, code=0)
    return folder / "out"


def alone(folder, file="certificate.json"):
    return subprocess.run([sys.executable, "-I", "-S", "kernel.pyz", file], cwd=folder, capture_output=True, text=True)


def test_kernel_alone_and_the_command_say_the_same(made):
    content = json.loads((made / "certificate.json").read_text())
    done, told = alone(made), starhold("check", "certificate.json", cwd=made, code=0).stdout
    assert (done.returncode, done.stderr) == (0, "")
    proved = [line.removeprefix("proved: ") for line in done.stdout.splitlines() if line.startswith("proved: ")]
    assert proved == [one.statement.written() for one in check(json.dumps(content))]
    assert len(proved) == len(content["claims"]) > 0
    assert " 0 fail" in told
    count, names = re.search(r"^Checked by (\d+) lines of the kernel: (.*)\.$", done.stdout, re.MULTILINE).groups()
    read = [(Path(kernel.__file__).parent / f"{name.replace('.', '/')}.py") for name in names.split(", ")]
    files = [path if path.exists() else path.with_suffix("") / "__init__.py" for path in read]
    assert int(count) == sum(len(path.read_text().splitlines()) for path in files)
    assert not NEEDLESS[made.parent.name.rstrip("0")] & {*names.split(", ")}
    for digest in content["programs"]:
        assert digest in done.stdout
    content["claims"][0]["numbers"] |= {"more": "1"}
    (made / "changed.json").write_text(json.dumps(content))
    (refused,) = alone(made, "changed.json").stdout.splitlines()
    assert refused.startswith("refused: ")
    reason = refused.removeprefix("refused: ")
    assert reason in " ".join(starhold("check", "changed.json", cwd=made, code=1).stdout.split())


def test_kernel_has_the_same_bytes_each_time_and_check_names_them(made):
    data = (made / "kernel.pyz").read_bytes()
    assert data == kernel_bundle() == kernel_bundle()
    told = starhold("check", "certificate.json", cwd=made, code=0).stdout
    assert re.search(r"sha256 ([0-9a-f]{64})", told)[1] == hashlib.sha256(data).hexdigest()


@pytest.mark.parametrize(("scenario", "law", "other"), leading([
    ("three-laws", "lyapunov", "cubesat-slew"), ("l2-circle", "smooth", "l2-nonlinear"),
]))  # fmt: skip
def test_one_digest_names_the_law_in_certificate_code_run_and_page(scenario, law, other, tmp_path):
    given = sh.load(scenario)
    loop = build(given, given.pick(law))
    digest = law_digest(loop.law, loop.gains, loop.known, loop.period)
    assert len(digest) == 64
    sh.export_c(given, tmp_path / "c", law)
    content = json.loads((tmp_path / "c" / "certificate.json").read_text())
    assert {claim["programs"]["law"] for claim in content["claims"]} == {digest}
    (header,) = (tmp_path / "c").glob("*.h")
    assert f"Program of the law: sha256 {digest}" in header.read_text()
    assert sh.simulate(given.with_({"simulation.duration": 10 * loop.period}), law).attrs["law_program"] == digest
    same = starhold("check", "c/certificate.json", "--scenario", scenario, cwd=tmp_path, code=0)
    assert "The programs of its proofs are those of" in same.stdout
    assert starhold("check", "c/certificate.json", "--scenario", other, cwd=tmp_path, code=1).stdout.startswith(
        "another loop"
    )
