"""Who is asking: the participant whose cookie came with the request, and how far this participant is."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from flask import g, request, url_for

from webapp.stimuli.catalogue import Catalogue
from webapp.storage.participants import Participant, find_participant, hash_token
from webapp.storage.visits import find_visit
from webapp.study.answers import PageContent
from webapp.study.session import Page, decide, pages
from webapp.views.security import cookie_name
from webapp.views.services import StudyChangedError, services
from webapp.views.tokens import page_nonce


class NoPlaceError(LookupError):
    """No participant belongs to this request."""


@dataclass(frozen=True, slots=True)
class Visit:
    """A participant together with what this participant is shown.

    Attributes:
        participant: How far the participant was when the request came.
        catalogue: The bundle of the participant's study version.
        pages: All pages of this participant.
        restarts: By page, how often a researcher let the participant begin it anew; pages never begun anew are missing.
    """

    participant: Participant
    catalogue: Catalogue
    pages: Sequence[Page]
    restarts: Mapping[int, int] = field(default_factory=dict)

    @property
    def language(self) -> str:
        """The language of the pages."""
        return self.participant.language

    def page(self, number: int) -> Page:
        """Return a page by its number, from 1.

        Raises:
            NoSuchPageError: There is none.
        """
        decide(number, self.participant.num_stored, len(self.pages))
        return self.pages[number - 1]

    def nonce(self, page: Page, attempt: int = 1) -> str:
        """Return the nonce of one of the pages; each attempt at a page has its own."""
        restart = self.restarts.get(page.number, 0)
        return page_nonce(services().secret, self.participant.token_hash, page.number, attempt, restart)


def find_current_participant() -> Participant | None:
    """Return the participant that the request's cookie belongs to; while the study goes on, the pages are as before.

    A cookie of another mode or study is none: who tried the study out in a test run begins anew when it is live.
    """
    here = services()
    token = request.cookies.get(cookie_name(here.config, "participant"))
    participant = None if token is None else find_by_token(token)
    if participant is not None and participant.is_in_progress:
        speak_as_before(participant)
    return participant


def find_by_token(token: str) -> Participant | None:
    """Return the participant of this study and mode, or the bot, to whom a token belongs."""
    return _admitted(find_participant(services().database, hash_token(token)))


def load_participant() -> Participant:
    """Return the participant that the request's cookie belongs to.

    Raises:
        NoPlaceError: There is none.
    """
    participant = find_current_participant()
    if participant is None:
        raise NoPlaceError("no participant belongs to this request")
    speak_as_before(participant)
    return participant


def load_visit() -> Visit:
    """Return the participant that the request's cookie belongs to, with the pages to see.

    Raises:
        NoPlaceError: There is none.
        StudyChangedError: The study version that the participant began with is gone.
    """
    here = services()
    token = request.cookies.get(cookie_name(here.config, "participant"))
    stored = None if token is None else find_visit(here.database, hash_token(token), here.recent_trials)
    if stored is None or _admitted(stored.participant) is None:
        raise NoPlaceError("no participant belongs to this request")
    speak_as_before(stored.participant)
    catalogue = here.bundles.version(stored.participant.study_version)
    return Visit(stored.participant, catalogue, pages(catalogue.study, stored.trials), stored.restarts)


def place_of(participant: Participant) -> str:
    """Return the address of the page that a participant is at."""
    if participant.withdrawn_at is not None:
        return url_for("participant.left")
    if participant.screened_out_at is not None:
        return url_for("participant.ended")
    if participant.completed_at is not None:
        return url_for("participant.done")
    return url_for("participant.show_page", number=participant.num_stored + 1)


def place_after(participant: Participant, page: Page, content: PageContent) -> str:
    """Return the address of the page that a participant is at after a page was stored."""
    if content.screens_out:
        return url_for("participant.ended")
    if not content.is_final:
        return url_for("participant.show_page", number=page.number)
    if page.number == participant.num_pages:
        return url_for("participant.done")
    return url_for("participant.show_page", number=page.number + 1)


def speak_as_before(participant: Participant) -> None:
    """Let the texts be those that the participant began with; if these are gone, the current ones."""
    bundles = services().bundles
    try:
        g.catalogue = bundles.version(participant.study_version)
    except StudyChangedError:
        g.catalogue = bundles.current
    if participant.language in g.catalogue.study.languages:
        g.language = participant.language


def _admitted(participant: Participant | None) -> Participant | None:
    """Return a participant who is of this study and mode, or a bot; None for anybody else."""
    config = services().config
    if participant is None or participant.study != config.study:
        return None
    return participant if participant.mode in {config.mode, "bot"} else None
