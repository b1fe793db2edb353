"""The repository keeps its own promises: documents that are true, files that name nothing private, a lock that fits."""

import ast
import re
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

from tests.conftest import ROOT

FOLDERS = (".ci", "docs", "static", "templates", "tests", "webapp")
WRITTEN = {".py", ".md", ".toml", ".html", ".css", ".js", ".yaml", ".txt", ".svg", ""}
FOREIGN = ("vendor", "__pycache__", "images")
MODULES = sorted(path.relative_to(ROOT) for path in (ROOT / "webapp").rglob("*.py"))
# Put together here, so that this file does not name what it looks for.
PRIVATE = [
    re.compile(pattern)
    for pattern in (
        r"\.\./" + "shared",
        r"\.lib" + "rary",
        "/wo" + "rk/",
        "/tm" + "p/",
        "/ro" + "ot/",
        "python" + "hosted",
        r"pypi\." + "org",
        r"registry\." + "npm",
        r"deb\." + "debian",
    )
]


def read(name: str | Path) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


def written_files() -> list[Path]:
    """Return every file that somebody wrote here."""
    top = [path for path in ROOT.iterdir() if path.is_file() and path.suffix in WRITTEN]
    below = [path for folder in FOLDERS for path in (ROOT / folder).rglob("*") if path.is_file()]
    return [path for path in top + below if path.suffix in WRITTEN and not set(path.parts) & set(FOREIGN)]


def settings() -> dict[str, object]:
    found: dict[str, object] = tomllib.loads(read("pyproject.toml"))
    return found


def test_the_readme_names_the_two_commands_right_after_saying_what_this_is() -> None:
    _, paragraph, commands = read("README.md").split("\n\n")[:3]
    assert re.match(r"[A-Z].*\.$", paragraph, re.DOTALL)
    assert re.search(r"^make run\b", commands, re.MULTILINE)
    assert re.search(r"^make test\b", commands, re.MULTILINE)


def test_no_file_names_a_place_that_only_its_author_has() -> None:
    texts = {path.relative_to(ROOT): path.read_text(encoding="utf-8") for path in written_files()}
    assert [(str(path), word.pattern) for path, text in texts.items() for word in PRIVATE if word.search(text)] == []


@pytest.mark.parametrize("path", MODULES, ids=str)
def test_every_module_says_what_it_is_for(path: Path) -> None:
    docstring = ast.get_docstring(ast.parse(read(path)))
    assert docstring
    assert len(docstring.split()) > 2


@pytest.mark.parametrize("path", MODULES, ids=str)
def test_no_module_is_longer_than_one_can_read_at_a_sitting(path: Path) -> None:
    assert len(read(path).splitlines()) <= 300


def test_the_package_itself_is_a_docstring_and_nothing_else() -> None:
    body = ast.parse(read("webapp/__init__.py")).body
    assert [type(node) for node in body] == [ast.Expr]


def test_the_map_in_the_architecture_is_the_territory() -> None:
    drawn = read("ARCHITECTURE.md").split("## Where things are")[1].split("```")[1]
    folder = ""
    for line in drawn.strip().splitlines():
        indent, name = re.match(r"( *)(\S+)", line).groups()  # type: ignore[union-attr]
        folder = folder if indent else name
        path = ROOT / folder / (name if indent else "")
        assert path.exists() or name == "instance/", f"ARCHITECTURE.md names {path.relative_to(ROOT)}"


def test_every_layer_of_the_architecture_is_a_layer_of_the_check() -> None:
    contracts = settings()["tool"]["importlinter"]["contracts"]  # type: ignore[index]
    checked = {name for contract in contracts[:2] for layer in contract["layers"] for name in re.findall(r"\w+", layer)}
    drawn = read("ARCHITECTURE.md").split("## What may import what")[1].split("```")[1]
    assert set(re.findall(r"\w+", drawn.replace("inside explainer:", ""))) <= checked


@pytest.mark.parametrize("path", [path for path in written_files() if path.suffix == ".md"], ids=lambda path: path.name)
def test_every_link_in_the_documents_leads_somewhere(path: Path) -> None:
    for target in re.findall(r"\]\(([^)#]+)[^)]*\)", path.read_text(encoding="utf-8")):
        assert "://" in target or (path.parent / target).exists(), f"{path.name} links to {target}"


def test_every_command_in_the_documents_is_in_the_makefile() -> None:
    known = set(re.findall(r"^([a-z-]+):", read("Makefile"), re.MULTILINE))
    for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md"):
        assert set(re.findall(r"`?make ([a-z-]+)[` \n]", "\n".join(_code(read(name))))) <= known


def test_decisions_are_numbered_without_gaps_and_titled_with_their_number() -> None:
    paths = sorted((ROOT / "docs/decisions").glob("*.md"))
    assert [int(path.name[:4]) for path in paths] == list(range(1, len(paths) + 1))
    for path in paths:
        assert read(path).startswith(f"# {int(path.name[:4])}. ")
        assert re.findall(r"^## .*", read(path), re.MULTILINE) == ["## Question", "## Decision", "## What it costs"]


def test_the_lock_has_hashes_and_no_addresses_and_leaves_torch_out() -> None:
    lock = read("constraints.txt")
    assert "://" not in lock
    assert "--index" not in lock
    packages = re.findall(r"^([a-z0-9-]+)==", lock, re.MULTILINE)
    assert not {"torch", "triton"} & set(packages)
    assert not [name for name in packages if name.startswith(("nvidia", "cuda"))]
    entries = re.split(r"\n(?=\S)", lock.strip())
    assert all("--hash=sha256:" in entry for entry in entries)


def test_every_floor_is_the_version_that_is_locked_and_so_tested() -> None:
    project = settings()["project"]
    assert isinstance(project, dict)
    asked = [*project["dependencies"], *(line for extra in project["optional-dependencies"].values() for line in extra)]
    pinned = settings()["tool"]["uv"]["constraint-dependencies"]  # type: ignore[index]
    locked = re.findall(r"^([a-z0-9-]+)==([\d.]+)", "\n".join([read("constraints.txt"), *pinned]), re.MULTILINE)
    for requirement in asked:
        name, floor = re.match(r"([a-z0-9-]+)(?:\[[a-z,]+\])?>=([\d.]+)", requirement).groups()  # type: ignore[union-attr]
        oldest = min((version for known, version in locked if known == name), key=_numbers)
        assert _numbers(oldest)[: len(_numbers(floor))] == _numbers(floor), f"{requirement} was tested at {oldest}"


def test_the_wheel_holds_every_file_that_the_program_reads(tmp_path: Path) -> None:
    hatchling = str(Path(sys.executable).with_name("hatchling"))
    subprocess.run([hatchling, "build", "-t", "wheel", "-d", str(tmp_path)], cwd=ROOT, check=True, capture_output=True)
    packed = set(zipfile.ZipFile(next(tmp_path.glob("*.whl"))).namelist())
    inside = {str(path.relative_to(ROOT)) for path in _files("webapp")}
    beside = {f"webapp/{path.relative_to(ROOT)}" for folder in ("templates", "static") for path in _files(folder)}
    assert inside | beside <= packed


def test_what_a_run_leaves_behind_is_ignored_by_git() -> None:
    ignored = read(".gitignore").split()
    assert {"/instance/", "/.venv/", "/test-results/", "__pycache__/"} <= set(ignored)


def test_no_test_is_skipped_and_nothing_is_left_to_do() -> None:
    marks = re.compile(
        r"\b(TO" + r"DO|FIX" + r"ME|XX" + r"X)\b|mark\.(sk" + r"ip|xf" + r"ail)|pytest\.(sk" + r"ip|importorsk" + "ip)"
    )
    found = [path for path in written_files() if path.suffix in {".py", ".html", ".js", ".css"}]
    assert [str(path.relative_to(ROOT)) for path in found if marks.search(path.read_text(encoding="utf-8"))] == []


def test_the_installer_says_so_when_python_is_too_old_for_it() -> None:
    tree = ast.parse(read(".ci/install.py"))
    imported = {name.name for node in tree.body if isinstance(node, ast.Import) for name in node.names}
    assert "tomllib" not in imported
    assert ast.parse(read(".ci/install.py"), feature_version=(3, 8))


def test_make_help_lists_every_command() -> None:
    shown = subprocess.run(["make", "help"], cwd=ROOT, check=True, capture_output=True, text=True).stdout  # noqa: S607
    listed = set(re.findall(r"^make (\S+)", shown, re.MULTILINE))
    assert {"run", "test", "check", "bench", "soak", "clean", "help"} <= listed


def _files(folder: str) -> list[Path]:
    return [path for path in (ROOT / folder).rglob("*") if path.is_file() and "__pycache__" not in path.parts]


def _code(text: str) -> list[str]:
    return re.findall(r"`[^`]+`", text.replace("```", "\x00").replace("\x00", "`"))


def _numbers(version: str) -> tuple[int, ...]:
    return tuple(int(part) for part in version.split("."))
