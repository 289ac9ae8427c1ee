"""Writes the pages that tell what is in the code: commands, the Python interface, keys of scenarios, laws, parts; and the
tables and lists that stand inside pages written by hand. A test says that they are as the code is."""

from __future__ import annotations

from pathlib import Path

from generators import api, benchmarks, commands, gallery, laws, parts, publications
from generators import keys as scenario_keys
from generators.authors import filled

PAGES = {
    "api.md": api.page,
    "benchmarks.md": benchmarks.page,
    "commands.md": commands.page,
    "gallery.md": gallery.page,
    "keys.md": scenario_keys.page,
    "laws.md": laws.page,
    "parts.md": parts.page,
    "publications.md": publications.page,
    **laws.pages(),
    **parts.pages(),
}
FILLED = (
    "../README.md",
    "certificates.md",
    "index.md",
    "invariant-sets.md",
    "kernel-flying.md",
    "kernel.md",
    "law-authors.md",
    "not-claimed.md",
    "part-authors.md",
    "requirements.md",
)


if __name__ == "__main__":
    here = Path(__file__).parent
    for folder in ("laws", "parts"):
        (here / folder).mkdir(exist_ok=True)
        for old in (here / folder).glob("*.md"):
            old.unlink()
    for name, page in PAGES.items():
        (here / name).write_text(page(), encoding="utf-8")
    for name in FILLED:
        authors = here / name
        authors.write_text(filled(authors.read_text(encoding="utf-8")), encoding="utf-8")
