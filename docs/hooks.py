"""Mathematics becomes MathML while the site is built, so that pages need no script for it."""

import html
import re
from typing import Any

from latex2mathml.converter import convert

FORMULA = re.compile(r'<(span|div) class="arithmatex">\s*\\([(\[])(.*?)\\[)\]]\s*</\1>', re.DOTALL)


def on_page_content(text: str, **_: Any) -> str:
    """Return a page with its LaTeX formulas as MathML."""

    def formula(match: re.Match[str]) -> str:
        tag, bracket, latex = match.groups()
        shown = convert(html.unescape(latex.strip()), display="inline" if bracket == "(" else "block")
        return f'<{tag} class="formula">{shown}</{tag}>'

    return FORMULA.sub(formula, text)
