"""The site builds without a warning, asks nothing of the network, and has no link that leads nowhere."""

import os
import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

ROOT = Path(__file__).parents[1]
FETCHING = {"script": "src", "img": "src", "link": "href", "iframe": "src", "source": "src"}
"""Tags by which a browser fetches, with the attribute that says what."""


class Page(HTMLParser):
    """The links, what is fetched, the places that links may lead to, and the formulas of a page."""

    def __init__(self, text):
        super().__init__()
        self.links, self.fetched, self.places, self.formulas = [], [], set(), 0
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        told = dict(attributes)
        self.places |= {told[key] for key in ("id", "name") if told.get(key)}
        self.formulas += tag == "math"
        if tag == "a" and told.get("href"):
            self.links.append(told["href"])
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


def test_every_link_of_the_site_leads_somewhere(site):
    counted = 0
    for path, page in site.items():
        for address in (*page.links, *page.fetched):
            parts = urlsplit(address)
            if parts.scheme in ("http", "https", "data", "javascript"):
                continue
            found = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            assert found.is_file(), (path.name, address)
            if parts.fragment and found in site and not parts.fragment.startswith("__"):
                assert unquote(parts.fragment) in site[found].places, (path.name, address)
                counted += 1
    assert counted > 200


def test_formulas_are_mathml(site):
    assert sum(page.formulas for path, page in site.items() if "laws" in (path.stem, path.parent.name)) > 30
    for path in site:
        assert "arithmatex" not in path.read_text(encoding="utf-8"), path.name
