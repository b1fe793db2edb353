"""What the code may not do, and what templates and scripts may not hold."""

import ast
import re
from functools import cache
from pathlib import Path

import pytest

from tests.conftest import ROOT
from tests.security.static_rules import BAD, EVERYWHERE, OF_THE_SERVER, Rule

MODULES = sorted((ROOT / "webapp").rglob("*.py"))
OF_SERVER = [path for path in MODULES if {"views", "storage"} & set(path.parts) or path.name in {"app.py", "config.py"}]
TEMPLATES = sorted((ROOT / "templates").rglob("*.html"))
SCRIPTS = sorted(path for path in (ROOT / "static").rglob("*.js") if "vendor" not in path.parts)

ALLOWED = {
    # The statements are put together from names and numbers that stand in the program or that the database gives.
    ("written_sql", "webapp/storage/sqlite_edition.py"),
    ("written_sql", "webapp/storage/postgres_"),
    ("written_sql", "webapp/storage/backups.py"),
    ("written_sql", "webapp/storage/health.py"),
    ("written_sql", "webapp/storage/migrations"),
    # It only writes: the bytes are compared and never read back, which the next test sees to.
    ("serialisers", "webapp/explainer/worlds/stepped_worlds.py"),
}
"""What a rule finds and may stay, with the reason."""

_UNQUOTED = re.compile(r"<[a-z][^<>]*\s[a-z-]+=(?!\")[^\s\"'>]*\{\{")
_SINKS = re.compile(
    r"\b(innerHTML|outerHTML\s*=[^=]|insertAdjacentHTML|document\.write|eval|Function|setAttribute\(\s*[\"']on|postMessage|"
    r"localStorage|sessionStorage|indexedDB|document\.cookie|__proto__|importScripts)\b"
)


@cache
def _tree(path: Path) -> ast.AST:
    """Return the syntax tree of a module, which is read once for all rules."""
    return ast.parse(path.read_text(encoding="utf-8"))


def found(rule: Rule, paths: list[Path]) -> list[str]:
    places = []
    for path in paths:
        name = path.relative_to(ROOT).as_posix()
        lines = list(rule(_tree(path)))
        if not any(rule.__name__ == allowed and name.startswith(where) for allowed, where in ALLOWED):
            places += [f"{name}:{line}" for line in lines]
    return places


@pytest.mark.parametrize("name", EVERYWHERE)
def test_no_module_does(name: str) -> None:
    assert found(EVERYWHERE[name], MODULES) == []


def test_nothing_is_read_back_from_a_pickle() -> None:
    text = "\n".join(path.read_text(encoding="utf-8") for path in MODULES)
    assert set(re.findall(r"\bpickle\.(\w+)", text)) <= {"dumps", "PicklingError"}


@pytest.mark.parametrize("name", OF_THE_SERVER)
def test_no_module_of_the_server_does(name: str) -> None:
    assert len(OF_SERVER) > 50
    assert found(OF_THE_SERVER[name], OF_SERVER) == []


@pytest.mark.parametrize(("name", "sample"), [(name, sample) for name, samples in BAD.items() for sample in samples])
def test_each_rule_finds_what_it_forbids(name: str, sample: str) -> None:
    """The control."""
    rule = {**EVERYWHERE, **OF_THE_SERVER}[name]
    assert list(rule(ast.parse(sample))) == [1]


@pytest.mark.parametrize("name", EVERYWHERE)
def test_no_rule_finds_what_is_allowed(name: str) -> None:
    good = (
        "torch.load(path, weights_only=True)\nnp.load(path)\nMarkup('<b>{}</b>').format(text)\nimport json\n"
        "hmac.compare_digest(token, other)\nhashlib.sha256(x)\nsubprocess.run([x])\nquery(table.c.token_hash == token)"
    )
    assert list(EVERYWHERE[name](ast.parse(good))) == []


@pytest.mark.parametrize("path", TEMPLATES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_every_attribute_that_is_filled_in_is_quoted(path: Path) -> None:
    text = re.sub(r"\{#.*?#\}|\{%.*?%\}", "", path.read_text(encoding="utf-8"), flags=re.DOTALL)
    assert _UNQUOTED.findall(text) == []


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: path.name)
def test_no_script_writes_html_or_keeps_anything(path: Path) -> None:
    found_here = {match[0] for match in _SINKS.finditer(path.read_text(encoding="utf-8"))}
    # What was measured on a page that is not sent yet, under the page's nonce and until it is sent.
    assert found_here <= ({"sessionStorage"} if path.name == "kept.js" else set())


def test_templates_and_scripts_are_read_and_faults_in_them_found() -> None:
    assert len(TEMPLATES) > 20
    assert len(SCRIPTS) > 5
    assert _UNQUOTED.search("<input value={{ typed }}>")
    assert not _UNQUOTED.search('<input value="{{ typed }}">')
    for bad in ("x.innerHTML = y", "x.outerHTML = y", "eval(x)", "document.cookie", "localStorage.x", "a.__proto__"):
        assert _SINKS.search(bad)


def test_every_password_field_hides_it_and_lets_password_managers_help() -> None:
    fields = [
        field
        for path in TEMPLATES
        for field in re.findall(r"<input[^>]*name=\"password\"[^>]*>", path.read_text(encoding="utf-8"))
    ]
    assert len(fields) >= 3
    for field in fields:
        assert 'type="password"' in field
        assert 'autocomplete="current-password"' in field
        assert "onpaste" not in field
