"""`starhold export c` writes what an engineer can review, build and test, and says what is wrong in one line."""

import hashlib
import json
import re
import runpy
import subprocess
from pathlib import Path

import pytest

import starhold as sh
from starhold.errors import InputError
from starhold.export.code import make_code
from starhold.export.source import texts
from starhold.scenario.building import build
from starhold.trace.program import Call, statements
from tests.export.flown import LAWS, build_in, code_of, compiled, need
from tests.refusals import complains
from tests.running import starhold
from tests.tiers import leading

DOCS = Path(__file__).parents[2] / "docs"
SMALL = "three-laws"


def export(folder: Path, *more: str, scenario: str = SMALL):
    return starhold("export", "c", scenario, "-o", folder, *more, cwd=folder.parent)


def test_folder_builds_and_passes_its_test(tmp_path):
    need("cmake", "gcc")
    done = export(tmp_path / "out")
    assert done.returncode == 0, done.stderr
    folder = tmp_path / "out"
    build = tmp_path / "build"
    build_in(tmp_path, "cmake", "-S", str(folder), "-B", str(build))
    build_in(tmp_path, "cmake", "--build", str(build))
    tested = subprocess.run(["ctest", "--test-dir", str(build), "-V"], capture_output=True, text=True)
    assert tested.returncode == 0
    assert "192 of 192 steps give the bits of the simulation" in tested.stdout


def test_header_has_the_digest_of_a_certificate_that_checks(tmp_path):
    export(tmp_path / "out")
    header = (tmp_path / "out" / "lyapunov.h").read_text()
    certificate = tmp_path / "out" / "certificate.json"
    assert hashlib.sha256(certificate.read_bytes()).hexdigest() in header
    assert "proved: converges: with unlimited torque" in header
    assert "These claims assume: rigid body" in re.sub(r"\s+", " ", header)
    assert "WARNING" not in header
    assert starhold("check", certificate, cwd=tmp_path).returncode == 0
    manifest = json.loads((tmp_path / "out" / "export.json").read_text())
    assert manifest["operations_at_most"]["additions"] == 44
    assert all(0 < cost["flash"] < 10_000 and 0 <= cost["stack"] < 2_000 for cost in manifest["measured"])


def test_header_warns_loudly_of_what_is_not_proved(tmp_path):
    done = export(tmp_path / "none", "--no-certify")
    assert "WARNING  NO CERTIFICATE" in (tmp_path / "none" / "lyapunov.h").read_text()
    assert "warning NO CERTIFICATE" in done.stdout
    sluggish = sh.load(SMALL).with_({"law.sliding.switching_gain": 1e-7})
    refuted = sh.export_c(sluggish, tmp_path / "refuted", "sliding")
    assert refuted.proof.outcome == "refuted"
    header = (tmp_path / "refuted" / "sliding.h").read_text()
    assert re.search(r"\*{80}\n +WARNING  REFUTED: ", header)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--law", "lyapunof"], "three-laws: law: found lyapunof; did you mean lyapunov?"),
        (["--name", "2nd"], "export c: name: found 2nd; allowed: a C identifier"),
        (["--name", "while"], "export c: name: found while; allowed: a C identifier"),
        (["--name", "sqrt"], "export c: name: found sqrt; allowed: a C identifier"),
        (["--name", "loi_générale"], "allowed: a C identifier"),
    ],
)
def test_bad_input_is_one_line(arguments, said, tmp_path):
    complains(export(tmp_path / "out", *arguments), said)
    assert not (tmp_path / "out").exists()


def test_part_without_a_form_in_c(tmp_path):
    from starhold.parts.part import Fitted, Part
    from tests.export.flown import loop_of

    class Drifting:
        ROLE, MODELLED, BODY = "environment", True, "rigid-body"

        @staticmethod
        def torque(state, params, craft, memory):
            return memory

        @staticmethod
        def remember(params):
            return (0.0, 0.0, 0.0)

        @staticmethod
        def update(memory, state, params, dice, step):
            return memory

    loop = loop_of("lyapunov").with_parts(Fitted(Part("drifting", Drifting)))  # pyright: ignore[reportArgumentType]
    with pytest.raises(InputError, match="drifting, which has no form in C"):
        make_code(loop, "law")


def test_tables_that_no_command_reads_need_no_form_in_c():
    """Wheels that share out a torque with the least peak hold facets, which are not the law's memory."""
    code = code_of("wheels with a fault, least-peak")
    assert not code.buffers
    assert "wheel_momentum" in code.printed.titles.values()


@pytest.mark.parametrize("name", [*(name for name in LAWS if name != "mission"), "estimator"])
def test_code_is_written_to_be_read(name):
    """Functions as in the equations, not one block; nothing from the library but sqrt; no recursion, no allocation."""
    code = code_of(name)
    printed = code.printed
    defined: set[str] = set()
    for function in printed.functions.values():
        called = {s.function.name for s in statements(function.body) if isinstance(s, Call)}
        assert called <= defined
        defined.add(function.name)
        lines = printed.chunks[function.name]
        assert len(lines) < (40 if name != "mpc" else 400), function.name
        assert all(len(line) <= 120 for line in lines)
    text = re.sub(r"/\*.*?\*/", "", "\n".join(printed.lines), flags=re.S)
    used = set(re.findall(r"\b([a-z_]\w*)\(", text)) - set(printed.titles.values())
    assert {word for word in used if not word.endswith("_t")} <= {"sqrt", "if", "for", "return"}, used
    assert "goto" not in text
    assert len(defined) >= 7


def test_strict_compilers_have_nothing_to_say():
    for name in ("wheel", "estimator", "pid, example 0, noise"):
        compiled(name, "gcc", "-O1")
        compiled(name, "clang", "-O1", "-Weverything", "-Wno-padded", "-Wno-float-equal", "-Wno-declaration-after-statement",
                 "-Wno-unsafe-buffer-usage", "-Wno-unknown-warning-option")  # fmt: skip


@pytest.mark.parametrize("name", leading(["lyapunov", "lqr", "sliding", "modal", "wheel", "mpc"], 3))
def test_docs_show_the_code_of_today(name):
    page = runpy.run_path(str(DOCS / "flight_code.py"))
    scenario, law = page["shown"]()[name]
    code = make_code(build(scenario, scenario.pick(law)), name)
    kept = (DOCS / "flight-code" / f"{name}.c").read_text(encoding="utf-8")
    made, again = texts(code, scenario.name, law).source, "write it anew: python docs/flight_code.py"
    if name == "mpc":
        # Its matrices come from LAPACK, whose last digits differ between processors, and with them the breaks of lines.
        (made, mine), (kept, shown) = map(_numbers_apart, (made, kept))
        assert mine == pytest.approx(shown, rel=1e-9, abs=0.0), again
    assert made == kept, again


def _numbers_apart(text):
    """A text with # for each decimal number and a blank for any space, and the numbers."""
    decimal = r"-?\b\d+\.\d+(?:e[-+]?\d+)?\b"
    return re.sub(r"\s+", " ", re.sub(decimal, "#", text)), [float(x) for x in re.findall(decimal, text)]


def test_docs_quote_the_law():
    page = (DOCS / "flight-code.md").read_text(encoding="utf-8")
    quoted = re.findall(r"```c\n(.*?)```", page, flags=re.DOTALL)[1]
    assert quoted in (DOCS / "flight-code" / "lyapunov.c").read_text(encoding="utf-8")
