"""Reads a page of the report back, for its tests."""

import json
from html.parser import HTMLParser
from typing import Any

import pytest


class Reader(HTMLParser):
    """Collects tags with attributes, the text outside scripts, and the scripts."""

    def __init__(self, page: str) -> None:
        super().__init__(convert_charrefs=True)
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.words: list[str] = []
        self.scripts: list[str] = []
        self.inside, self.page = "", page
        self.feed(page)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        self.inside = tag

    def handle_endtag(self, tag: str) -> None:
        self.inside = ""

    def handle_data(self, data: str) -> None:
        if self.inside == "script":
            self.scripts.append(data)
        elif self.inside != "style":
            self.words.append(data)

    @property
    def text(self) -> str:
        return " ".join(self.words)

    def loads_nothing(self) -> None:
        """Assert that the page has all it needs and may ask the network for nothing."""
        for tag, attrs in self.tags:
            assert tag not in {"link", "iframe", "img", "object", "embed", "base"}, tag
            assert not {"src", "href", "srcset", "action", "data", "poster"} & set(attrs), (tag, attrs)
        style = self.page.split("<style>")[1].split("</style>")[0]
        assert "url(" not in style
        assert "@import" not in style
        policy = next(attrs["content"] for _, attrs in self.tags if attrs.get("http-equiv") == "Content-Security-Policy")
        assert policy is not None
        assert policy.startswith("default-src 'none'")
        assert "http" not in policy

    def data(self) -> Any:
        """What the scripts read."""
        return json.loads(self.scripts[0], parse_constant=lambda name: pytest.fail(f"{name} is not JSON"))
