"""The columns of each exported file; `docs/data-dictionary.md` says more about every one."""

from collections.abc import Iterable

from webapp.storage.variables import (
    ACTIONS,
    EXPERIMENT,
    STATES,
    TRIAL,
    WHAT,
    WHO,
    Variable,
    response_time,
    time,
)

RATINGS = (
    *WHO,
    *WHAT,
    Variable("item", "text", "The item that was rated."),
    Variable("rating", "integer", "The answer; the highest point is the most favourable.", unit="points", minimum=1),
    response_time(),
    time("submitted_at", "When the server stored the page; the same for all items of a page."),
)

PARTICIPANTS = (
    *WHO,
    Variable("consent_version", "text", "The version of the consent text that was agreed to."),
    time("consented_at", "When the consent was stored."),
    time("last_seen_at", "When the participant last sent something."),
    time("completed_at", "When the last page was stored; empty for everyone who has not finished."),
    time("withdrawn_at", "When the participant left the study; empty for everyone who has not left."),
    Variable("num_pages_sent", "integer", "How many pages are stored.", unit="pages", minimum=0),
    Variable("num_pages", "integer", "How many pages there are for this participant.", unit="pages", minimum=1),
    Variable(
        "assignment",
        "text",
        "All trials drawn for the participant, in order and separated by blanks: experiment/layout/kind, and for "
        "`random` /draw.",
    ),
    Variable("language", "text", "The code of the language of consent and study."),
    Variable(
        "translation",
        "text",
        "How far the rating items of this language can be trusted to ask the same as those of the first.",
        levels={
            "original": "the study's first language",
            "back_translated": "the study file cites a back-translation",
            "unvalidated": "the study file cites none",
        },
    ),
    Variable("guardian_agreed", "boolean", "Whether a guardian's consent was declared; empty where nobody is asked."),
    time("screened_out_at", "When the last attempt at the quiz failed and ended the study; empty for everyone else."),
    time("excluded_at", "When a researcher excluded the participant; empty for everyone who is not excluded now."),
    Variable(
        "exclusion_reason", "text", "The reason that the researcher gave; empty for everyone who is not excluded."
    ),
    time(
        "slot_released_at",
        "When the participant's place in the allocation went back, because they were gone for long, left or were "
        "screened out; empty while it counts.",
    ),
    time("returned_late_at", "When somebody came back whose place had gone back; empty for everyone else."),
)

ANSWERS = (
    *WHO,
    EXPERIMENT,
    TRIAL,
    Variable(
        "purpose",
        "text",
        "What was asked.",
        levels={
            "background": "a question about the participant",
            "quiz": "a question about the instructions",
            "attention": "an attention check",
        },
    ),
    Variable("question", "text", "The question's id in the study file."),
    Variable(
        "attempt", "integer", "Which attempt at the quiz it belongs to; 1 for the others.", unit="attempts", minimum=1
    ),
    Variable(
        "answer",
        "text",
        "The id of the choice, a whole number, the participant's own words, or `prefer_not_to_say`. Empty where "
        "`is_withheld` is true.",
    ),
    Variable("is_correct", "boolean", "Whether it is right; empty for background questions."),
    time("submitted_at", "When the server stored it."),
    Variable(
        "is_withheld",
        "boolean",
        "Whether the answer is in the participant's own words and was left out, because they may say who somebody is.",
    ),
)

PROBES = (
    *WHO,
    *WHAT,
    Variable("question", "integer", "The question's place on its page.", minimum=1),
    Variable("state", "integer", "The state asked about, an index into the layout's table in the bundle.", minimum=0),
    Variable("predicted", "text", f"The action that the participant chose: {ACTIONS}."),
    Variable("action", "text", "The action that the agent's policy takes there."),
    Variable("is_correct", "boolean", "Whether the two are the same."),
    Variable(
        "is_as_good",
        "boolean",
        "Whether the goal can be reached in as few steps after the chosen action as after the agent's.",
    ),
    Variable(
        "confidence",
        "integer",
        "How sure the participant was, 5 being completely sure.",
        unit="points",
        minimum=1,
        maximum=5,
    ),
    response_time(),
    time("submitted_at", "When the server stored the page; the same for all questions of a page."),
)

DRIVES = (
    *WHO,
    *WHAT,
    Variable(
        "phase",
        "text",
        "Which drive it was.",
        levels={
            "practice": "the practice; it belongs to no trial",
            "before": "before the explanation",
            "after": "after it, or in its place with the kind none",
        },
    ),
    Variable(
        "end",
        "text",
        "How it ended.",
        levels={
            "reached": "at the goal",
            "gave_up": "by the participant's wish",
            "step_limit": "with the last action there was",
            "failed": "where the episode ends without the goal; only in worlds of the study's own",
        },
    ),
    Variable("num_steps", "integer", "How many actions were taken.", unit="actions", minimum=0),
    Variable("optimum", "integer", "The fewest actions that lead to the goal.", unit="actions", minimum=1),
    Variable("step_limit", "integer", "How many actions there were.", unit="actions", minimum=1),
    Variable(
        "subgoals_passed",
        "text",
        "The agent's subgoals that the drive passed, as steps of its path, separated by blanks; empty if none.",
    ),
    Variable("key_points", "text", "The agent's subgoals that the drive missed, in the same way; empty if none."),
    Variable("actions", "text", "The actions in order, separated by blanks; empty if none was taken."),
    time("started_at", "When the server received the first action; empty if there is none."),
    time("submitted_at", "When the drive ended."),
)

EVENTS = (
    *WHO,
    *WHAT,
    Variable("page", "integer", "The page's place among the participant's pages.", minimum=1),
    Variable("page_kind", "text", "What stood on the page."),
    Variable("event", "text", "What happened."),
    Variable("target", "text", "What it happened to; empty for the page."),
    Variable("value", "text", "What came of it; empty where there is nothing to say."),
    Variable(
        "at_ms",
        "integer",
        "Since the first paint of the page, by the browser's monotonic clock; empty where it was not measured.",
        unit="ms",
        minimum=0,
        maximum=86_400_000,
    ),
    time("received_at", "When the server received it."),
)

ALLOCATION = (
    *WHO,
    Variable(
        "record", "integer", "The number of the draw's record in the log; the same for all its experiments.", minimum=1
    ),
    time("at", "When the draw was made."),
    EXPERIMENT,
    Variable("arrangement", "integer", "Which arrangement of kinds and layouts was drawn.", minimum=0),
    Variable("layout_order", "integer", "Which order of the layouts was drawn.", minimum=0),
    Variable(
        "word",
        "text",
        "The random number of the draw, in hexadecimal; the choice follows from it and `uses`. Empty for draws from "
        "before there was a ledger.",
    ),
    Variable("uses", "text", "How often each arrangement/order counted just before the draw; JSON."),
    Variable("draws", "text", "The draws of the kind `random`, by trial, separated by blanks."),
    time("released_at", "When the place went back; empty while it counts."),
    Variable(
        "released_why",
        "text",
        "Why it went back; empty while it counts.",
        levels={
            "expired": "no sign of life for as long as the study file says",
            "withdrawn": "the participant left",
            "screened_out": "the quiz ended the study",
            "erased": "the participant was erased",
        },
    ),
    time("resumed_at", "When the participant came back after that and the place counted again; empty otherwise."),
)

DECISIONS = (
    *WHO,
    Variable("record", "integer", "The number of the record in the log.", minimum=1),
    time("at", "When it was decided."),
    Variable("by", "text", "The name of the account that decided."),
    Variable(
        "action",
        "text",
        "What was decided.",
        levels={
            "excluded": "the participant is left out of the analysis",
            "included": "an exclusion is taken back",
            "corrected": "a value of the data is wrong; the files still hold it as it was given",
            "page_released": "a page was let go without an answer",
            "page_restarted": "a page was begun anew",
        },
    ),
    Variable("reason", "text", "The reason that was given."),
    Variable("page", "integer", "The page it is about; empty for the whole participant.", minimum=1),
    Variable("file", "text", "Of a correction: the file that holds the value."),
    Variable("question", "text", "Of a correction: the item or question."),
    Variable("from", "text", "Of a correction: the value that is wrong."),
    Variable("to", "text", "Of a correction: the value in its place."),
)

QUALITY = (
    *WHO,
    Variable("rule", "text", "The exclusion rule, by the name of its setting in the study file."),
    Variable(
        "value",
        "number",
        "What was found: minutes, seconds, failed checks, or the one rating; empty if not flagged.",
    ),
    Variable(
        "limit",
        "number",
        "The bound that the study file declares; empty where the rule has none.",
    ),
    Variable("flagged", "boolean", "Whether the rule speaks against the participant. It excludes nobody by itself."),
)

RECRUITS = (
    *(variable for variable in WHO if variable.name != "study_version"),
    Variable("service", "text", "Who sent the participant."),
    Variable("external_id", "text", "The person's id there."),
    Variable("external_study", "text", "The study's id there; empty where the service has none."),
    Variable("external_session", "text", "The id of this submission there; empty where the service has none."),
    Variable("state", "text", "Where the participant is.", levels=STATES),
)

WIDE_WHO = (
    *WHO,
    *(
        variable
        for variable in PARTICIPANTS
        if variable.name
        in {"consented_at", "completed_at", "withdrawn_at", "screened_out_at", "excluded_at", "language"}
    ),
)
"""What `wide.csv` begins with; the other columns follow from the study."""


def names(variables: Iterable[Variable]) -> tuple[str, ...]:
    """Return the names of columns."""
    return tuple(variable.name for variable in variables)


PARTICIPANTS_COLUMNS = names(PARTICIPANTS)
ANSWERS_COLUMNS = names(ANSWERS)
PROBES_COLUMNS = names(PROBES)
DRIVES_COLUMNS = names(DRIVES)
ALLOCATION_COLUMNS = names(ALLOCATION)
