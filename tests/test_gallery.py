"""Every script of the gallery runs and draws the picture that the page shows."""

import runpy
import sys
from pathlib import Path

import pytest
from matplotlib.testing.compare import compare_images

from generators.gallery import SCRIPTS
from tests.tiers import leading

ROOT = Path(__file__).parents[1]
PARTS = {"leak", "rate_damping"}
"""Files that scripts name, and that are none themselves."""
TOLERANCE = 12.0
"""Root mean square of the difference, of 255: other fonts differ by less, another curve by more."""


@pytest.mark.parametrize("name", leading(SCRIPTS))
def test_script_draws_its_picture(name, tmp_path, monkeypatch, quiet_plots):
    picture = tmp_path / f"{name}.png"
    monkeypatch.setattr(sys, "argv", [f"{name}.py", str(picture)])
    runpy.run_path(str(ROOT / "examples" / f"{name}.py"), run_name="__main__")
    kept = ROOT / "docs" / "gallery" / f"{name}.png"
    assert kept.stat().st_size < 60_000
    assert compare_images(str(kept), str(picture), TOLERANCE) is None


def test_gallery_has_every_script():
    assert {path.stem for path in (ROOT / "examples").glob("*.py")} == {*SCRIPTS, *PARTS}
    assert {path.stem for path in (ROOT / "docs" / "gallery").iterdir()} == {*SCRIPTS}


def test_part_of_the_gallery_is_that_of_the_tutorial():
    page = (ROOT / "docs" / "tutorials" / "your-part.md").read_text(encoding="utf-8")
    for name in PARTS:
        assert (ROOT / "examples" / f"{name}.py").read_text(encoding="utf-8") in page
