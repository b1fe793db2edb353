"""The tables, as the program sees them; `migrations` makes them, and a test keeps the two equal.

What participants decided and answered is insert-only: triggers refuse to change a row of `ANSWER_TABLES`, and let the
rows of a participant be deleted only after that participant withdrew. `records` never change and stay for ever; what
they tell of a participant, in `record_contents`, goes with the participant.
"""

from sqlalchemy import (
    Boolean,
    CheckConstraint,
    Column,
    ForeignKey,
    ForeignKeyConstraint,
    Index,
    Integer,
    String,
    Table,
    Text,
    UniqueConstraint,
)

from webapp.storage.schema import UtcDateTime, metadata
from webapp.study.questionnaire import MAX_RESPONSE_TIME_MS
from webapp.study.sections import MAX_TEXT_LENGTH

MAX_POINTS = 11
"""The longest scale that a study file may declare."""

participants = Table(
    "participants",
    metadata,
    Column("id", Integer, primary_key=True),
    Column("code", String(12), nullable=False, unique=True),
    Column("token_hash", String(64), nullable=False, unique=True),
    Column("mode", String(4), CheckConstraint("mode IN ('live', 'test', 'bot')", name="mode"), nullable=False),
    Column("study", String(64), nullable=False),
    Column("study_version", String(64), nullable=False),
    Column("consent_version", String(64), nullable=False),
    Column("language", String(16), nullable=False),
    Column("translation", String(16), nullable=False),
    Column("guardian_agreed", Boolean),
    Column("num_pages", Integer, nullable=False),
    Column("consented_at", UtcDateTime, nullable=False),
    Column("last_seen_at", UtcDateTime, nullable=False),
    Column("completed_at", UtcDateTime),
    Column("withdrawn_at", UtcDateTime),
    Column("screened_out_at", UtcDateTime),
    Column("salt", String(32), nullable=False),
    Column("slot_released_at", UtcDateTime),
    Column("returned_late_at", UtcDateTime),
    Index(None, "study", "study_version", "mode"),
)

recruits = Table(
    "recruits",
    metadata,
    Column("participant_id", ForeignKey("participants.id"), primary_key=True),
    Column("study", String(64), nullable=False),
    Column("mode", String(4), nullable=False),
    Column("service", String(16), nullable=False),
    Column("external_id", String(128), nullable=False),
    Column("external_study", String(128)),
    Column("external_session", String(128)),
    UniqueConstraint("study", "mode", "service", "external_id"),
)

arrangements = Table(
    "arrangements",
    metadata,
    Column("participant_id", ForeignKey("participants.id"), primary_key=True),
    Column("experiment", String(64), primary_key=True),
    Column("arrangement", Integer, nullable=False),
    Column("layout_order", Integer, nullable=False),
)

trials = Table(
    "trials",
    metadata,
    Column("participant_id", ForeignKey("participants.id"), primary_key=True),
    Column("number", Integer, primary_key=True),
    Column("experiment", String(64), nullable=False),
    Column("position", Integer, nullable=False),
    Column("num_trials", Integer, nullable=False),
    Column("layout", String(64), nullable=False),
    Column("kind", String(32), nullable=False),
    Column("draw", Integer),
)

pages = Table(
    "pages",
    metadata,
    Column("participant_id", ForeignKey("participants.id"), primary_key=True),
    Column("number", Integer, primary_key=True),
    Column("kind", String(16), nullable=False),
    Column("trial_number", Integer),
    Column("nonce", String(32), nullable=False, unique=True),
    Column("submitted_at", UtcDateTime, nullable=False),
    ForeignKeyConstraint(["participant_id", "trial_number"], ["trials.participant_id", "trials.number"]),
)

ratings = Table(
    "ratings",
    metadata,
    Column("participant_id", Integer, primary_key=True),
    Column("page_number", Integer, primary_key=True),
    Column("item", String(64), primary_key=True),
    Column("rating", Integer, CheckConstraint(f"rating BETWEEN 1 AND {MAX_POINTS}", name="rating"), nullable=False),
    Column(
        "response_time_ms",
        Integer,
        CheckConstraint(f"response_time_ms BETWEEN 0 AND {MAX_RESPONSE_TIME_MS}", name="response_time_ms"),
    ),
    ForeignKeyConstraint(["participant_id", "page_number"], ["pages.participant_id", "pages.number"]),
)

answers = Table(
    "answers",
    metadata,
    Column("participant_id", ForeignKey("participants.id"), primary_key=True),
    Column("page_number", Integer, primary_key=True),
    Column("attempt", Integer, primary_key=True),
    Column("question", String(64), primary_key=True),
    Column("purpose", String(16), nullable=False),
    Column("answer", String(MAX_TEXT_LENGTH), nullable=False),
    Column("is_correct", Boolean),
    Column("submitted_at", UtcDateTime, nullable=False),
)

predictions = Table(
    "predictions",
    metadata,
    Column("participant_id", Integer, primary_key=True),
    Column("page_number", Integer, primary_key=True),
    Column("question", Integer, primary_key=True),
    Column("state", Integer, nullable=False),
    Column("predicted", String(16), nullable=False),
    Column("action", String(16), nullable=False),
    Column("is_correct", Boolean, nullable=False),
    Column("is_as_good", Boolean, nullable=False),
    Column("confidence", Integer, CheckConstraint("confidence BETWEEN 1 AND 5", name="confidence"), nullable=False),
    Column(
        "response_time_ms",
        Integer,
        CheckConstraint(f"response_time_ms BETWEEN 0 AND {MAX_RESPONSE_TIME_MS}", name="response_time_ms"),
    ),
    ForeignKeyConstraint(["participant_id", "page_number"], ["pages.participant_id", "pages.number"]),
)

drive_steps = Table(
    "drive_steps",
    metadata,
    Column("participant_id", ForeignKey("participants.id"), primary_key=True),
    Column("page_number", Integer, primary_key=True),
    Column("number", Integer, primary_key=True),
    Column("page_kind", String(16), nullable=False),
    Column("trial_number", Integer),
    Column("action", String(16), nullable=False),
    Column("elapsed_ms", Integer),
    Column("received_at", UtcDateTime, nullable=False),
    ForeignKeyConstraint(["participant_id", "trial_number"], ["trials.participant_id", "trials.number"]),
)

drives = Table(
    "drives",
    metadata,
    Column("participant_id", Integer, primary_key=True),
    Column("page_number", Integer, primary_key=True),
    Column("phase", String(16), nullable=False),
    Column("layout", String(64), nullable=False),
    Column("end", String(16), nullable=False),
    Column("num_steps", Integer, nullable=False),
    Column("optimum", Integer, nullable=False),
    Column("step_limit", Integer, nullable=False),
    Column("subgoals_passed", String(255), nullable=False),
    Column("key_points", String(255), nullable=False),
    ForeignKeyConstraint(["participant_id", "page_number"], ["pages.participant_id", "pages.number"]),
)

events = Table(
    "events",
    metadata,
    Column("participant_id", Integer, primary_key=True),
    Column("page_number", Integer, primary_key=True),
    Column("number", Integer, primary_key=True),
    Column("event", String(32), nullable=False),
    Column("target", String(64), nullable=False),
    Column("value", String(64), nullable=False),
    Column("at_ms", Integer, nullable=False),
    ForeignKeyConstraint(["participant_id", "page_number"], ["pages.participant_id", "pages.number"]),
)

page_restarts = Table(
    "page_restarts",
    metadata,
    Column("participant_id", ForeignKey("participants.id"), primary_key=True),
    Column("page_number", Integer, primary_key=True),
    Column("number", Integer, primary_key=True),
    Column("after_step", Integer, nullable=False),
    Column("after_attempt", Integer, nullable=False),
    Column("at", UtcDateTime, nullable=False),
)

ANSWER_TABLES = (
    recruits,
    arrangements,
    trials,
    pages,
    ratings,
    answers,
    predictions,
    drive_steps,
    drives,
    events,
    page_restarts,
)
"""What participants decided and answered, and where they began anew."""

participant_tokens = Table(
    "participant_tokens",
    metadata,
    Column("token_hash", String(64), primary_key=True),
    Column("participant_id", ForeignKey("participants.id"), nullable=False, index=True),
    Column("made_at", UtcDateTime, nullable=False),
)

records = Table(
    "records",
    metadata,
    Column("number", Integer, primary_key=True),
    Column("at", UtcDateTime, nullable=False),
    Column("actor", String(64), nullable=False),
    Column("action", String(32), nullable=False),
    Column("study", String(64)),
    Column("study_version", String(64)),
    Column("mode", String(4)),
    Column("subject", String(64)),
    Column("content_digest", String(64), nullable=False),
    Column("previous_hash", String(64), nullable=False),
    Column("hash", String(64), nullable=False),
    Index(None, "action"),
)

record_contents = Table(
    "record_contents",
    metadata,
    Column("number", ForeignKey("records.number"), primary_key=True),
    Column("participant_id", ForeignKey("participants.id"), index=True),
    Column("page_number", Integer),
    Column("part", Integer),
    Column("content", Text),
)

researchers = Table(
    "researchers",
    metadata,
    Column("id", Integer, primary_key=True),
    Column("name", String(64), nullable=False, unique=True),
    Column("password_hash", String(255), nullable=False),
    Column("created_at", UtcDateTime, nullable=False),
    Column("role", String(8), CheckConstraint("role IN ('viewer', 'owner', 'admin')", name="role"), nullable=False),
    Column("disabled_at", UtcDateTime),
)

researcher_sessions = Table(
    "researcher_sessions",
    metadata,
    Column("token_hash", String(64), primary_key=True),
    Column("researcher_id", ForeignKey("researchers.id"), nullable=False, index=True),
    Column("created_at", UtcDateTime, nullable=False),
    Column("last_seen_at", UtcDateTime, nullable=False),
)

sign_in_attempts = Table(
    "sign_in_attempts",
    metadata,
    Column("name_hash", String(64), primary_key=True),
    Column("num_failures", Integer, nullable=False),
    Column("last_attempt_at", UtcDateTime, nullable=False),
    Column("blocked_until", UtcDateTime),
)
