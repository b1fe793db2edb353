"""What `xar study publish` does, and how `xar study verify` finds a version."""

import re
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from webapp.command_line import CommandError

if TYPE_CHECKING:
    from webapp.config import Config
    from webapp.stimuli.agents import AgentProvider, ReportProgress

_MOST_LISTED = 12


@dataclass(frozen=True, slots=True)
class Published:
    """What came of publishing a study.

    Attributes:
        study: Its name.
        version: The published version.
        previous: The version that was published before; None if there was none.
        changes: What differs from that one; empty if there was none.
        is_new: False if this very version was the published one already.
        is_recorded: Whether it was recorded now. A version that was the published one already is so if its record is
            missing, because publishing it was interrupted.
    """

    study: str
    version: str
    previous: str | None
    changes: tuple[str, ...]
    is_new: bool
    is_recorded: bool

    def lines(self) -> list[str]:
        """Return what there is to say about it."""
        if not self.is_new:
            done = "Its record was missing and is written now." if self.is_recorded else "Nothing was done."
            return [f"Study {self.study} is published as it is: version {self.version}. {done}"]
        told = [f"Published study {self.study}, version {self.version}."]
        if self.previous is not None:
            told.append(f"It takes the place of version {self.previous}. What changed:")
            told += [f"  {change}" for change in self.changes[:_MOST_LISTED]]
            if len(self.changes) > _MOST_LISTED:
                told.append(f"  and {len(self.changes) - _MOST_LISTED} more")
        return told


def publish_study(
    folder: Path,
    config: "Config",
    note: str,
    now: datetime,
    progress: "ReportProgress",
    agents: "AgentProvider | None" = None,
) -> Published:
    """Freeze a study as it is in its folder, after building it if that was not done since it changed.

    Args:
        folder: The study's folder.
        config: Names the instance.
        note: Why, for the records.
        now: The time, with its zone.
        progress: Is told what is being done.
        agents: Where the agents come from; they are learned if left out.

    Raises:
        StudyError: The study's files cannot be used, or have placeholders.
        BuildError: What the agents do cannot be shown as the study wants it.
        InstanceError: The instance cannot be used.
        DatabaseError: The database cannot be used.
    """
    from webapp.stimuli.build import build
    from webapp.stimuli.learned import learned_agents
    from webapp.stimuli.sources import read_sources
    from webapp.storage.instance import prepare_instance

    study = read_sources(folder).study
    _check_filled_in(folder, study.placeholders())
    prepare_instance(config.instance)
    version = build(folder, config.instance, progress, agents or learned_agents).catalogue.version
    pointed_at = _published_version(config.instance, study.name)
    recorded = _latest_recorded(config, study.name)
    is_new, is_recorded = pointed_at != version, recorded != version or pointed_at != version
    previous = pointed_at if is_new or not is_recorded else recorded
    changed = _changes(config.instance / "bundles", previous, version)
    published = Published(study.name, version, previous, changed, is_new=is_new, is_recorded=is_recorded)
    _freeze(published, config, note, now)
    return published


def stored_bundle(instance: Path, study: str, version: str | None) -> Path:
    """Return the folder of a version of a study: the published one, else the one built last, unless one is named.

    Raises:
        BundleError: The study was neither published nor built.
        CommandError: No version, or more than one, begins as named.
    """
    from webapp.stimuli.catalogue import BundleError, current_bundle
    from webapp.stimuli.publication import published_bundle

    if version is None:
        try:
            return published_bundle(instance, study)
        except BundleError:
            return current_bundle(instance, study)
    known = sorted(path for path in (instance / "bundles").glob("*") if re.fullmatch(r"[0-9a-f]{64}", path.name))
    found = [path for path in known if path.name.startswith(version)]
    if len(found) != 1:
        what = "no version begins" if not found else f"{len(found)} versions begin"
        raise CommandError(f"{what} with {version!r} in {instance}; use more of the hash, or leave --version out")
    return found[0]


def _check_filled_in(folder: Path, placeholders: tuple[str, ...]) -> None:
    from webapp.study.problems import StudyError, located

    text = (folder / "study.toml").read_text(encoding="utf-8")
    wish = "is still a placeholder; fill it in before the study is published"
    problems = [located(text, str(folder / "study.toml"), (name,), wish) for name in placeholders]
    if problems:
        raise StudyError(problems)


def _published_version(instance: Path, study: str) -> str | None:
    from webapp.stimuli.catalogue import BundleError
    from webapp.stimuli.publication import published_bundle

    try:
        return published_bundle(instance, study).name
    except BundleError:
        return None


def _latest_recorded(config: "Config", study: str) -> str | None:
    from webapp.storage.database import open_database
    from webapp.storage.publications import latest_published

    with open_database(config) as database, database.read() as connection:
        return latest_published(connection, study)


def _changes(bundles: Path, previous: str | None, version: str) -> tuple[str, ...]:
    from webapp.stimuli.publication import changes

    if previous is None or not (bundles / previous).is_dir():
        return ()
    return changes(bundles / previous, bundles / version)


def _freeze(published: Published, config: "Config", note: str, now: datetime) -> None:
    """Close the bundle to changes, record that it is published, and let it be the published one, in this order.

    What fails leaves at most a record of what was about to be published, which publishing again makes true; never a
    published version without a record. The record is on disk before the pointer moves.
    """
    from webapp.stimuli.publication import lock, point_at

    lock(config.instance / "bundles" / published.version)
    if published.is_recorded:
        _record(published, config, note, now)
    if published.is_new:
        point_at(config.instance, published.study, published.version)


def _record(published: Published, config: "Config", note: str, now: datetime) -> None:
    from webapp.stimuli.publication import program_of
    from webapp.storage.database import open_database
    from webapp.storage.records import COMMAND_LINE, Entry, append
    from webapp.storage.scope import Scope

    content = {
        "version": published.version,
        "code": program_of(config.instance / "bundles" / published.version).to_json(),
        "note": note,
        "previous": published.previous,
        "changes": list(published.changes),
    }
    entry = Entry(now, COMMAND_LINE, "published", Scope(published.study, published.version, "live"), content=content)
    with open_database(config) as database, database.write() as connection:
        append(connection, entry)
