"""Windows in which hostile texts are looked for: nothing may run, open, become an element or meet the page's policy."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from playwright.sync_api import BrowserContext, Dialog, Page

from tests.security.payloads import as_read, shown

REFUSED = (
    "403 http://127",
    "400 http://127",
    "404 http://127",
    "422 http://127",
    "409 http://127",
    "Failed to load resource",
)
"""What hostile addresses are answered with."""

COUNT_HITS = "window.hits = 0; window.hit = () => { window.hits += 1; };"

READ = """documents => {
    const texts = [];
    let marked = 0;
    const read = (root) => {
        for (const element of root.querySelectorAll("*")) {
            marked += element.hasAttribute("data-xss");
            texts.push(...Array.from(element.attributes, (attribute) => attribute.value));
            for (const node of element.childNodes) if (node.nodeType === 3) texts.push(node.data);
            if (typeof element.value === "string") texts.push(element.value);
            if (element.localName === "template") read(element.content);
        }
    };
    if (documents === null) read(document);
    for (const html of documents ?? []) read(new DOMParser().parseFromString(html, "text/html"));
    return {marked, hits: window.hits ?? 0, text: texts.join("\\n\\n")};
}"""

FETCH = """async (paths) => {
    const answers = [];
    const next = async () => {
        while (paths.length) {
            const response = await fetch(paths.pop());
            answers.push([response.status, await response.text()]);
        }
    };
    await Promise.all(Array.from({length: 6}, next));
    return answers;
}"""

SEND_FILES = """async ([path, field, files]) => {
    const answers = Array(files.length);
    const places = [...files.keys()];
    const next = async () => {
        while (places.length) {
            const place = places.pop();
            const [content, name] = files[place];
            const form = new FormData();
            form.append(field, new File([new Uint8Array(content)], name, {type: "text/csv"}));
            const response = await fetch(path, {method: "POST", body: form});
            answers[place] = [response.status, await response.text()];
        }
    };
    await Promise.all(Array.from({length: 6}, next));
    return answers;
}"""


def listen(context: BrowserContext) -> list[str]:
    """Collect the dialogs that open."""
    dialogs: list[str] = []
    context.add_init_script(COUNT_HITS)

    def close(dialog: Dialog) -> None:
        dialogs.append(dialog.message)
        dialog.dismiss()

    context.on("dialog", close)
    return dialogs


def read(page: Page, documents: Sequence[str] | None = None) -> Mapping[str, Any]:
    """Read the open page, or documents as this browser would parse them."""
    found: Mapping[str, Any] = page.evaluate(READ, documents)
    return found


def texts_of(page: Page, documents: Sequence[str] | None = None) -> str:
    """Return all that stands on a page, on which nothing hostile may have come to life."""
    found = read(page, documents)
    assert (found["marked"], found["hits"]) == (0, 0), page.url
    return shown(found["text"])


def missing(payloads: Iterable[str], text: str) -> list[str]:
    """Return the payloads that are not shown as they were written."""
    return [payload for payload in payloads if shown(as_read(payload)) not in text]
