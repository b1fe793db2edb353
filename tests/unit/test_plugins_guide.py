"""The guide to worlds and kinds of one's own: its blocks are those of the example, or run."""

import os
import re
import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest

from tests.conftest import ROOT, XAR
from tests.unit.stimuli.study_folders import change, nobody, quietly
from webapp.stimuli.build import build
from webapp.stimuli.catalogue import current_bundle
from webapp.stimuli.own_worlds import MAX_ACTION_LENGTH, MAX_STATES
from webapp.stimuli.sources import read_sources
from webapp.study.experiments import MAX_KIND_LENGTH

EXAMPLE = ROOT / "docs/examples/own_world"
GUIDE = (ROOT / "docs/plugins.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(\w*)\n(.*?)^```", GUIDE, re.DOTALL | re.MULTILINE)
(COMMANDS,) = (text for language, text in BLOCKS if not language)
(LIGHTS,) = (text for _, text in BLOCKS if "lights.py" in text)
(OFFERED,) = (text for _, text in BLOCKS if "entry-points" in text)


@pytest.mark.parametrize("block", [text for _, text in BLOCKS if text not in (COMMANDS, LIGHTS, OFFERED)])
def test_every_other_block_stands_in_the_example(block: str) -> None:
    files = [*EXAMPLE.glob("*.*"), *EXAMPLE.glob("texts/*.toml")]
    assert any(block in file.read_text(encoding="utf-8") for file in files)


def test_the_commands_of_the_guide_build_the_example_and_serve_it(tmp_path: Path) -> None:
    first, second = (line.split() for line in COMMANDS.splitlines())
    done = subprocess.run(
        [XAR, *first[1:]],
        cwd=ROOT,
        env={**os.environ, "XAR_INSTANCE": str(tmp_path / "instance")},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "Built study own_world" in done.stdout
    assert "the agent is the exact planner" in done.stdout
    assert second[:-1] == ["xar", "serve", "--study"]
    assert current_bundle(tmp_path / "instance", second[-1]).is_dir()


def test_the_guide_names_the_limits() -> None:
    assert f"At most {MAX_STATES:,} states" in GUIDE
    assert f"up to {MAX_ACTION_LENGTH} characters: `actions`" in GUIDE
    assert f"up to {MAX_KIND_LENGTH} characters, is the value of the column" in GUIDE


def test_the_world_with_everything_can_be_shown_in_two_languages(tmp_path: Path) -> None:
    study = example(tmp_path)
    (study / "lights.py").write_text(LIGHTS, encoding="utf-8")
    change(study / "study.toml", 'languages = ["en"]', 'languages = ["en", "ja"]')
    text = (study / "study.toml").read_text(encoding="utf-8")
    text = re.sub(r"(\[worlds\.\w+\]\n)use = .*\n(options = .*\n)?", r'\1use = "lights:Lights"' + "\n", text)
    (study / "study.toml").write_text(text.replace("tailored_all", "full"), encoding="utf-8")
    for language in ("en", "ja"):
        file = study / "texts" / f"{language}.toml"
        texts = (EXAMPLE / "texts/en.toml").read_text(encoding="utf-8")
        file.write_text(texts.replace("west =", "first =").replace("east =", "second =").replace("load =", "third ="))
    built = build(study, tmp_path / "instance", quietly, nobody)
    world = built.catalogue.world("sea")
    assert world.path_actions == ("first", "second")
    assert built.catalogue.view("sea", world.start, "ja").alt == "消灯, 消灯, 消灯"
    assert built.catalogue.view("sea", world.start, "en").alt == "off, off, off"
    assert all(report.training == {"agent": "own_policy"} for report in built.reports)


def test_an_installed_package_offers_what_the_guide_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    installed = tmp_path / "site"
    (installed / "ferries-1.2.dist-info").mkdir(parents=True)
    (installed / "ferries-1.2.dist-info/METADATA").write_text("Metadata-Version: 2.1\nName: ferries\nVersion: 1.2\n")
    (installed / "ferries-1.2.dist-info/top_level.txt").write_text("ferries\n")
    groups = tomllib.loads(OFFERED)["project"]["entry-points"]
    lines = [line for group, points in groups.items() for line in (f"[{group}]", *map(" = ".join, points.items()))]
    (installed / "ferries-1.2.dist-info/entry_points.txt").write_text("\n".join(lines))
    study = example(tmp_path)
    (study / "own_world.py").rename(installed / "ferries.py")
    monkeypatch.syspath_prepend(str(installed))
    text = (study / "study.toml").read_text(encoding="utf-8")
    text = text.replace('"own_world:turns"', '"turns"').replace('"own_world:Ferry"', '"ferry"')
    (study / "study.toml").write_text(text, encoding="utf-8")
    sources = read_sources(study)
    assert sources.worlds["sea"].table.num_states == 2 * 9
    assert {sources.origins[place].distribution for place in ("kinds.turns", "worlds.sea")} == {"ferries 1.2"}
    assert sources.kinds.keys() == {"turns"}


def example(folder: Path) -> Path:
    return Path(shutil.copytree(EXAMPLE, folder / "studies" / "own_world"))
