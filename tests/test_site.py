"""The site builds without a warning, as of a link that leads nowhere, and asks nothing of the network."""

import os
import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import urlsplit

import pytest

ROOT = Path(__file__).parents[1]
FETCHING = {"script": "src", "img": "src", "link": "href", "iframe": "src", "source": "src"}
"""Tags by which a browser fetches, with the attribute that says what."""


class Page(HTMLParser):
    """What is fetched, and the formulas of a page."""

    def __init__(self, text):
        super().__init__()
        self.fetched, self.formulas = [], 0
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        told = dict(attributes)
        self.formulas += tag == "math"
        if tag in FETCHING and told.get(FETCHING[tag]) and told.get("rel") != "canonical":
            self.fetched.append(told[FETCHING[tag]])


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The built pages by their paths."""
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(folder)]
    quiet = {"NO_MKDOCS_2_WARNING": "1", "PYTHONWARNINGS": "ignore"}
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, env={**os.environ, **quiet})
    assert done.returncode == 0, done.stderr
    # Only a server shows its page for what is not found, whose addresses count from the server's root.
    paths = [path for path in sorted(folder.rglob("*.html")) if path.name != "404.html"]
    return {path: Page(path.read_text(encoding="utf-8")) for path in paths}


def test_every_page_is_there(site):
    built = {path.stem for path in site}
    assert {path.stem for path in (ROOT / "docs").rglob("*.md")} | {"architecture", "contributing"} <= built


def test_nothing_is_fetched_from_elsewhere(site):
    for path, page in site.items():
        for address in page.fetched:
            assert not urlsplit(address).netloc, (path.name, address)
        styles = [path.parent / urlsplit(address).path for address in page.fetched if address.endswith(".css")]
        for style in styles:
            assert not re.search(r"@import|url\(['\"]?https?:", style.read_text(encoding="utf-8")), style


def test_formulas_are_mathml(site):
    assert sum(page.formulas for path, page in site.items() if "laws" in (path.stem, path.parent.name)) > 30
    for path in site:
        assert "arithmatex" not in path.read_text(encoding="utf-8"), path.name
