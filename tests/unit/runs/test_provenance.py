"""What a run says of where its numbers come from."""

import re
import subprocess

from tests.conftest import ROOT
from webapp.runs import provenance


def test_the_commit_is_the_checkout_s_and_says_whether_the_code_differs_from_it() -> None:
    head = subprocess.run(
        ["git", "-C", str(ROOT), "rev-parse", "HEAD"],  # noqa: S607 - whichever git there is.
        check=True,
        capture_output=True,
        text=True,
    ).stdout.strip()
    assert provenance.commit() in {head, f"{head} and changes that are not committed"}


def test_the_code_has_one_fingerprint() -> None:
    assert re.fullmatch(r"[0-9a-f]{64}", provenance.code_fingerprint())
    assert provenance.code_fingerprint() == provenance.code_fingerprint()


def test_every_package_that_numbers_depend_on_is_named_with_its_version() -> None:
    found = provenance.versions()
    assert set(found) == {"python", *provenance.PACKAGES}
    assert all(re.match(r"\d", version) for version in found.values())


def test_the_machine_is_described_without_its_name() -> None:
    assert set(provenance.machine()) == {"system", "processor", "model"}
    assert all(provenance.machine().values())
