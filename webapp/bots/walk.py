"""The way of one bot: from the welcome page to wherever it ends, as a browser goes it."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from http import HTTPStatus
from typing import Literal

from webapp.bots.answering import Answerer, altered
from webapp.bots.browser import Answer, Browser, Site, TimeLimit
from webapp.bots.driving import GIVE_UP, Course, Intention, course_of, next_action
from webapp.bots.effects import Effects
from webapp.bots.errors import NotLetInAsBotError, WalkError
from webapp.bots.ledger import Ledger
from webapp.bots.opinions import happens, response_time_ms
from webapp.bots.page_reading import Form, ShownPage, read_page
from webapp.bots.plan import BotPlan
from webapp.bots.recruiter_links import bot_query
from webapp.stimuli.catalogue import Catalogue
from webapp.storage.database import Database
from webapp.storage.participants import Participant, find_participant, find_trials, hash_token
from webapp.storage.read_back import Entry
from webapp.study.sections import Recruitment
from webapp.study.session import DRIVEN, Page, pages

Ending = Literal["completed", "withdrew", "vanished", "screened_out", "turned_away"]
"""How a bot's part ended by itself: who `withdrew` told the study so, who `vanished` closed the window."""

_ENDINGS: Mapping[str, Ending] = {"/done": "completed", "/left": "withdrew", "/ended": "screened_out"}
_TYPICAL_ACTION_MS = 900
_MOST_VISITS = 12
"""How often a bot comes to the same page, which is more often than a quiz may be tried, before it gives up."""


@dataclass(frozen=True, slots=True)
class Surroundings:
    """What all bots of a run share.

    Attributes:
        site: The server.
        database: Where a bot looks up which kinds it is shown, which no page says.
        study: The name of the study that is to be tried.
        recruitment: Where its participants come from, None for nowhere.
        version: Opens what a version of it shows.
        bot_pass: What the consent is sent with, so that the server knows a bot.
        effects: What was declared.
        pace: The factor on response times with which bots really wait; 0 for not at all.
    """

    site: Site
    database: Database
    study: str
    recruitment: Recruitment | None
    version: Callable[[str], Catalogue]
    bot_pass: str
    effects: Effects
    pace: float = 0.0


class Walk:
    """One bot on its way.

    Attributes:
        plan: The bot.
        browser: Its browser.
        ledger: What it sent.
        participant: Who it is for the server; None before the consent.
    """

    def __init__(self, plan: BotPlan, around: Surroundings, limit: TimeLimit) -> None:
        self.plan = plan
        self.browser = Browser(around.site, limit)
        self.ledger = Ledger()
        self.participant: Participant | None = None
        self._around = around
        self._limit = limit

    def arrive(self) -> bool:
        """Come by a link and agree; tell whether the study let the bot in.

        Raises:
            NotLetInAsBotError: It was let in as a person, or into another study.
            WalkError: The server did something else.
            OutOfTimeError: The time is over.
        """
        welcome = self._look(f"/?lang={self.plan.language}{self._recruiters_query()}")
        form = welcome.form_to("/consent")
        if form is None:
            return False
        fields = form.hidden | form.boxes | {name: values[0] for name, values in form.choices.items()}
        answer = self._send("/consent", fields, Xar_Bot=self._around.bot_pass)
        if answer.next is None and answer.status == HTTPStatus.SERVICE_UNAVAILABLE:
            return False  # The study is full.
        if answer.next is None:
            raise WalkError(f"the consent was answered with {answer.status}")
        self.participant = self._find_myself()
        return True

    def go_on(self) -> Ending:
        """Go from the first page to where the study, or the plan, ends.

        Raises:
            WalkError: The server did something that a browser could not get past.
            OutOfTimeError: The time is over.
        """
        assert self.participant is not None  # noqa: S101 - for the type checker: who goes on has arrived.
        catalogue = self._around.version(self.participant.study_version)
        my_pages = pages(catalogue.study, find_trials(self._around.database, self.participant))
        answerer = Answerer(self.plan, self._around.effects, catalogue)
        last = 1 + int(self.plan.leaves_after * len(my_pages)) if self.plan.behaviour.leaves else len(my_pages) + 1
        visits: dict[int, int] = {}
        shown = self._look("/study")
        while shown.path not in _ENDINGS:
            page = my_pages[_number_of(shown.path) - 1]
            visits[page.number] = visits.get(page.number, 0) + 1
            if visits[page.number] > _MOST_VISITS:
                raise WalkError(f"page {page.number} ({page.kind}) comes again and again")
            if page.number >= last:
                return self._leave()
            shown = self._look(self._answer(shown, page, visits[page.number], answerer))
        return _ENDINGS[shown.path]

    def tokens(self) -> set[str]:
        """Return the hashes of all tokens that the server ever gave this browser; more than one is one too many."""
        return {hash_token(value) for name, value in self.browser.all_cookies if name.endswith("participant")}

    def _answer(self, shown: ShownPage, page: Page, attempt: int, answerer: Answerer) -> str:
        if shown.kind != page.kind:
            raise WalkError(f"page {page.number} shows {shown.kind!r}, not {page.kind!r}")
        if self.plan.behaviour.refreshes:
            shown = self._look(shown.path)
        if page.kind in DRIVEN:
            return self._drive(_form(shown, f"{shown.path}/action"), page, answerer.catalogue)
        form = _form(shown, shown.path)
        filled = answerer.fill_in(form, page, attempt)
        quiz = answerer.catalogue.study.quiz
        is_over = page.kind != "quiz" or quiz is None or attempt >= quiz.attempts
        is_final = is_over or answerer.passes_quiz(filled.entries)
        self._wait(filled.elapsed_ms)
        self.ledger.send(page.number, [*filled.entries, *([("page",)] if is_final else [])])
        answer = self._send(form.action, filled.fields)
        if answer.next is None:
            raise WalkError(f"page {page.number} ({page.kind}) was refused with {answer.status}")
        if is_final and answer.next == shown.path:
            raise WalkError(f"page {page.number} ({page.kind}) was sent and is still due")
        self.ledger.acknowledge()
        if self.plan.behaviour.refreshes:
            self.browser.post(form.action, altered(filled.fields))
            self.browser.get(shown.path)
        return answer.next

    def _drive(self, form: Form, page: Page, catalogue: Catalogue) -> str:
        """Drive as the page's script does, and return where it leads at the end."""
        course, rng = course_of(catalogue, page), self.plan.stream("drive", page.number)
        intention, actions, elapsed_ms = self._intention(page, course), list[str](), 0
        offered = {value for name, value in form.buttons if name == "action"}
        while True:
            action = next_action(course, actions, intention, rng)
            if action not in offered:
                raise WalkError(f"page {page.number} offers no action {action!r}")
            took_ms = response_time_ms(rng, _TYPICAL_ACTION_MS * self.plan.behaviour.pace)
            self._wait(took_ms)
            elapsed_ms += took_ms
            step = {"step": str(len(actions) + 1), "elapsed": str(elapsed_ms), "action": action}
            actions += [] if action == GIVE_UP else [action]
            self.ledger.send(page.number, _drive_entries(course, actions, action, elapsed_ms))
            answer = self._send(form.action, form.hidden | step, as_script=True)
            if answer.next is None and answer.content().get("step") != len(actions) + 1:
                raise WalkError(f"page {page.number}: action {len(actions)} was answered with {answer.status}")
            self.ledger.acknowledge()
            if answer.next is not None:
                return answer.next
            if self.plan.behaviour.refreshes:
                self._send(form.action, form.hidden | step | {"action": "left"}, as_script=True)

    def _intention(self, page: Page, course: Course) -> Intention:
        how, rng = self.plan.behaviour, self.plan.stream("intention", page.number)
        is_explained = page.trial is not None and page.kind == "drive" and how.follows_effects
        shift = self._around.effects.on_drive(page.trial.kind) if page.trial and is_explained else 0.0
        patience = rng.randint(1, max(1, course.step_limit // 2))
        return Intention(happens(how.arrives + shift, rng), how.skill, patience)

    def _leave(self) -> Ending:
        if not self.plan.says_goodbye:
            return "vanished"
        form = _form(self._look("/leave"), "/leave")
        answer = self._send(form.action, form.hidden)
        if answer.next is None or self._look(answer.next).path != "/left":
            raise WalkError(f"leaving was answered with {answer.status}")
        return "withdrew"

    def _look(self, path: str) -> ShownPage:
        answer = self.browser.get(path)
        return read_page(answer.path.partition("?")[0], answer.text)

    def _send(self, path: str, fields: Mapping[str, str], *, as_script: bool = False, **headers: str) -> Answer:
        """Send a form, once or as often as the behaviour says; return the answer that leads furthest."""
        if not self.plan.behaviour.sends_twice:
            return self.browser.post(path, fields, as_script=as_script, **headers)
        with ThreadPoolExecutor(2) as hands:
            clicks = [hands.submit(self.browser.post, path, fields, as_script=as_script, **headers) for _ in range(2)]
            answers = [click.result() for click in clicks]
        return max(answers, key=_how_far)

    def _find_myself(self) -> Participant:
        """Look up who this is for the server: without a doubt a bot.

        Raises:
            NotLetInAsBotError: It is somebody else.
        """
        token = next((value for name, value in self.browser.cookies.items() if name.endswith("participant")), "")
        found = find_participant(self._around.database, hash_token(token))
        if found is None:
            raise NotLetInAsBotError("the server stores its participants somewhere else than in this instance")
        if found.mode != "bot":
            raise NotLetInAsBotError(f"the server let a bot in as {found.mode!r}; stop it and start this version of it")
        if found.study != self._around.study:
            raise NotLetInAsBotError(f"the running server shows {found.study!r}; use --study {found.study}")
        return found

    def _recruiters_query(self) -> str:
        recruitment = self._around.recruitment
        return "" if recruitment is None else bot_query(recruitment)

    def _wait(self, milliseconds: int) -> None:
        if self._around.pace > 0:
            self._limit.wait(self._around.pace * milliseconds / 1000)


def _drive_entries(course: Course, actions: Sequence[str], action: str, elapsed_ms: int) -> list[Entry]:
    """Return what is stored when an action arrives: the step, and with the last one the page."""
    if action == GIVE_UP:
        return [("drive", "gave_up"), ("page",)]
    step: Entry = ("step", str(len(actions)), action, str(elapsed_ms))
    state = course.world.roll_out(course.start, actions)[-1]
    if course.world.is_terminal(state):
        return [step, ("drive", "reached" if course.world.is_goal(state) else "failed"), ("page",)]
    return [step, ("drive", "step_limit"), ("page",)] if len(actions) >= course.step_limit else [step]


def _form(shown: ShownPage, action: str) -> Form:
    form = shown.form_to(action)
    if form is None:
        raise WalkError(f"{shown.path} has no form that is sent to {action}")
    return form


def _number_of(path: str) -> int:
    number = path.removeprefix("/study/")
    if not number.isdigit():
        raise WalkError(f"the study leads to {path}, which is no page of it")
    return int(number)


def _how_far(answer: Answer) -> tuple[bool, bool, int]:
    """Rank answers to the same form; who came second may be led to the page itself, and from there on."""
    return answer.next is not None, answer.next != answer.path, int(answer.content().get("step") or 0)
