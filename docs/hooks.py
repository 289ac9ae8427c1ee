"""While the site is built, mathematics becomes MathML, so that pages need no script for it; pages from the folder above are
added, and the pages of laws and parts enter the navigation."""

import html
import re
from pathlib import Path
from typing import Any

from latex2mathml.converter import convert
from mkdocs.structure.files import File

FORMULA = re.compile(r'<(span|div) class="arithmatex">\s*\\([(\[])(.*?)\\[)\]]\s*</\1>', re.DOTALL)
ABOVE = {f"{name.upper()}.md": f"{name}.md" for name in ("architecture", "contributing", "support", "code_of_conduct")}
"""Files that lie beside `docs`, with what their pages are called."""


def on_config(config: Any) -> None:
    """Add a page for each law and part to the navigation."""
    docs = Path(config["docs_dir"])
    (reference,) = (section["Reference"] for section in config["nav"] if "Reference" in section)
    for entry in reference:
        for title, pages in entry.items():
            if isinstance(pages, list):
                pages += sorted(path.relative_to(docs).as_posix() for path in (docs / title.lower()).glob("*.md"))


def on_files(files: Any, config: Any) -> None:
    """Add the pages from the folder above."""
    for name, page in ABOVE.items():
        text = (Path(config["docs_dir"]).parent / name).read_text(encoding="utf-8")
        files.append(File.generated(config, page, content=text.replace("](docs/", "](")))


def on_page_markdown(text: str, **_: Any) -> str:
    """Return a page with its links to these leading to their pages."""
    for name, page in ABOVE.items():
        text = text.replace(f"](../{name}", f"]({page}")
    return text


def on_page_content(text: str, **_: Any) -> str:
    """Return a page with its LaTeX formulas as MathML."""

    def formula(match: re.Match[str]) -> str:
        tag, bracket, latex = match.groups()
        shown = convert(html.unescape(latex.strip()), display="inline" if bracket == "(" else "block")
        return f'<{tag} class="formula">{shown}</{tag}>'

    return FORMULA.sub(formula, text)
