"""The columns of each exported file; `docs/data-dictionary.md` describes every one."""

WHO = ("study", "study_version", "mode", "participant")
"""Whose row it is; at the beginning of every file but `recruits.csv`."""

WHAT = ("experiment", "trial", "layout", "kind", "draw")
"""Of which trial it is; empty where a page belongs to none."""

RATINGS_COLUMNS = (*WHO, *WHAT, "item", "rating", "response_time_ms", "submitted_at")

PARTICIPANTS_COLUMNS = (
    *WHO,
    "consent_version",
    "consented_at",
    "last_seen_at",
    "completed_at",
    "withdrawn_at",
    "num_pages_sent",
    "num_pages",
    "assignment",
    "language",
    "translation",
    "guardian_agreed",
    "screened_out_at",
)

ANSWERS_COLUMNS = (
    *WHO,
    "experiment",
    "trial",
    "purpose",
    "question",
    "attempt",
    "answer",
    "is_correct",
    "submitted_at",
)

PROBES_COLUMNS = (
    *WHO,
    *WHAT,
    "question",
    "state",
    "predicted",
    "action",
    "is_correct",
    "is_as_good",
    "confidence",
    "response_time_ms",
    "submitted_at",
)

DRIVES_COLUMNS = (
    *WHO,
    *WHAT,
    "phase",
    "end",
    "num_steps",
    "optimum",
    "step_limit",
    "subgoals_passed",
    "key_points",
    "actions",
    "started_at",
    "submitted_at",
)

EVENTS_COLUMNS = (*WHO, *WHAT, "page", "page_kind", "event", "target", "value", "at_ms", "received_at")

RECRUITS_COLUMNS = (
    "study",
    "mode",
    "participant",
    "service",
    "external_id",
    "external_study",
    "external_session",
    "state",
)
