"""What the documents show is run."""

import re
from pathlib import Path

from starhold.conformance.suite import examine
from starhold.laws.catalogue import catalogue, from_file
from starhold.laws.station.interface import station_laws

ROOT = Path(__file__).parents[1]


def blocks(name, language):
    return re.findall(rf"```{language}\n(.*?)```", (ROOT / name).read_text(encoding="utf-8"), flags=re.DOTALL)


def test_readme_example_runs(capsys):
    (example,) = blocks("README.md", "python")
    exec(compile(example, "README.md", "exec"), {})
    said = capsys.readouterr().out
    assert said.startswith("from 180 to ")
    assert "mpc" in said


def test_readme_names_every_law():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    for name in catalogue() | station_laws():
        assert f"| `{name}` |" in text


def test_law_of_the_contributing_page_conforms(tmp_path):
    (example,) = blocks("CONTRIBUTING.md", "python")
    path = tmp_path / "rate_damping.py"
    path.write_text(example, encoding="utf-8")
    assert [v for v in examine(from_file(path)) if v.outcome == "failed"] == []


def test_files_stay_short():
    for path in (ROOT / "src").rglob("*.py"):
        assert len(path.read_text(encoding="utf-8").splitlines()) <= 400, path


def test_generated_page_of_laws():
    import runpy

    page = runpy.run_path(str(ROOT / "docs" / "generate.py"))["page"]()
    for law in catalogue() | station_laws():
        assert f"## {law}: " in page
    assert "-k_attitude*q_1 - k_rate*w_1" in page
