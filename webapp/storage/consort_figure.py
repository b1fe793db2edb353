"""The flow of participants as a figure: SVG that any browser and word processor shows, with its numbers as text."""

import re
import textwrap
from collections.abc import Iterator, Sequence
from xml.sax.saxutils import escape as escape_markup

from webapp.storage.consort import FATES, Counts, Fate, Flow

_WIDTH = 900
"""So wide that its text is legible on paper, where the figure takes the width of a page."""
_LINE = 20
_MAIN, _SIDE = 330, 440
"""Widths of the boxes in the middle and at the side."""
_LEFT = 30
_GAP = 36
_WORDS: dict[Fate, str] = {
    "withdrawn": "left the study",
    "screened_out": "screened out by the quiz",
    "in_progress": "began and did not finish",
    "completed": "completed",
}
_COLUMNS = ("allocated", "left", "screened", "unfinished", "completed", "excluded", "analysed")
_FIRST_COLUMN = 235
_MOST_ARRANGEMENTS = 12
"""A flow with more of them has rows of one or two people: they are left to the table in the data set."""
# Attributes and no styles: where the server shows the figure as a page, the page's policy allows none within it.
_INK = "#1a1a1a"
_PAPER = 'fill="#fff"'
_STROKE = f'stroke="{_INK}" stroke-width="1.2"'
_RULE = 'stroke="#aaa" stroke-width="1.2"'
_TEXT = f'font-family="system-ui, sans-serif" font-size="15" fill="{_INK}"'
_HEAD = ' font-weight="600"'
_SMALL = ' font-size="13"'


def draw_flows(flows: Sequence[Flow]) -> str:
    """Draw one flow under the other."""
    parts: list[str] = []
    y = 20
    for flow in flows:
        y = _draw(parts, flow, y) + 2 * _GAP
    if not flows:
        parts.append(_text(_LEFT, y + _LINE, "No participants."))
        y += 3 * _LINE
    told = " ".join(_sentence(flow) for flow in flows) or "No participants."
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {y}" width="{_WIDTH}" height="{y}"',
            f' role="img" aria-labelledby="title desc" {_TEXT}>',
            '<title id="title">Flow of participants</title>',
            f'<desc id="desc">{_escape(told)}</desc>',
            '<defs><marker id="arrow" viewBox="0 0 8 8" refX="8" refY="4" markerWidth="8" markerHeight="8"',
            f' orient="auto"><path d="M0 0 8 4 0 8z" fill="{_INK}"/></marker></defs>',
            f'<rect x="0" y="0" width="{_WIDTH}" height="{y}" {_PAPER}/>',
            *parts,
            "</svg>",
            "",
        ]
    )


def _draw(parts: list[str], flow: Flow, y: int) -> int:
    """Draw a flow below `y`, and return where it ends."""
    scope, counts = flow.scope, flow.everybody
    title = f"{scope.study}, version {scope.study_version[:12]}, mode {scope.mode}"
    parts.append(_text(_LEFT, y + _LINE, title, _HEAD))
    y += 2 * _LINE
    dropped = [f"{_WORDS[fate]} (n = {counts.fates[fate]})" for fate in FATES[:-1]]
    if counts.included:
        dropped.append(f"of these, analysed all the same (n = {counts.included})")
    reasons = [f"{reason} (n = {n})" for reason, n in counts.excluded.most_common()]
    y = _step(parts, y, [f"Agreed and allocated (n = {counts.allocated})"], is_first=True)
    y = _aside(parts, y, f"Did not complete (n = {counts.dropped})", dropped)
    y = _step(parts, y, [f"Completed (n = {counts.fates['completed']})"])
    y = _aside(parts, y, f"Excluded after completing (n = {counts.excluded.total()})", reasons)
    among = [f"with those who did not complete (n = {counts.included})"] if counts.included else []
    y = _step(parts, y, [f"Analysed (n = {counts.analysed})", *among])
    if flow.num_erased:
        told = f"Besides these, everything of {flow.num_erased} who had agreed was erased at their own wish."
        parts.append(_text(_LEFT, y + _GAP, told, _SMALL))
        y += _LINE
    return _tables(parts, flow, y + _GAP)


def _step(parts: list[str], y: int, lines: Sequence[str], *, is_first: bool = False) -> int:
    """Draw a box in the middle, with the arrow that leads to it from above."""
    if not is_first:
        parts.append(_arrow(_LEFT + _MAIN // 2, y, _LEFT + _MAIN // 2, y + _GAP // 2))
        y += _GAP // 2
    return _box(parts, _LEFT, y, _MAIN, lines)


def _aside(parts: list[str], y: int, head: str, lines: Sequence[str]) -> int:
    """Draw a box at the side of the line down the middle."""
    x, middle = _WIDTH - _LEFT - _SIDE, _LEFT + _MAIN // 2
    unbroken = [line.replace("n = ", "n\u00a0=\u00a0") for line in lines]
    wrapped = [head, *(piece for line in unbroken for piece in textwrap.wrap(line, 50, subsequent_indent="    "))]
    end = _box(parts, x, y + _GAP // 2, _SIDE, wrapped)
    beside = (y + _GAP // 2 + end) // 2
    parts.append(f'<line x1="{middle}" y1="{y}" x2="{middle}" y2="{end}" {_STROKE}/>')
    parts.append(_arrow(middle, beside, x, beside))
    return end


def _box(parts: list[str], x: int, y: int, width: int, lines: Sequence[str]) -> int:
    height = len(lines) * _LINE + 16
    parts.append(f'<rect x="{x}" y="{y}" width="{width}" height="{height}" {_PAPER} {_STROKE}/>')
    for number, line in enumerate(lines):
        indent = len(line) - len(line.lstrip())
        look = _HEAD if number == 0 else ""
        parts.append(_text(x + 14 + 4 * indent, y + 8 + 15 + number * _LINE, line.strip(), look))
    return y + height


def _tables(parts: list[str], flow: Flow, y: int) -> int:
    """Draw the numbers of arrangements and kinds as tables."""
    are_few = len(flow.arrangements) <= _MOST_ARRANGEMENTS
    if not are_few:
        told = f"The numbers of the {len(flow.arrangements)} arrangements of kinds are in consort.csv of the data set."
        parts.append(_text(_LEFT, y + 15, told, _SMALL))
        y += 2 * _LINE
    for experiment in sorted({key[0] for key in flow.kinds}):
        rows = [
            (f"{arrangement}/{order}: {' · '.join(flow.kinds_of[name, arrangement, order])}", counts)
            for (name, arrangement, order), counts in sorted(flow.arrangements.items())
            if name == experiment
        ]
        head = f"Experiment {experiment}: arrangement/order of layouts, and the kinds as they were shown"
        if are_few and rows:
            y = _table(parts, head, rows, y) + _LINE
        of_kinds = [(kind, counts) for (name, kind), counts in sorted(flow.kinds.items()) if name == experiment]
        y = _table(parts, f"Experiment {experiment}: kind of explanation", of_kinds, y)
        y += _LINE
    return y


def _table(parts: list[str], head: str, rows: Sequence[tuple[str, Counts]], y: int) -> int:
    width = (_WIDTH - 2 * _LEFT - _FIRST_COLUMN) // len(_COLUMNS)
    ends = [_LEFT + _FIRST_COLUMN + width * (number + 1) for number in range(len(_COLUMNS))]
    parts.append(_text(_LEFT, y + 15, head, _HEAD + _SMALL))
    y += _LINE
    parts += [_text(x, y + 15, name, _HEAD + _SMALL, anchor="end") for x, name in zip(ends, _COLUMNS, strict=True)]
    y += _LINE
    for name, counts in rows:
        lines = textwrap.wrap(name, 32, subsequent_indent="    ") or [""]
        parts.append(f'<line x1="{_LEFT}" y1="{y + 2}" x2="{_WIDTH - _LEFT}" y2="{y + 2}" {_RULE}/>')
        for number, line in enumerate(lines):
            parts.append(_text(_LEFT, y + 17 + number * _LINE, line, _SMALL))
        parts += [_text(x, y + 17, str(n), _SMALL, anchor="end") for x, n in zip(ends, _numbers(counts), strict=True)]
        y += len(lines) * _LINE
    return y


def _numbers(counts: Counts) -> Iterator[int]:
    yield counts.allocated
    yield from (counts.fates[fate] for fate in FATES)
    yield counts.excluded.total()
    yield counts.analysed


def _sentence(flow: Flow) -> str:
    counts = flow.everybody
    others = f", with {counts.included} who did not complete" if counts.included else ""
    return (
        f"{flow.scope.study}, {flow.scope.mode}: {counts.allocated} agreed and were allocated, {counts.dropped} did "
        f"not complete, {counts.fates['completed']} completed, {counts.excluded.total()} of them were excluded, "
        f"{counts.analysed} are analysed{others}."
    )


def _arrow(x1: int, y1: int, x2: int, y2: int) -> str:
    return f'<line x1="{x1}" y1="{y1}" x2="{x2}" y2="{y2}" {_STROKE} marker-end="url(#arrow)"/>'


def _text(x: int, y: int, text: str, look: str = "", *, anchor: str = "start") -> str:
    where = "" if anchor == "start" else f' text-anchor="{anchor}"'
    return f'<text x="{x}" y="{y}"{look}{where}>{_escape(text)}</text>'


def _escape(text: str) -> str:
    """Return a text for XML, which has no control characters; with one of them there would be no picture at all."""
    return escape_markup(_NOT_IN_XML.sub("", text))


_NOT_IN_XML = re.compile(r"[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
