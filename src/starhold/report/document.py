"""Documents: sections of sentences, tables and figures, rendered as a printable page and as Markdown."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from html import escape
from typing import Any, NamedTuple, TypeAlias

from starhold.report.commands import Block, Cell, Heading, Table


class Figure(NamedTuple):
    """A function that draws a figure, and the caption without its full stop."""

    caption: str
    draw: Callable[[], Any]


class Listing(NamedTuple):
    """The text of a file."""

    text: str


Piece: TypeAlias = Block | Figure | Listing


class Section(NamedTuple):
    """A section with its name. fresh: whether it begins a page. A `Cell` of kind "section" links to the section named in
    its detail."""

    name: str
    pieces: Sequence[Piece]
    fresh: bool = False


def pages_of(title: str, sections: Sequence[Section], footer: str) -> tuple[str, str]:
    """Return a document as self-contained HTML and as Markdown, with numbered sections and figures."""
    from starhold.report.figures import address, png

    heads = {one.name: f"{number} {one.name}" for number, one in enumerate(sections, 1)}
    anchors = {name: re.sub(r"[^\w -]", "", head.lower()).replace(" ", "-") for name, head in heads.items()}
    figures = [piece for one in sections for piece in one.pieces if isinstance(piece, Figure)]
    drawn = {id(one): (f"Figure {n}", f"{one.caption}.", address(png(one.draw()))) for n, one in enumerate(figures, 1)}
    return _html(title, sections, footer, heads, anchors, drawn), _markdown(title, sections, footer, heads, anchors, drawn)


Drawn: TypeAlias = Mapping[int, tuple[str, str, str]]
"""The number, the caption and the address of each figure."""
Names: TypeAlias = Mapping[str, str]


# --- HTML -------------------------------------------------------------------------------------------------------------


def _html(title: str, sections: Sequence[Section], footer: str, heads: Names, anchors: Names, drawn: Drawn) -> str:
    from starhold.report.page_parts import plain_document

    links = "".join(f'<li><a href="#{anchors[name]}">{escape(head)}</a></li>' for name, head in heads.items())
    body = [f'<main class="document"><h1>{escape(title)}</h1>']
    for place, one in enumerate(sections):
        fresh = ' class="fresh"' if one.fresh else ""
        body.append(f'<section id="{anchors[one.name]}"{fresh}><h2>{escape(heads[one.name])}</h2>')
        body += [_piece_html(piece, anchors, drawn) for piece in one.pieces]
        body.append("</section>" if place else f'</section><nav><ul class="contents">{links}</ul></nav>')
    return plain_document(title, [*body, f"<footer>{escape(footer)}</footer></main>"], ("page.css", "document.css"))


def _piece_html(piece: Piece, anchors: Names, drawn: Drawn) -> str:
    if isinstance(piece, Figure):
        number, caption, address = drawn[id(piece)]
        caption = escape(caption)
        return f'<figure><img src="{address}" alt="{caption}"><figcaption><b>{number}.</b> {caption}</figcaption></figure>'
    if isinstance(piece, Listing):
        return f"<pre>{escape(piece.text)}</pre>"
    return block_html(piece, anchors)


def block_html(block: Block, anchors: Names | None = None) -> str:
    """Return a block of a command's result as HTML; its text may have style marks. anchors: those of sections, by name."""
    from starhold.report.tables import table_html

    level, kind = ("h2", "text tight") if anchors is None else ("h3", "told tight")
    if isinstance(block, Heading):
        return f"<{level}>{escape(block.name + block.rest)}</{level}>"
    if isinstance(block, str):
        return f'<p style="white-space:pre-wrap">{escape(block)}</p>' if block else ""
    rows = [[_cell_html(*both, anchors or {}) for both in cells] for cells in _cells(block)]
    title = f"<{level}>{escape(block.title)}</{level}>" if block.title else ""
    return f"{title}{table_html(block._replace(rows=rows), kind)}"


def _cells(table: Table) -> Iterator[Iterable[tuple[Any, str]]]:
    """Return the cells of each row, each with its text."""
    return (zip(row, texts, strict=True) for row, texts in zip(table.rows, table.texts(), strict=True))


def _cell_html(value: Any, text: str, anchors: Names) -> Any:
    from rich.text import Text

    from starhold.report.tables import Markup, pill

    if isinstance(value, Cell):
        return value if value.kind != "section" else Markup(f'<a href="#{anchors[value.detail]}">{escape(value.text)}</a>')
    read = Text.from_markup(text)
    for span in read.spans:
        before, word, after = read.plain[: span.start], read.plain[span.start : span.end], read.plain[span.end :]
        if shown := pill(word):
            return Markup(f"{escape(before)}{shown}{escape(after)}")
    return read.plain


# --- Markdown ---------------------------------------------------------------------------------------------------------


def _markdown(title: str, sections: Sequence[Section], footer: str, heads: Names, anchors: Names, drawn: Drawn) -> str:
    lines = [f"# {_safe(title)}"]
    for place, one in enumerate(sections):
        lines.append(f"## {_safe(heads[one.name])}")
        lines += [text for piece in one.pieces if (text := _piece_markdown(piece, anchors, drawn))]
        if not place:
            lines.append("\n".join(f"* [{_safe(head)}](#{anchors[name]})" for name, head in heads.items()))
    # The pictures come last, so that the text can be read and compared without them.
    lines += [_safe(footer), *(f"[{number}]: {address}" for number, _, address in drawn.values())]
    return "\n\n".join(lines) + "\n"


def _piece_markdown(piece: Piece, anchors: Names, drawn: Drawn) -> str:
    if isinstance(piece, Figure):
        number, caption, _ = drawn[id(piece)]
        return f"![{_safe(caption)}][{number}]\n\n**{number}.** {_safe(caption)}"
    if isinstance(piece, Listing):
        fence = "`" * max(3, 1 + max(map(len, re.findall("`+", piece.text)), default=0))
        return f"{fence}toml\n{piece.text.rstrip()}\n{fence}"
    if isinstance(piece, Heading):
        return f"### {_safe(piece.name + piece.rest)}"
    if isinstance(piece, str):
        return _safe(piece)
    rows = [[_cell_markdown(*both, anchors) for both in cells] for cells in _cells(piece)]
    sides = ["---:" if column.format else "---" for column in piece.columns]
    table = "\n".join(f"| {' | '.join(row)} |" for row in [[_safe(head) for head in piece.heads()], sides, *rows])
    return f"### {_safe(piece.title)}\n\n{table}" if piece.title else table


def _cell_markdown(value: Any, text: str, anchors: Names) -> str:
    from rich.text import Text

    if not isinstance(value, Cell):
        return _safe(Text.from_markup(text).plain)
    return f"[{_safe(value.text)}](#{anchors[value.detail]})" if value.kind == "section" else _safe(value.text)


def _safe(text: str) -> str:
    """Return text with Markdown's special characters escaped."""
    return re.sub(r"([\\`*<>|\[\]#]|(?<!\w)_|_(?!\w))", r"\\\1", " ".join(text.split()))
