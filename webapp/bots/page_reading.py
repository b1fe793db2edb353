"""From a page's HTML to what a browser without scripts knows of it: its kind, and its forms with their controls."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from html.parser import HTMLParser


@dataclass(slots=True)
class Form:
    """A form.

    Attributes:
        action: Where it is sent.
        hidden: The hidden fields with their values, in the order of the page as all that follow.
        choices: By field, the values to choose one from.
        boxes: By field, the value of a box that may be ticked.
        texts: The fields to write into.
        buttons: The names and values of the buttons that have a name.
    """

    action: str
    hidden: dict[str, str] = field(default_factory=dict)
    choices: dict[str, list[str]] = field(default_factory=dict)
    boxes: dict[str, str] = field(default_factory=dict)
    texts: list[str] = field(default_factory=list)
    buttons: list[tuple[str, str]] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class ShownPage:
    """A page as it came.

    Attributes:
        path: The path of its address.
        kind: What stands on it, `data-page` of the body; empty outside the study.
        forms: Its forms.
    """

    path: str
    kind: str
    forms: tuple[Form, ...]

    def form_to(self, action: str) -> Form | None:
        """Return the form that is sent to a path, or None."""
        return next((form for form in self.forms if form.action == action), None)


def read_page(path: str, html: str) -> ShownPage:
    """Read a page."""
    reader = _Reader()
    reader.feed(html)
    reader.close()
    return ShownPage(path, reader.kind, tuple(reader.forms))


class _Reader(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.kind = ""
        self.forms: list[Form] = []
        self._is_within = False

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        attributes = {name: value or "" for name, value in attrs}
        if tag == "body":
            self.kind = attributes.get("data-page", "")
        elif tag == "form":
            self.forms.append(Form(attributes.get("action", "")))
            self._is_within = True
        elif self._is_within and attributes.get("name"):
            _add(self.forms[-1], tag, attributes)

    def handle_endtag(self, tag: str) -> None:
        if tag == "form":
            self._is_within = False


def _add(form: Form, tag: str, attributes: Mapping[str, str]) -> None:
    name, value = attributes["name"], attributes.get("value", "")
    match tag, attributes.get("type", "text"):
        case "input", "hidden":
            form.hidden[name] = value
        case "input", "radio":
            form.choices.setdefault(name, []).append(value)
        case "input", "checkbox":
            form.boxes[name] = value
        case (("input" | "textarea"), _):
            form.texts.append(name)
        case "button", _:
            form.buttons.append((name, value))
