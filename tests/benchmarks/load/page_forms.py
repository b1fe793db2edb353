"""The form of a page, whoever made the page: read from its HTML and filled in at random."""

import random
import re
from dataclasses import dataclass

_FORM = re.compile(r"<form\b([^>]*)>(.*?)</form>", re.DOTALL)
_INPUT = re.compile(r"<input\b([^>]*)>")
_ATTRIBUTE = re.compile(r'([\w-]+)="([^"]*)"')
_PICTURE = re.compile(r'<img\b[^>]*?\bsrc="([^"]+\.png)"')


@dataclass(frozen=True, slots=True)
class PageForm:
    """What can be sent from a page.

    Attributes:
        action: Where to send it; empty for the page's own address.
        hidden: Fields that are sent as they are.
        boxes: Boxes that can be ticked, with their values.
        choices: By field, the values of the radio buttons.
    """

    action: str
    hidden: dict[str, str]
    boxes: dict[str, str]
    choices: dict[str, list[str]]

    def filled(self, rng: random.Random) -> tuple[dict[str, str], dict[str, str]]:
        """Tick every box and choose at random; return the whole form, and the chosen values alone."""
        chosen = {name: rng.choice(values) for name, values in self.choices.items()}
        return {**self.hidden, **self.boxes, **chosen}, chosen


def find_form(page: str) -> PageForm | None:
    """Return the form of a page that is sent by POST, or None if it has none."""
    for attributes, inside in _FORM.findall(page):
        of_form = dict(_ATTRIBUTE.findall(attributes))
        if of_form.get("method", "").lower() == "post":
            return _read(of_form.get("action", ""), inside)
    return None


def find_pictures(page: str) -> list[str]:
    """Return the addresses of a page's PNG pictures, each once."""
    return list(dict.fromkeys(_PICTURE.findall(page)))


def _read(action: str, inside: str) -> PageForm:
    form = PageForm(action, {}, {}, {})
    for attributes in _INPUT.findall(inside):
        of_input = dict(_ATTRIBUTE.findall(attributes))
        name, value = of_input.get("name"), of_input.get("value", "")
        if name is None:
            continue
        kind = of_input.get("type", "text")
        if kind == "radio":
            form.choices.setdefault(name, []).append(value)
        elif kind == "checkbox":
            form.boxes[name] = value
        elif kind == "hidden":
            form.hidden[name] = value
    return form
