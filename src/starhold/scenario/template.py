"""The file that `starhold new` writes."""

from __future__ import annotations

from importlib import resources


def template_text(libration: bool = False) -> str:
    """A commented scenario that runs as it is and names every key, of a body that turns or of station keeping."""
    name = "libration.toml" if libration else "template.toml"
    return (resources.files("starhold.scenario") / name).read_text(encoding="utf-8")
