"""Make or bring up to date the environment that `make run`, `make test` and `make check` share.

Run by any Python from 3.11 on; needs nothing but the standard library. What is installed is decided by
`pyproject.toml` and `constraints.txt`: a stamp in the environment holds their hash, and nothing happens while it
still matches. Why torch goes its own way is told in docs/decisions/0007-torch-outside-the-lock.md.

    python .ci/install.py [--browser] [--spreadsheet] [--environment FOLDER]
"""

import argparse
import hashlib
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
INPUTS = ("pyproject.toml", "constraints.txt", ".ci/install.py")
OLDEST_PYTHON = (3, 11)
OLDEST_PIP = (23, 2)
TORCH_CPU_INDEX = "https://download.pytorch.org/whl/cpu"
CHROMIUMS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
FIREFOXES = ("firefox-esr", "firefox")
# Debian's packages, and what to do where these cannot be installed.
BROWSERS = {
    "chromium": "Chromium (Debian, as root: apt-get install chromium; elsewhere: .venv/bin/playwright install "
    "chromium; or name one in XAR_CHROMIUM)",
    "firefox-esr": "Firefox (Debian, as root: apt-get install firefox-esr; elsewhere: mozilla.org has it; or name "
    "one in XAR_FIREFOX)",
    "nginx-light": "nginx (Debian, as root: apt-get install nginx-light)",
    "openssl": "openssl (Debian, as root: apt-get install openssl)",
    "strace": "strace (Debian, as root: apt-get install strace)",
    "fiu-utils": "libfiu's fiu-ctrl (Debian, as root: apt-get install fiu-utils)",
    "systemd": "systemd-analyze (Debian, as root: apt-get install systemd)",
}


class CannotInstall(Exception):
    """Something that a person has to mend; the message says how."""


def main() -> int:
    """Install what the arguments ask for and return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--environment", type=Path, default=ROOT / ".venv", help="the virtual environment's folder")
    parser.add_argument("--browser", action="store_true", help="also see to the browsers and the servers of the tests")
    parser.add_argument("--spreadsheet", action="store_true", help="also see to LibreOffice, which opens the exports")
    parser.add_argument("--postgres", action="store_true", help="also see to the database server of the tests")
    arguments = parser.parse_args()
    try:
        install(arguments.environment.resolve())
        if arguments.browser:
            install_browsers()
        if arguments.spreadsheet:
            install_spreadsheet()
        if arguments.postgres:
            install_postgres()
    except CannotInstall as problem:
        print(f"install: {problem}", file=sys.stderr)
        return 2
    return 0


def install(environment: Path) -> None:
    """Create the environment if it is missing and install the locked packages unless the stamp says they are there."""
    import tomllib  # Here, so that an older Python gets the message below and no traceback.  # noqa: PLC0415

    stamp, wanted = environment / ".installed", fingerprint()
    if stamp.is_file() and stamp.read_text(encoding="utf-8") == wanted:
        return
    if not (environment / "bin" / "python").exists():
        _create(environment)
    stamp.unlink(missing_ok=True)
    python = environment / "bin" / "python"
    _renew_pip(python)
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    _install_torch(python, settings["tool"]["uv"]["constraint-dependencies"][0])
    say("installing the locked packages")
    _pip(python, "install", "--no-deps", "--require-hashes", "-r", "constraints.txt")
    _pip(python, "install", "--no-deps", "--no-build-isolation", "--editable", ".")
    _pip(python, "check")
    stamp.write_text(wanted, encoding="utf-8")


def fingerprint() -> str:
    """Return the hash of everything that decides what is installed, the Python release included."""
    digest = hashlib.sha256(repr(sys.version_info[:2]).encode())
    for name in INPUTS:
        digest.update((ROOT / name).read_bytes())
    return digest.hexdigest()


def find_browser() -> str | None:
    """Return the path of a Chromium: `XAR_CHROMIUM`, one on the path, or one that Playwright has downloaded."""
    named = os.environ.get("XAR_CHROMIUM")
    if named:
        return named if Path(named).is_file() else None
    found = next(filter(None, map(shutil.which, CHROMIUMS)), None)
    downloads = (Path.home() / ".cache/ms-playwright", Path.home() / "Library/Caches/ms-playwright")
    patterns = ("chromium-*/chrome-linux*/chrome", "chromium-*/chrome-mac*/*.app/Contents/MacOS/*")
    downloaded = (str(path) for folder in downloads for pattern in patterns for path in sorted(folder.glob(pattern)))
    return found or next(downloaded, None)


def find_firefox() -> str | None:
    """Return the path of a Firefox: `XAR_FIREFOX`, one on the path, or a Mac's."""
    named = os.environ.get("XAR_FIREFOX")
    if named:
        return named if Path(named).is_file() else None
    on_a_mac = Path("/Applications/Firefox.app/Contents/MacOS/firefox")
    found = next(filter(None, map(shutil.which, FIREFOXES)), None)
    return found or (str(on_a_mac) if on_a_mac.is_file() else None)


def find_nginx() -> str | None:
    """Return the path of nginx, which a system may keep where only root looks."""
    return shutil.which("nginx") or shutil.which("nginx", path="/usr/sbin:/usr/local/sbin")


def install_browsers() -> None:
    """See to it that the tests find browsers and the deployment's programs, Debian's if that can be done here."""
    finders: dict[str, Callable[[], str | None]] = {
        "chromium": find_browser,
        "firefox-esr": find_firefox,
        "nginx-light": find_nginx,
        "openssl": lambda: shutil.which("openssl"),
        "strace": lambda: shutil.which("strace"),
        "fiu-utils": lambda: shutil.which("fiu-ctrl"),
        "systemd": lambda: shutil.which("systemd-analyze"),
    }
    missing = [package for package, find in finders.items() if find() is None]
    if not missing:
        return
    apt = shutil.which("apt-get")
    if apt is None or os.geteuid() != 0:
        wanted = " and ".join(BROWSERS[package] for package in missing)
        raise CannotInstall(f"the tests need {wanted}, which was not found.")
    say(f"installing {' and '.join(missing)}")
    quiet = {**os.environ, "DEBIAN_FRONTEND": "noninteractive"}
    _run([apt, "update", "-q"], environment=quiet)
    _run([apt, "install", "-y", "-q", "--no-install-recommends", *missing, "fonts-liberation"], environment=quiet)


def install_spreadsheet() -> None:
    """See to it that the tests find LibreOffice, from Debian's packages if that can be done here."""
    if shutil.which("soffice") or shutil.which("libreoffice"):
        return
    _install_from_debian(
        "libreoffice-calc-nogui",
        "the tests of the copies for spreadsheets need LibreOffice, which was not found (Debian, as root: apt-get "
        "install libreoffice-calc-nogui; elsewhere: libreoffice.org has it, with soffice on the path).",
    )


def find_postgres() -> str | None:
    """Return the folder of PostgreSQL's programs: `XAR_POSTGRES`, or one where systems put them."""
    named = os.environ.get("XAR_POSTGRES")
    if named:
        return named if (Path(named) / "initdb").is_file() else None
    patterns = ("usr/lib/postgresql/*/bin", "opt/homebrew/opt/postgresql*/bin", "usr/pgsql-*/bin")
    found = sorted(path.parent for pattern in patterns for path in Path("/").glob(f"{pattern}/initdb"))
    on_path = shutil.which("initdb")
    return str(found[-1]) if found else (str(Path(on_path).parent) if on_path else None)


def install_postgres() -> None:
    """See to it that the tests find PostgreSQL; they run a server of their own."""
    if find_postgres() is not None:
        return
    _install_from_debian(
        "postgresql",
        "the tests need PostgreSQL 13 or later (Debian, as root: apt-get install postgresql; or name the folder of "
        "its programs in XAR_POSTGRES), which was not found.",
    )


def _install_from_debian(package: str, otherwise: str) -> None:
    """Install a package of Debian's, or say what to do where that cannot be done."""
    apt = shutil.which("apt-get")
    if apt is None or os.geteuid() != 0:
        raise CannotInstall(otherwise)
    say(f"installing {package}")
    quiet = {**os.environ, "DEBIAN_FRONTEND": "noninteractive"}
    _run([apt, "update", "-q"], environment=quiet)
    _run([apt, "install", "-y", "-q", "--no-install-recommends", package], environment=quiet)


def say(line: str) -> None:
    """Print one line of progress at once."""
    print(f"install: {line}", flush=True)


def _create(environment: Path) -> None:
    say(f"making {environment.name} with Python {sys.version.split()[0]}")
    if subprocess.run([sys.executable, "-m", "venv", str(environment)], check=False).returncode != 0:
        shutil.rmtree(environment, ignore_errors=True)
        raise CannotInstall(
            "this Python cannot make virtual environments (Debian and Ubuntu keep that part in another package: "
            "apt-get install python3-venv)."
        )


def _renew_pip(python: Path) -> None:
    """Bring pip to the release from which on a lock for several platforms installs with hashes."""
    told = subprocess.run([str(python), "-m", "pip", "--version"], check=True, capture_output=True, text=True).stdout
    version = tuple(int(part) for part in told.split()[1].split(".")[:2])
    if version < OLDEST_PIP:
        _pip(python, "install", "--upgrade", f"pip>={'.'.join(map(str, OLDEST_PIP))}")


def _install_torch(python: Path, pinned: str) -> None:
    """Install torch, its processor-only build where there is one. The first attempt that succeeds ends the search."""
    version = pinned.partition("==")[2]
    asks = f"import torch, sys; sys.exit(torch.__version__.split('+')[0] != {version!r})"
    if _succeeds([str(python), "-c", asks]):
        return
    say(f"installing torch {version}")
    attempts = [
        ["--no-deps", f"torch=={version}+cpu"],
        ["--no-deps", "--index-url", TORCH_CPU_INDEX, "--retries", "1", "--timeout", "30", f"torch=={version}"],
    ]
    for options in [] if sys.platform == "darwin" else attempts:
        if _succeeds([str(python), "-m", "pip", "install", "-qq", *options]):
            return
    if sys.platform == "linux" and os.uname().machine == "x86_64":
        say("found no build of torch for processors alone; taking the one for graphics cards, several gigabytes")
    _pip(python, "install", f"torch=={version}")


def _pip(python: Path, *arguments: str) -> None:
    _run([str(python), "-m", "pip", arguments[0], "-qq", *arguments[1:]])


def _run(command: list[str], environment: dict[str, str] | None = None) -> None:
    if subprocess.run(command, cwd=ROOT, env=environment, check=False).returncode != 0:
        raise CannotInstall(f"this command failed, its own words are above: {' '.join(command)}")


def _succeeds(command: list[str]) -> bool:
    return subprocess.run(command, cwd=ROOT, check=False, capture_output=True).returncode == 0


if __name__ == "__main__":
    if sys.version_info < OLDEST_PYTHON:
        sys.exit(f"install: Python 3.11 or later is needed, and this is {sys.version.split()[0]}")
    sys.exit(main())
