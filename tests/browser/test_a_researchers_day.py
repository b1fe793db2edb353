"""A researcher who did not write this program: from an idea to a data set that others can verify.

Everything is done as a person would: files are edited, verbs are typed, the dashboard is clicked.
"""

import csv
import hashlib
import json
import re
import shutil
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from tests.browser.axe import assert_accessible
from tests.browser.researcher import sign_in
from tests.browser.site import RESEARCHER, Site
from tests.browser.windows import DESKTOP, OpenContext
from tests.conftest import ROOT
from tests.web.servers import run, serving
from webapp.stimuli.catalogue import Catalogue
from webapp.stimuli.publication import published_bundle

NAME = "ferry-study"
EXAMPLE = ROOT / "docs" / "examples" / "own_world"
REASON = "told us that a flatmate answered"
MIX = "attentive=36,straight-liner=6,random=6,drop-out=6,double-clicker=6"

EXPERIMENT = """
[[experiments]]
id = "1"
situation = "current_view"
layouts = ["experiment1-a", "strait", "sea"]
kinds = ["subgoals", "random", "turns", "evenly_spaced"]
drive = {}

[[experiments.items]]
id = "trust"
points = 7

[[experiments.items]]
id = "general"
points = 5

[quality]
min_seconds_per_rating_page = 0.5
straight_lining = true

[worlds.strait]
use = "own_world:Ferry"

[worlds.sea]
use = "own_world:Ferry"
options = { length = 9 }

[kinds.turns]
use = "own_world:turns"

[analysis]
plan = "analysis_plan.md"
"""
"""What stands in place of the template's experiments: another item, more arms, worlds of the researcher's own."""

TEXTS = """
[actions]
west = "sail west"
east = "sail east"
load = "load the cargo"

[items]
trust = "Would you trust this agent?"
general = "Comprehensive evaluation of explanation"

[scales.trust]
low = "Not at all"
high = "Completely"
"""


def xar(instance: Path, *words: str) -> subprocess.CompletedProcess[str]:
    done = run(instance, *words)
    assert done.returncode == 0, done.stdout + done.stderr
    return done


@pytest.fixture(scope="module")
def instance(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("day") / "instance"


@pytest.fixture(scope="module")
def folder(instance: Path) -> Path:
    """The study as the researcher leaves it, after the mistakes that the check tells about."""
    folder = instance.parent / NAME
    xar(instance, "study", "new", NAME, "--into", str(instance.parent))
    assert "its files can be used" in xar(instance, "study", "check", str(folder)).stdout
    _edit(folder / "study.toml", folder / "texts" / "en.toml")
    (folder / "analysis_plan.md").write_text("Mixed model of `trust` by kind.\n", encoding="utf-8")
    refused = run(instance, "study", "check", str(folder))
    assert refused.returncode == 2
    assert "own_world" in refused.stderr, "the module is still missing, and the check says so"
    shutil.copy(EXAMPLE / "own_world.py", folder)
    return folder


def _edit(study: Path, texts: Path) -> None:
    text = study.read_text(encoding="utf-8")
    beginning = text[: text.index("# Experiment 1 (section 6.1)")].replace("\n[ask]\n", "\n")
    beginning = re.sub(
        r"layouts = \[.*?\]", 'layouts = ["experiment1-a", "strait", "sea"]', beginning, count=1, flags=re.DOTALL
    )
    for name, value in {
        "contact": "A, a@example.org",
        "ethics_approval": "C 1",
        "retention_until": "2035-12-31",
    }.items():
        beginning = re.sub(rf'^{name} = "<.*>"', f'{name} = "{value}"', beginning, flags=re.MULTILINE)
    beginning = beginning.replace('languages = ["en", "ja"]', 'languages = ["en"]')
    study.write_text(beginning + EXPERIMENT, encoding="utf-8")
    words = texts.read_text(encoding="utf-8")
    start, end = words.index("[items]\n"), words.index("[done]\n")
    scale = words[words.index("[scales.general]") : end]
    texts.write_text(words[:start] + TEXTS.lstrip() + "\n" + scale + words[end:], encoding="utf-8")


@pytest.fixture(scope="module")
def version(instance: Path, folder: Path) -> str:
    """The published version."""
    checked = xar(instance, "study", "check", str(folder)).stdout
    assert "turns" in checked
    assert "evenly_spaced" in checked
    published = xar(instance, "study", "publish", str(folder), "--note", "for the main study").stdout
    found = re.search(r"[0-9a-f]{64}", published)
    assert found is not None, published
    again = xar(instance, "study", "publish", str(folder)).stdout
    assert found[0] in again
    return found[0]


@pytest.fixture(scope="module")
def site(instance: Path, version: str) -> Iterator[Site]:
    """The live study."""
    password = xar(instance, "admin", "create", RESEARCHER, "--generate-password").stdout.split()[-1]
    catalogue = Catalogue.open(published_bundle(instance, NAME))
    assert catalogue.version == version
    with serving(instance, "--study", NAME, "--live") as server:
        yield Site(f"http://127.0.0.1:{server.port}", instance, password, catalogue)
        assert server.stop(signal.SIGINT) == (0, "")


@pytest.fixture(scope="module")
def bots(site: Site) -> dict[str, object]:
    """What sixty bots did, by behaviour."""
    told = xar(
        site.instance,
        *("bots", "--study", NAME, "--participants", "60", "--mix", MIX, "--effect", "turns=1.5", "--seed", "3"),
        *("--pace", "0.02", "--json"),
    )
    found: dict[str, object] = json.loads(told.stdout)
    return found


@pytest.fixture
def page(site: Site, open_context: OpenContext) -> Iterator[Page]:
    """The dashboard, signed in, at the bots."""
    page = open_context(expected=("404",), **DESKTOP).new_page()
    sign_in(page, site)
    page.goto("/researcher/?mode=bot")
    yield page
    page.close()


def test_a_version_is_published_once_and_a_changed_study_is_another(instance: Path, folder: Path, version: str) -> None:
    again = xar(instance, "study", "publish", str(folder)).stdout
    assert version[:12] in again
    verified = xar(instance, "study", "verify", NAME).stdout
    assert "reproduced" in verified


def test_bots_take_part_and_nothing_is_lost(bots: dict[str, object]) -> None:
    assert (bots["lost"], bots["doubled"]) == ([], [])


@pytest.mark.usefixtures("bots")
def test_the_dashboard_follows_them_with_masked_arms(page: Page) -> None:
    tile = page.locator("[data-count=arrived]")
    expect(tile).to_have_text("60")
    for name in ("Overview", "People", "Allocation", "Quality", "Results", "Records"):
        page.get_by_role("navigation", name="Dashboard").get_by_role("link", name=name, exact=True).click()
        page.get_by_role("heading", level=1).wait_for()
        for kind in ("evenly spaced", "evenly_spaced", ">turns<", ">subgoals<"):
            assert kind not in page.content().lower(), f"{name} tells the kind {kind}"
    page.goto("/researcher/quality?mode=bot")
    expect(page.get_by_role("main")).to_contain_text("straight-lining")


@pytest.mark.usefixtures("bots")
def test_an_owner_unblinds_and_finds_the_planted_effect(page: Page, site: Site) -> None:
    page.goto("/researcher/unblind?mode=bot")
    page.get_by_label("Reason").fill("the dry run is over")
    page.get_by_label("Your password").fill(site.password)
    page.get_by_role("button", name="Unblind me").click()
    page.goto("/researcher/results?mode=bot")
    expect(page.get_by_role("main")).to_contain_text("turns")
    assert_accessible(page, "results")


@pytest.mark.usefixtures("bots")
def test_the_export_is_whole_and_the_log_holds(instance: Path, tmp_path: Path) -> None:
    xar(instance, "export", str(tmp_path / "data"), "--mode", "bot")
    manifest = json.loads((tmp_path / "data" / "manifest.json").read_text(encoding="utf-8"))
    for path, told in manifest["files"].items():
        content = (tmp_path / "data" / path).read_bytes()
        assert hashlib.sha256(content).hexdigest() == told["sha256"], path
    rows = read(tmp_path / "data" / "data" / "description-ratings_data.csv")
    means = {kind: mean(rows, "general", kind) for kind in ("subgoals", "turns")}
    assert means["turns"] > means["subgoals"] + 0.5
    assert {row["item"] for row in rows} == {"trust", "general"}
    head = manifest["log"]
    xar(instance, "verify-log", "--head", f"{head['number']}:{head['hash']}")
    xar(instance, "study", "replay")


@pytest.mark.usefixtures("bots")
def test_somebody_is_forgotten_and_nothing_is_left_of_them(
    page: Page, site: Site, instance: Path, tmp_path: Path
) -> None:
    page.goto("/researcher/people?mode=bot")
    code = page.locator("#participants tr").first.get_by_role("link").first.inner_text()
    page.goto(f"/researcher/people/{code}")
    page.get_by_label("Reason").first.fill(REASON)
    page.get_by_role("button", name="Exclude from the results").click()
    expect(page.get_by_text(REASON).first).to_be_visible()
    page.get_by_role("link", name="Erase this person").click()
    page.get_by_label(f"Type the code {code}").fill(code)
    page.get_by_label("Your password").fill(site.password)
    page.get_by_role("button", name="Erase for ever").click()
    page.get_by_role("heading", name="People").wait_for()
    assert page.request.get(f"/researcher/people/{code}").status == 404
    database = b"".join(file.read_bytes() for file in instance.glob("xar.sqlite3*"))
    for trace in (code, REASON):
        assert trace.encode() not in database
    xar(instance, "export", str(tmp_path / "data"))
    assert not [
        file for file in (tmp_path / "data").rglob("*") if file.is_file() and code.encode() in file.read_bytes()
    ]
    xar(instance, "verify-log")
    xar(instance, "study", "replay")


def read(file: Path) -> list[dict[str, str]]:
    with file.open(encoding="utf-8", newline="") as content:
        return list(csv.DictReader(content))


def mean(rows: list[dict[str, str]], item: str, kind: str) -> float:
    given = [int(row["rating"]) for row in rows if (row["item"], row["kind"]) == (item, kind)]
    return sum(given) / len(given)
