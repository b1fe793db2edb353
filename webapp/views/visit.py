"""Who is asking: the participant whose cookie came with the request, and how far this participant is."""

from collections.abc import Sequence
from dataclasses import dataclass

from flask import g, request, url_for

from webapp.stimuli.catalogue import Catalogue
from webapp.storage.participants import Participant, find_participant, find_trials, hash_token
from webapp.study.session import Page, decide, pages
from webapp.views.security import cookie_name
from webapp.views.services import services
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
    """

    participant: Participant
    catalogue: Catalogue
    pages: Sequence[Page]

    @property
    def language(self) -> str:
        """The language of the pages."""
        return self.catalogue.study.languages[0]

    def page(self, number: int) -> Page:
        """Return a page by its number, from 1.

        Raises:
            NoSuchPageError: There is none.
        """
        decide(number, self.participant.num_stored, len(self.pages))
        return self.pages[number - 1]

    def nonce(self, page: Page) -> str:
        """Return the nonce of one of the pages."""
        return page_nonce(services().secret, self.participant.token_hash, page.number)


def find_current_participant() -> Participant | None:
    """Return the participant that the request's cookie belongs to.

    A cookie of another mode or study is none: who tried the study out in a test run begins anew when it is live.
    """
    here = services()
    token = request.cookies.get(cookie_name(here.config, "participant"))
    if token is None:
        return None
    participant = find_participant(here.database, hash_token(token))
    if participant is None or (participant.mode, participant.study) != (here.config.mode, here.config.study):
        return None
    return participant


def load_participant() -> Participant:
    """Return the participant that the request's cookie belongs to.

    Raises:
        NoPlaceError: There is none.
    """
    participant = find_current_participant()
    if participant is None:
        raise NoPlaceError("no participant belongs to this request")
    return participant


def load_visit() -> Visit:
    """Return the participant that the request's cookie belongs to, with the pages to see.

    Raises:
        NoPlaceError: There is none.
        StudyChangedError: The study version that the participant began with is gone.
    """
    here = services()
    participant = load_participant()
    g.catalogue = here.bundles.version(participant.study_version)
    return Visit(participant, g.catalogue, pages(find_trials(here.database, participant)))


def is_in_progress(participant: Participant) -> bool:
    """Tell whether a participant has neither finished nor left."""
    return participant.completed_at is None and participant.withdrawn_at is None


def place_of(participant: Participant) -> str:
    """Return the address of the page that a participant is at."""
    if participant.withdrawn_at is not None:
        return url_for("participant.left")
    if participant.completed_at is not None:
        return url_for("participant.done")
    return url_for("participant.show_page", number=participant.num_stored + 1)
