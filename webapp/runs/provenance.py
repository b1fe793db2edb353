"""What a run's folder says of where its numbers come from: code, versions, machine."""

import hashlib
import platform
import subprocess
import sys
from collections.abc import Mapping
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

PACKAGES = (
    *("xar", "torch", "numpy", "scipy", "statsmodels", "pandas"),
    *("gymnasium", "minigrid", "joblib", "matplotlib"),
)
_SOURCE = Path(__file__).resolve().parents[1]


@cache
def code_fingerprint() -> str:
    """Return the hash of all code that a run's rows depend on."""
    digest = hashlib.sha256()
    for package in ("analysis", "bots", "explainer", "power", "rehearsal", "simulations", "study"):
        for file in sorted((_SOURCE / package).rglob("*.py")):
            digest.update(f"{file.relative_to(_SOURCE).as_posix()}\0".encode())
            digest.update(file.read_bytes())
    return digest.hexdigest()


def versions() -> Mapping[str, str]:
    """Return the versions of Python and of the packages that numbers and figures depend on."""
    found = {"python": platform.python_version()}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed"
    return found


def machine() -> Mapping[str, str]:
    """Return what last bits may depend on: the operating system and the kind of processor."""
    return {"system": platform.system(), "processor": platform.machine(), "model": _processor_model()}


def maker_of_rows() -> dict[str, str]:
    """Return what the last bits of learned rows depend on, beside the code."""
    return {"torch": version("torch"), "numpy": version("numpy"), **machine()}


def commit() -> str:
    """Return the commit of the checkout that runs, marked if its code differs from it, or `unknown` outside of one."""
    head = _git("rev-parse", "HEAD")
    if head is None:
        return "unknown"
    changed = _git("status", "--porcelain", "--", ":/webapp", ":/pyproject.toml", ":/constraints.txt")
    return f"{head} and changes that are not committed" if changed else head


def command_line() -> str:
    """Return the command that was given, as one would type it."""
    return " ".join(["xar", *sys.argv[1:]])


def _git(*arguments: str) -> str | None:
    try:
        done = subprocess.run(  # noqa: S603 - fixed arguments.
            ["git", "-C", str(_SOURCE), *arguments],  # noqa: S607 - whichever git the user has.
            check=False,
            capture_output=True,
            text=True,
            timeout=30,
        )
    except (OSError, subprocess.TimeoutExpired):
        return None
    return done.stdout.strip() if done.returncode == 0 else None


def _processor_model() -> str:
    """Return the processor's name where Linux tells it."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or "unknown"
    return next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), "unknown")
