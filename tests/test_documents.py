"""What the documents say is so: they are written from the code, name what is there, and what they show is run."""

import json
import os
import re
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
import typer

import starhold as sh
from generate import FILLED, PAGES
from generators import formulas
from generators.authors import filled
from starhold.analysis.rigid_body import EXTRAS, make_meter
from starhold.analysis.trial import FLIGHTS
from starhold.campaign.sampling import SAMPLINGS
from starhold.campaign.sequence import runs_to_meet
from starhold.campaign.verdicts import runs_needed
from starhold.certification.certificate import write
from starhold.certification.certify import certify
from starhold.cli.main import app
from starhold.conformance.suite import examine
from starhold.laws.catalogue import catalogue, from_file
from starhold.scenario.building import build
from starhold.scenario.checking import RENAMED
from starhold.scenario.distributions import DISTRIBUTIONS
from starhold.scenario.reading import load
from starhold.scenario.requirement import CONE
from starhold.studies.requirements import LOST
from tests.running import starhold

ROOT = Path(__file__).parents[1]
BODIES = "src/starhold/scenario/bodies"


def read(name):
    return (ROOT / name).read_text(encoding="utf-8")


def blocks(name, language):
    return re.findall(rf"```{language}\n(.*?)```", read(name), flags=re.DOTALL)


@pytest.fixture
def run(capsys):
    """Run a block of a page's Python; what it prints, and its names."""

    def run(page, number=0):
        names = {}
        exec(compile(blocks(page, "python")[number], page, "exec"), names)
        return capsys.readouterr().out, names

    return run


PRINTED = {
    "docs/python.md": "<Scenario cubesat: pd, lyapunov; 3000 control steps> [<Flight pd: settling",
    "docs/machines.md": "0.18257418583505536",
}


@pytest.mark.slow
@pytest.mark.parametrize("page", PRINTED)
def test_python_of_a_page_runs(page, monkeypatch, run):
    monkeypatch.setattr("pandas.DataFrame.plot", lambda table, **how: None)
    assert PRINTED[page] in run(page)[0]


def test_readme_is_a_first_screen(run):
    """Ten lines to paste print what is quoted below them."""
    assert len(read("README.md").splitlines()) <= 80
    (pasted,), (quoted,) = blocks("README.md", "python"), blocks("README.md", "text")
    assert len(list(filter(None, pasted.splitlines()))) == 10
    assert run("README.md")[0] == quoted


MEASURED = {
    "starhold certify cubesat-nadir --law wheel": (
        r"within [\d.]+° of the target after [\d.]+ s at all times",
        r"from up to [\d.]+° at up to [\d.]+°/s",
        r"on an orbit within [\d.]+ % of a two-body one",
        r"all \d+ parts of the loop are in it",
    ),
    "starhold verify cubesat-mission": (r"[\d.]+ deg\b",),
}
"""What README says of the output of its commands."""


@pytest.mark.slow
@pytest.mark.parametrize("line", MEASURED)
def test_numbers_of_the_readme_are_measured_by_its_commands(line, tmp_path):
    (told,) = (" ".join(item.split()) for item in read("README.md").split("\n* ") if f"`{line}`" in item)
    printed = " ".join(starhold(*line.split()[1:], cwd=tmp_path, code=0).stdout.split())
    for pattern in MEASURED[line]:
        assert re.search(pattern, told)[0].lower() in printed.lower()


def test_version_is_said_alike():
    assert f"version {sh.__version__}\n" in read("README.md")
    assert f"\nversion: {sh.__version__}\n" in read("CITATION.cff")
    assert re.search(r"^## (\S+?),? ", read("CHANGELOG.md"), flags=re.MULTILINE)[1] == sh.__version__


def test_paper_is_as_its_journal_asks():
    """At most a thousand words below its head, under the headings that are asked for."""
    _, _, body = read("paper/paper.md").split("---\n", 2)
    assert len(body.split()) <= 1000
    asked = {"Summary", "Statement of need", "State of the field", "Software design", "Research impact statement"}
    assert asked | {"AI usage disclosure", "References"} == {*re.findall(r"^# (.+)$", body, flags=re.MULTILINE)}
    assert {*re.findall(r"@(\w+)", body)} == {*re.findall(r"^@\w+\{(\w+),", read("paper/paper.bib"), flags=re.MULTILINE)}


@pytest.fixture
def acceptance(monkeypatch, tmp_path):
    """The scenario of the page about campaigns, in the current folder."""
    (example,) = blocks("docs/campaigns.md", "toml")
    monkeypatch.chdir(tmp_path)
    Path("acceptance.toml").write_text(example, encoding="utf-8")
    return load("acceptance.toml")


@pytest.mark.slow
def test_campaigns_page_runs(acceptance, run):
    said, names = run("docs/campaigns.md", 1)
    assert said.startswith("<campaign acceptance: pd: ")
    assert "settling_time: met" in said
    assert names["again"].differs == ()
    for sql in blocks("docs/campaigns.md", "sql"):
        assert len(names["result"].query(sql)) in range(1, 10)


def test_commands_of_the_campaigns_page_are_commands(acceptance):
    assert known_commands(re.findall(r"^starhold .*$", read("docs/campaigns.md"), flags=re.MULTILINE)) == {
        "campaign",
        "query",
        "rerun",
    }


def known_commands(lines):
    """The names of printed commands, after a check that they have the arguments and options of their lines."""
    known = typer.main.get_command(app).commands
    for start, name, *words in map(shlex.split, lines):
        assert start == "starhold"
        known[name].make_context(name, words)
    return {line.split()[1] for line in lines}


COUNTED = {3: "three", 10: "ten", 11: "eleven", 12: "twelve", 13: "thirteen", 14: "fourteen", 15: "fifteen"}
FAILURES = (0, 1, 2, 5, 10)
NAMED = {
    "docs/campaigns.md: distributions": lambda: [f"| `{name}` |" for name in (*DISTRIBUTIONS, *SAMPLINGS)],
    "docs/campaigns.md: metrics": lambda: [
        f"`{metric}" for metric in (*make_meter(1, 1.0, "axis", (1.0, 1.0), wheels=True).table, *EXTRAS, LOST, CONE)
    ],
    "docs/campaigns.md: runs that verdicts need": lambda: [
        f"| {' | '.join(str(needed(0.9973, share, k)) for k in FAILURES)} |"
        for needed, share in ((runs_needed, 0.1), (runs_to_meet, 0.9))
    ],
    "paper/paper.md: counts": lambda: [
        f"{COUNTED[len(catalogue())].capitalize()} attitude laws are included",
        f"and {COUNTED[len(catalogue('libration-point'))]} that hold a craft",
        {10_000: "ten thousand flights each"}[FLIGHTS],
    ],
    **{
        f"docs/comparison.md: ratios of {page}": lambda page=page: re.findall(
            r"\d+ to \d+ times", " ".join(read(page).split())
        )
        for page in ("paper/paper.md", "README.md")
    },
}
"""What a page must name, by the page."""


@pytest.mark.parametrize("rule", NAMED)
def test_a_page_names_all_that_the_code_has(rule):
    page, named = read(rule.partition(":")[0]), [*NAMED[rule]()]
    assert named
    assert [text for text in named if text not in page and " ".join(text.split()) not in " ".join(page.split())] == []


def test_law_of_the_contributing_page_conforms(tmp_path):
    (example,) = blocks("CONTRIBUTING.md", "python")
    assert example == read("examples/rate_damping.py")
    path = tmp_path / "rate_damping.py"
    path.write_text(example, encoding="utf-8")
    assert [v for v in examine(from_file(path)) if v.outcome == "failed"] == []


def test_files_stay_short():
    for path in (ROOT / "src").rglob("*.py"):
        assert len(path.read_text(encoding="utf-8").splitlines()) <= 400, path


def test_names_that_only_type_checkers_import_are_in_annotations_that_nothing_evaluates():
    for path in (ROOT / "src").rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        assert "if TYPE_CHECKING:" not in text or "from __future__ import annotations" in text, path


def commands():
    """What the overview lists, as printed, without what follows the sign of a comment."""
    listed = re.search(r"run as printed:\n\n```\n(.*?)```", read("docs/index.md"), flags=re.DOTALL)
    assert listed is not None
    return [line.split(" # ")[0].strip() for line in listed[1].splitlines()]


def test_commands_of_the_readme_and_of_the_overview_are_commands():
    """All but those that lists or schemas come from, and an old name; a slow test runs them."""
    assert len(commands()) >= 15
    assert {"new", "compare"} == known_commands(re.findall(r"^(starhold .*?) *#", read("README.md"), flags=re.MULTILINE))
    assert {"certify", "verify"} == known_commands(MEASURED)
    assert {*typer.main.get_command(app).commands} - known_commands(commands()) <= {"schema", "wheels", "check-law"}


@pytest.mark.slow
def test_commands_of_the_overview_run_from_top_to_bottom(tmp_path):
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    for line in commands():
        if line.startswith(("starhold serve", "starhold studio", "starhold reproduce all")):
            # Two end when others end them: tests/cli/test_serve_cli.py, tests/studio. All publications: tests/publications.
            continue
        settings = {"cwd": tmp_path, "env": {**os.environ, "PATH": path}, "capture_output": True, "text": True}
        done = subprocess.run(line, shell=True, timeout=1800, **settings)
        assert done.returncode == 0, (line, done.stderr)
        assert "Traceback" not in done.stderr, line


def pages():
    return [*sorted(ROOT.glob("*.md")), *sorted((ROOT / "docs").rglob("*.md")), ROOT / "benchmarks" / "README.md"]


def anchors(path):
    """The places in a page that links may lead to."""
    headings = re.findall(r"^#+ (.+)$", path.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return {"", *(re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings)}


def test_every_link_leads_somewhere_in_the_clone():
    kept = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True).stdout.splitlines()
    for page in pages():
        text = re.sub(r"```.*?```|`[^`]*`", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
        for link in re.findall(r"\]\((?!https?://)([^)]+)\)", text):
            name, _, anchor = link.partition("#")
            found = page if not name else (page.parent / name).resolve()
            assert found.is_file(), (page, link)
            assert not kept or str(found.relative_to(ROOT)) in kept, (page, link)
            assert not anchor or anchor in anchors(found), (page, link)


@pytest.mark.parametrize("name", [*PAGES, *FILLED])
def test_page_is_as_the_code_says(name):
    page = read(f"docs/{name}")
    assert name in PAGES or "<!-- written by docs/generate.py: " in page
    told = PAGES[name]() if name in PAGES else filled(page)
    assert told == page, f"docs/{name} is not what the code says; write it anew: python docs/generate.py"


def test_no_page_is_left_of_what_is_gone():
    kept = {
        path.relative_to(ROOT / "docs").as_posix() for name in ("laws", "parts") for path in (ROOT / "docs" / name).iterdir()
    }
    assert kept == {name for name in PAGES if name.startswith(("laws/", "parts/"))}


@pytest.mark.parametrize("name", ["ARCHITECTURE.md", "CONTRIBUTING.md", "docs/changing.md"])
def test_files_that_pages_for_maintainers_name_are_there(name):
    named = re.findall(r"`([\w.-]+/[\w./-]+\.\w+|(?:src|tests|docs|examples)/[\w./-]+)`", read(name))
    assert [path for path in named if not any((ROOT / place / path).exists() for place in ("", "src/starhold"))] == []
    assert len(read("ARCHITECTURE.md").splitlines()) <= 95


def test_a_formula_that_is_not_the_law_is_not_found():
    """What a formula leaves of the components is not printed away."""
    read = formulas.Read(catalogue()["lyapunov"])
    wrong = (read.torque[0] + formulas.Q[1], *read.torque[1:])
    assert not read.formula(wrong).found
    assert read.formula(read.torque).found


@pytest.mark.slow
def test_example_of_parts_flies(tmp_path):
    """The scenario of the page about scenario files, with what it says is recorded."""
    (example,) = (text for text in blocks("docs/scenarios.md", "toml") if {"part", "law"} <= {*tomllib.loads(text)})
    path = tmp_path / "my.toml"
    path.write_text(example, encoding="utf-8")
    scenario = load(str(path))
    run = sh.simulate(scenario)
    assert {"gyro_rate", "complementary_filter_gyro_bias"} < set(run)
    # The filter finds the gyro's bias.
    assert abs(float(run["complementary_filter_gyro_bias"][-1, 0]) - 1.75e-4) < 5e-5


WITH_EFFECTORS = {
    "wheels": {"layout": "pyramid", "inertia": 2.2e-5, "torque_limit": 0.002, "momentum_limit": 0.015},
    "part": [
        {"type": "magnetometer"},
        {"type": "magnetorquers", "dipole_limit": 0.2},
        {"type": "magnetic-unloading", "dipole_limit": 0.2, "gain": 1e-3},
    ],
}


@pytest.mark.slow
def test_mission_of_the_page_about_modes_flies():
    example, _, rods, _ = blocks("docs/modes.md", "toml")
    scenario = sh.scenario(tomllib.loads(example))
    (flight,) = sh.compare(scenario)
    assert [one.mode for one in flight.modes] == ["detumble", "sun", "nadir"]
    assert flight.metrics["settling_time"] is not None
    assert [c.name for c in flight.certificates if c.outcome == "proved"][3:5] == [
        "mission: detumble to sun",
        "mission: sun to nadir",
    ]
    # Those with effectors of their own fly on a spacecraft that has them.
    with_effectors = tomllib.loads(example.partition("[[law.mode]]")[0] + rods)
    (flight,) = sh.compare(sh.scenario(with_effectors | WITH_EFFECTORS).with_({"simulation.duration": 60}))
    assert [one.mode for one in flight.modes] == ["detumble"]


BASE = {
    "name": "base",
    "spacecraft": {"inertia": [2.0, 3.0, 4.0], "torque_limit": 0.1},
    "initial": {"angles": ["60 deg", 0, 0]},
    "simulation": {"duration": "10 min", "control_period": 0.1},
    "law": [{"type": "pd", "k_rate": 0.2, "k_attitude": 0.03}],
}
"""What the tables that pages show by themselves are put into."""


def fragments():
    """The tables that pages show by themselves."""
    for name in ("scenarios.md", "certificates.md", "pointing-budget.md"):
        for indent, block in re.findall(r"^( *)```toml\n(.*?)^ *```", read(f"docs/{name}"), flags=re.DOTALL | re.MULTILINE):
            table = tomllib.loads(re.sub(f"^{indent}", "", block, flags=re.MULTILINE))
            yield pytest.param(BASE | table, id=f"{name}: {', '.join(table)}")


@pytest.mark.parametrize("tables", [*fragments()])
def test_table_of_a_page_is_read(tables):
    assert sh.scenario(tables).laws


def names_in(content):
    """The keys of tables, and of those within lists; what `numbers` and the like hold differs from claim to claim."""
    if isinstance(content, list):
        return set().union(*map(names_in, content))
    if isinstance(content, dict):
        return set(content).union(*(names_in(value) for value in content.values() if isinstance(value, list)))
    return set()


def test_certificate_of_its_page_has_the_keys_of_one(tmp_path):
    (example,) = blocks("docs/certificates.md", "json")
    scenario = load("three-laws")
    path = tmp_path / "certificate.json"
    write([certify(build(scenario, scenario.pick("lyapunov")), "lyapunov")], scenario.name, path)
    shown, written = json.loads(example), json.loads(path.read_text(encoding="utf-8"))
    assert shown["format"] == written["format"]
    assert names_in(shown) == names_in(written)


@pytest.mark.parametrize("body", ["rigid_body", "libration_point"])
def test_commented_part_of_a_template_is_one(body):
    text = read(f"{BODIES}/{body}/template.toml")
    table = re.search(r"^# \[\[part\]\].*?\n\n", text, flags=re.DOTALL | re.MULTILINE)
    assert table is not None
    there = re.sub("^# ", "", table[0], flags=re.MULTILINE)
    own = tomllib.loads(there)["part"][0]["name"]
    made = sh.scenario(tomllib.loads(text.replace(table[0], there)))
    assert own in sh.simulate(made.with_({"simulation.duration": 1.0}), law=made.laws[0].name).attrs["parts"]


def test_architecture_draws_the_layers_as_they_are():
    """In the picture each layer has a line, which begins with its packages."""
    layers = tomllib.loads(read("pyproject.toml"))["tool"]["importlinter"]["contracts"][0]["layers"]
    picture, *_ = blocks("ARCHITECTURE.md", "")
    assert [re.split(" {2,}", line)[0] for line in picture.splitlines()] == layers
    source = ROOT / "src" / "starhold"
    there = {path.stem for path in source.iterdir() if path.suffix == ".py" or (path / "__init__.py").is_file()}
    assert {name for layer in layers for name in re.findall(r"\w+", layer)} == there - {"__init__", "__main__"}


def test_changelog_names_all_that_was_renamed():
    assert dict(re.findall(r"^ *\| `([\w-]+)` \| `([\w-]+)` \|$", read("CHANGELOG.md"), flags=re.MULTILINE)) == RENAMED
