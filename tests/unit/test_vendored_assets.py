"""Files of other projects are exactly those of the release that their manifest names, each with its licence."""

import base64
import hashlib
import json
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
FOLDERS = ("tests/vendor",)


def packages(folder: str) -> list[dict[str, Any]]:
    manifest = json.loads((ROOT / folder / "manifest.json").read_text(encoding="utf-8"))
    found: list[dict[str, Any]] = manifest["packages"]
    return found


def sha512(path: Path) -> str:
    return "sha512-" + base64.b64encode(hashlib.sha512(path.read_bytes()).digest()).decode("ascii")


@pytest.mark.parametrize("folder", FOLDERS)
def test_every_vendored_file_is_listed_with_its_hash(folder: str) -> None:
    listed = {
        f"{package['name']}/{name}": digest for package in packages(folder) for name, digest in package["files"].items()
    }
    paths = (path for path in (ROOT / folder).rglob("*") if path.is_file() and path.name != "manifest.json")
    assert {path.relative_to(ROOT / folder).as_posix(): sha512(path) for path in paths} == listed


@pytest.mark.parametrize("folder", FOLDERS)
def test_every_package_names_its_release_and_brings_its_licence(folder: str) -> None:
    for package in packages(folder):
        assert package["source"] == f"npm pack {package['name']}@{package['version']}"
        assert len(base64.b64decode(package["tarball"].removeprefix("sha512-"), validate=True)) == 64
        assert package["licence_file"] in package["files"]
        licence = (ROOT / folder / package["name"] / package["licence_file"]).read_text(encoding="utf-8")
        assert {"MIT": "MIT", "MPL-2.0": "Mozilla Public License"}[package["licence"]] in licence
