"""What stands around every page of the dashboard: whose data it shows, whether arms are masked, the end of the log."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, get_args

from flask import abort, g, request

from webapp.stimuli.catalogue import Catalogue
from webapp.storage.dashboard import PresentScope, head_of_log, scopes_present
from webapp.storage.live_numbers import Numbers
from webapp.storage.participants import Participant
from webapp.storage.records import Head
from webapp.storage.scope import Mode, Scope
from webapp.storage.unblinding import arm_labels, has_looked, unblinded_at
from webapp.study.protocol import Study
from webapp.views.researcher.door import bp, researcher
from webapp.views.researcher.mask import LayoutBalance, Mask
from webapp.views.services import StudyChangedError, services

MODES: tuple[Mode, ...] = get_args(Mode)

DONE = {
    "noted": "The note is kept.",
    "excluded": "This person is excluded now.",
    "included": "The exclusion was taken back.",
    "corrected": "The correction is recorded; the answer itself stays as it was given.",
    "released": "The page was released: the participant goes on with the next one.",
    "restarted": "The page begins anew for the participant.",
    "person_unblinded": "What this person saw is shown below; that you looked is recorded.",
    "erased": "The person was erased; nothing of them is left but their place in the allocation ledger.",
    "unblinded": "You see the arms now; that is recorded.",
    "role": "The role was changed.",
    "disabled": "The account is closed and its sessions have ended.",
    "revoked": "The sessions have ended.",
}
"""What is said once something was done, by the value of `done` in the address; see also `_done`."""


@dataclass(frozen=True, slots=True)
class Look:
    """What somebody looks at.

    Attributes:
        scope: Whose data.
        catalogue: The bundle of their version.
        mask: What hides the arms from this account.
        present: Which data of the study there are.
    """

    scope: Scope
    catalogue: Catalogue
    mask: Mask
    present: Sequence[PresentScope]

    @property
    def study(self) -> Study:
        """The study as declared in this version."""
        return self.catalogue.study

    def numbers(self) -> Numbers:
        """Return the numbers as this account may see them."""
        return self.numbers_and_balance()[0]

    def numbers_and_balance(self) -> tuple[Numbers, Sequence[LayoutBalance]]:
        """Return the numbers as this account may see them, and what stands for the cells while arms are masked."""
        here = services()
        whole = here.live.overview(self.study, self.scope, here.clock())
        return self.mask.numbers(whole, self.study), self.mask.balance(whole.cells)


@bp.before_request
def choose_scope() -> None:
    """Read from the address whose data are meant: those of the server's own mode and version unless it says more."""
    if g.researcher is None:
        return
    here, current = services(), services().bundles.current
    mode, version = request.args.get("mode", here.config.mode), request.args.get("version", current.version)
    if mode not in MODES:
        abort(404)
    present = scopes_present(here.database, current.study.name)
    if version not in {current.version, *(known.study_version for known in present)}:
        abort(404)
    g.present = present
    look_at(Scope(current.study.name, version, mode))


def look_at(scope: Scope) -> Look:
    """Turn to the data of a scope.

    Raises:
        StudyChangedError: Its bundle is gone.
    """
    here, account = services(), researcher()
    g.catalogue = here.bundles.version(scope.study_version)
    opened_at = unblinded_at(here.database, account.name, scope) if account.may("owner") else None
    labels = arm_labels(here.secret, scope, g.catalogue.study)
    looked = has_looked(here.database, account.name, scope)
    g.look = Look(scope, g.catalogue, Mask(opened_at, labels, has_looked=looked), g.present)
    return look()


def look_at_person(person: Participant) -> Look:
    """Turn to the data that a person belongs to.

    Raises:
        StudyChangedError: The bundle is gone, or the person took part in another study.
    """
    if person.study != services().bundles.current.study.name:
        raise StudyChangedError(f"participant {person.code!r} took part in another study, {person.study!r}")
    return look() if person.scope == look().scope else look_at(person.scope)


def look() -> Look:
    """Return what this request is about."""
    found = g.look
    assert isinstance(found, Look)  # noqa: S101 - for the type checker: `choose_scope` saw to it
    return found


@bp.url_defaults
def stay_in_scope(_endpoint: str, values: dict[str, Any]) -> None:
    """Let every address of the dashboard say whose data are meant, unless it is the server's own choice."""
    found, here = g.get("look"), services()
    if not isinstance(found, Look):
        return
    if found.scope.mode != here.config.mode:
        values.setdefault("mode", found.scope.mode)
    if found.scope.study_version != here.bundles.current.version:
        values.setdefault("version", found.scope.study_version)


@bp.context_processor
def frame() -> dict[str, Any]:
    """Give every template of the dashboard what the frame shows."""
    if g.get("look") is None:
        return {}
    found, here, account = look(), services(), researcher()
    banner = {"banner": g.preview_banner} if "preview_banner" in g else {}
    return {
        **banner,
        "look": found,
        "mask": found.mask,
        "account": account,
        "may_change": account.may("owner"),
        "head": head_of_log(here.database),
        "done": _done(request.args.get("done", "")),
        "versions": _versions(found),
        "modes": MODES,
        "config_mode": here.config.mode,
        "is_current": found.scope.study_version == here.bundles.current.version,
    }


def head_as_json(head: Head) -> dict[str, object]:
    """Return the end of the log for an open page."""
    return {"number": head.number, "hash": head.hash}


def _done(name: str) -> str | None:
    if name == "erased_for_now":
        return f"The person was erased. {services().database.edition.last_traces}"
    return DONE.get(name)


def _versions(found: Look) -> Sequence[tuple[str, str]]:
    """Return the versions to choose from, each with how it is called."""
    current = services().bundles.current.version
    counts = dict.fromkeys((current, *(entry.study_version for entry in found.present)), 0)
    for entry in found.present:
        counts[entry.study_version] += entry.num_people if entry.mode == found.scope.mode else 0
    return [
        (version, f"{version[:12]}{' (served now)' if version == current else ''}, {_people(count)}")
        for version, count in counts.items()
    ]


def _people(count: int) -> str:
    return "1 person" if count == 1 else f"{count} people"
