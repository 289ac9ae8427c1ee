"""The file that `starhold new` writes."""

from __future__ import annotations

from importlib import resources


def template_text() -> str:
    """A commented scenario that runs as it is and names every key."""
    return (resources.files("starhold.scenario") / "template.toml").read_text(encoding="utf-8")
