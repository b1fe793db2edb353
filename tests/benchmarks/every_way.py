"""Take part in every way: each kind of explanation, on both sizes, in both languages, with scripts and without.

`make test` goes through pairs of these choices; this goes through all 96 combinations, and each participant's files
have to hold exactly what was done.

    python -m tests.benchmarks.every_way [--kind KIND ...]
"""

import argparse
import os
import runpy
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from playwright.sync_api import sync_playwright

from tests.browser import test_every_kind
from tests.browser.arms import serve_arm
from tests.conftest import ROOT


def main(arguments: Sequence[str] | None = None) -> int:
    """Go through all combinations; return 1 if one went wrong."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kind", nargs="*", choices=test_every_kind.KINDS, default=test_every_kind.KINDS)
    kinds = parser.parse_args(arguments).kind
    path = runpy.run_path(str(ROOT / ".ci/install.py"))["find_browser"]()
    sandbox = ["--no-sandbox"] if os.geteuid() == 0 else []
    num_wrong = 0
    with sync_playwright() as playwright, tempfile.TemporaryDirectory() as folder:
        browser = playwright.chromium.launch(executable_path=path, args=sandbox)
        for kind in kinds:
            with serve_arm(Path(folder) / kind, kind) as site:
                for seed, way in enumerate(test_every_kind.ALL_WAYS):
                    name = f"{kind}, {'phone' if way.phone else 'desktop'}, {way.language}, scripts {way.scripts}"
                    try:
                        run = test_every_kind.take_part(browser, site, kind, way, seed)
                        test_every_kind.assert_files(kind, site, run)
                    except Exception as error:  # One that goes wrong is counted, and the others run.
                        num_wrong += 1
                        print(f"WRONG  {name}: {error!r}")
                    else:
                        print(f"right  {name}")
        browser.close()
    print(f"{len(kinds) * len(test_every_kind.ALL_WAYS)} ways, {num_wrong} wrong")
    return 1 if num_wrong else 0


if __name__ == "__main__":
    sys.exit(main())
