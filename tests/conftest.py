"""What tests of several parts share."""

import fcntl
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

from tests import postgres
from webapp.explainer.worlds.layout import Layout, parse_layout
from webapp.stimuli.agents import planner_agents
from webapp.stimuli.build import build
from webapp.stimuli.catalogue import Catalogue, current_bundle

os.environ["OMP_NUM_THREADS"] = "1"  # Several threads per worker would only get in each other's way.

# A busy machine is no reason to fail, nor is it that many random worlds have no way to the goal and are drawn anew.
settings.register_profile(
    "patient", deadline=None, suppress_health_check=[HealthCheck.filter_too_much, HealthCheck.too_slow]
)
settings.load_profile("patient")

ROOT = Path(__file__).resolve().parent.parent
XAR = Path(sys.executable).with_name("xar")


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Name a failed test at once where the run is seen, in case the run does not live to its summary."""
    if report.failed and "PYTEST_XDIST_WORKER" not in os.environ:
        reason = report.longreprtext.strip().splitlines()[-1:] or [""]
        print(f"\nFAILED {report.nodeid} ({report.when}, {report.duration:.0f} s): {reason[0]}", flush=True)  # noqa: T201


@pytest.fixture(scope="session")
def root() -> Path:
    """The folder of the repository."""
    return ROOT


@pytest.fixture(scope="session")
def layouts() -> dict[str, Layout]:
    """The six maps of the default study by name."""
    paths = sorted((ROOT / "webapp/studies/sakai2021/layouts").glob("*.txt"))
    return {path.stem: parse_layout(path.read_text(encoding="utf-8"), path.name) for path in paths}


@pytest.fixture(scope="session")
def built_instance(pytestconfig: pytest.Config) -> Path:
    """An instance in which the default study is built; nobody serves it or writes to it.

    Kept between test runs: `xar build` builds anew whenever something has changed that the bundle depends on. All
    workers of a run share it, and the first to ask builds.
    """
    folder = pytestconfig.cache.mkdir("instance")
    with locked(folder / "tests.lock"):
        finished = subprocess.run(
            [XAR, "build", "sakai2021"],
            env={**os.environ, "XAR_INSTANCE": str(folder)},
            check=False,
            capture_output=True,
            text=True,
        )
    assert finished.returncode == 0, finished.stderr
    return folder


@pytest.fixture(scope="session")
def planned_instance(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An instance with a bundle of the default study in which the planner takes the learned agents' place.

    It takes seconds and is real in everything else. Nobody serves it or writes to it; copy it for that.
    """
    folder = tmp_path_factory.mktemp("planned") / "instance"
    build(ROOT / "webapp/studies/sakai2021", folder, progress=lambda *_: None, agents=planner_agents)
    return folder


@pytest.fixture(scope="session")
def bundle(planned_instance: Path) -> Catalogue:
    """The bundle of `planned_instance`, open."""
    return Catalogue.open(current_bundle(planned_instance, "sakai2021"))


@pytest.fixture(scope="session")
def postgres_server() -> Iterator[postgres.Server]:
    """A PostgreSQL server of this worker's own."""
    with postgres.a_server() as server:
        yield server


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Hold a lock file against the other workers of the run."""
    with path.open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield
