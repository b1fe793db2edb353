"""What the images hold, and the bill of materials that says so."""

import json
import re
import subprocess
import sys
import tomllib
from collections.abc import Mapping
from importlib.metadata import requires
from typing import Any

from cyclonedx.schema import SchemaVersion
from cyclonedx.validation.json import JsonStrictValidator
from packaging.requirements import Requirement
from ruamel.yaml import YAML

from tests.conftest import ROOT

DEPLOY = ROOT / "deploy"


def compose(name: str) -> Mapping[str, Any]:
    loaded: Mapping[str, Any] = YAML(typ="safe").load(DEPLOY / name)
    return loaded


def test_images_run_as_nobody_and_torch_is_in_the_one_that_trains() -> None:
    _, packages, serve, build = re.split(r"(?m)^FROM ", (DEPLOY / "Dockerfile").read_text(encoding="utf-8"))
    for stage in (serve, build):
        assert re.findall(r"(?m)^USER (.*)", stage)[-1] == "10001:10001"
    assert "torch" not in packages.lower()
    assert "torch" not in serve.lower()
    pinned = settings()["tool"]["uv"]["constraint-dependencies"][0].partition("==")[2]
    assert re.findall(r"TORCH_VERSION=(\S+)", build) == [pinned]
    assert f" torch=={pinned}\n" in (ROOT / "docs/deploying-systemd.md").read_text(encoding="utf-8")


def test_the_image_dumps_with_the_programs_of_the_database_that_is_served() -> None:
    served = compose("compose.yaml")["services"]["database"]["image"].partition(":")[2]
    image = (DEPLOY / "Dockerfile").read_text(encoding="utf-8").partition(" AS serve")[2]
    assert f'"postgresql-client-{served}={served}.*"' in image
    assert f":/usr/lib/postgresql/{served}/bin:" in image


def test_what_the_dockerfile_copies_is_let_in_and_nothing_else() -> None:
    dockerfile = (DEPLOY / "Dockerfile").read_text(encoding="utf-8")
    copied = {source for line in re.findall(r"(?m)^COPY (?!--from)(.*)", dockerfile) for source in _sources(line)}
    ignored = (ROOT / ".dockerignore").read_text(encoding="utf-8").splitlines()
    allowed = {line[1:] for line in ignored if line.startswith("!")}
    assert ignored[1] == "*"
    assert all((ROOT / name).exists() for name in copied)
    assert {"deploy/docker" if name.startswith("deploy/docker/") else name for name in copied} == allowed


def test_the_image_gets_the_locked_packages_that_the_program_needs_and_no_others() -> None:
    locked, for_image = (_entries(name) for name in ("constraints.txt", "deploy/requirements.txt"))
    assert {name: locked[name] for name in for_image} == for_image
    needed = _closure(settings()["project"]["dependencies"])
    assert needed - {"torch"} - set(for_image) == set()
    # Others are for other platforms, or for torch, which stays out of the lock but not of the build.
    elsewhere = set(for_image) - needed
    assert all("sys_platform" in for_image[name] or "platform" in for_image[name] for name in elsewhere)


def test_the_bill_of_materials_lists_the_packages_of_the_image_and_torch_and_is_made_anew_by_the_byte() -> None:
    text = (ROOT / "docs/sbom.cdx.json").read_text(encoding="utf-8")
    assert JsonStrictValidator(SchemaVersion.V1_6).validate_str(text) is None
    bill = json.loads(text)
    listed = {component["name"]: component["version"] for component in bill["components"]}
    locked = {name: entry.split()[0] for name, entry in _entries("deploy/requirements.txt").items()}
    assert listed.pop("torch") == settings()["tool"]["uv"]["constraint-dependencies"][0].partition("==")[2]
    assert listed == locked
    assert "serialNumber" not in bill
    assert "timestamp" not in bill["metadata"]
    done = subprocess.run(
        [sys.executable, ROOT / ".ci/sbom.py", "--check"], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")


def settings() -> Mapping[str, Any]:
    return tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def _sources(line: str) -> list[str]:
    return [word for word in line.split()[:-1] if not word.startswith("--")]


def _entries(name: str) -> Mapping[str, str]:
    """Return each package's lines of a lock, hashes included, by its name."""
    entries = re.split(r"\n(?=\S)", (ROOT / name).read_text(encoding="utf-8").strip())
    return {entry.partition("==")[0].partition("[")[0]: entry.partition("==")[2] for entry in entries}


def _closure(wanted: list[str]) -> set[str]:
    """Return what requirements need here, and what that needs, by their names in the lock."""
    needed: set[str] = set()
    waiting = [Requirement(line) for line in wanted]
    while waiting:
        requirement = waiting.pop()
        name = re.sub(r"[-_.]+", "-", requirement.name).lower()
        if name in needed:
            continue
        needed.add(name)
        for line in map(Requirement, requires(name) or []):
            extras = requirement.extras or {""}
            if line.marker is None or any(line.marker.evaluate({"extra": extra}) for extra in extras):
                waiting.append(line)
    return needed - {name for name in needed if name.startswith(("cuda-", "nvidia-", "triton"))}
