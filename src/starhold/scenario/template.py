"""The file that `starhold new` writes."""

from __future__ import annotations

from starhold.scenario.bodies import bodies


def template_text(body: str) -> str:
    """A commented scenario, of the body of this name, that runs as it is and names every key."""
    return bodies()[body].template
