"""The kernel cache: used when nothing changed, never when something did."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from starhold.laws.catalogue import catalogue

SCRIPT = """
import sys
from pathlib import Path
from starhold.conformance.bench import sample_loop
from starhold.laws.catalogue import from_file
from starhold.loop.kernels import make_kernels
from starhold.simulation.lane import fly
law = from_file(Path(sys.argv[1]))
loop = sample_loop(law, law.examples()[0])
print(repr(fly(loop, 5)[1].command))
stats = make_kernels(loop.parts()).one.stats
print("hits", sum(stats.cache_hits.values()), "misses", sum(stats.cache_misses.values()))
"""


@pytest.fixture
def flown(tmp_path):
    def fly(path):
        environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONHASHSEED": "random"}
        done = subprocess.run(
            [sys.executable, "-c", SCRIPT, str(path)], env=environment, capture_output=True, text=True, check=True
        )
        return done.stdout.splitlines()

    return fly


def test_second_start_does_not_compile_and_an_edit_does(flown, tmp_path):
    text = Path(catalogue()["pd"].module.__file__).read_text()
    constants = tmp_path / "my_constants.py"
    constants.write_text("FACTOR = 1.0\n")
    law = tmp_path / "edited.py"
    law.write_text(
        text.replace("scale(gains.k_rate,", "scale(FACTOR * gains.k_rate,").replace(
            "from starhold.models.craft import Craft",
            "from starhold.models.craft import Craft\nfrom my_constants import FACTOR",
        )
    )
    law.write_text(f"import sys\nsys.path.insert(0, {str(tmp_path)!r})\n" + law.read_text().replace("from __future__", "#"))
    first = flown(law)
    second = flown(law)
    assert first[0] == second[0]
    assert first[1] == "hits 0 misses 1"
    assert second[1] == "hits 1 misses 0"
    law.write_text(law.read_text().replace("FACTOR * gains.k_rate", "2.0 * FACTOR * gains.k_rate"))
    edited = flown(law)
    assert edited[1] == "hits 0 misses 1"
    assert edited[0] != first[0]
    # A module that the law imports counts as well.
    constants.write_text("FACTOR = -3.0\n")
    imported = flown(law)
    assert imported[1] == "hits 0 misses 1"
    assert imported[0] != edited[0]


def test_a_law_that_is_gone_spoils_no_other(flown, tmp_path):
    """Kernels of outside laws once shared an index with all others, which then could not be read without them."""
    text = Path(catalogue()["pd"].module.__file__).read_text()
    (tmp_path / "first").mkdir()
    law = tmp_path / "first" / "gone.py"
    law.write_text(text)
    flown(law)
    law.rename(tmp_path / "other.py")
    assert flown(tmp_path / "other.py")[1].startswith("hits")


def test_a_law_installed_as_a_library_is_watched_too(flown, tmp_path):
    folder = tmp_path / "site-packages"
    folder.mkdir()
    law = folder / "installed.py"
    law.write_text(Path(catalogue()["pd"].module.__file__).read_text())
    first = flown(law)
    assert flown(law)[1] == "hits 1 misses 0"
    law.write_text(law.read_text().replace("scale(gains.k_rate,", "scale(2.0 * gains.k_rate,"))
    edited = flown(law)
    assert edited[1] == "hits 0 misses 1"
    assert edited[0] != first[0]
