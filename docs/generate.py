"""Writes the pages that tell what is in the code: commands, the Python interface, keys of scenarios, laws, parts; and the
tables of the pages for authors and of that on what is not claimed. A test says that they are as the code is."""

from __future__ import annotations

from pathlib import Path

from generators import api, commands, gallery, laws, parts, publications
from generators import keys as scenario_keys
from generators.authors import filled

PAGES = {
    "api.md": api.page,
    "commands.md": commands.page,
    "gallery.md": gallery.page,
    "keys.md": scenario_keys.page,
    "laws.md": laws.page,
    "parts.md": parts.page_of_parts,
    "publications.md": publications.page,
}
FILLED = ("law-authors.md", "not-claimed.md", "part-authors.md")


if __name__ == "__main__":
    here = Path(__file__).parent
    for name, page in PAGES.items():
        (here / name).write_text(page(), encoding="utf-8")
    for name in FILLED:
        authors = here / name
        authors.write_text(filled(authors.read_text(encoding="utf-8")), encoding="utf-8")
