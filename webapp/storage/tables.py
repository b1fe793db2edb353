"""The tables, as the program sees them; `migrations` makes them, and a test keeps the two equal.

What participants decided and answered is insert-only: triggers refuse to change a row of `ANSWER_TABLES` or of
`audit_log`, and let the rows of a participant be deleted only after that participant withdrew.
"""

from datetime import UTC, datetime

from sqlalchemy import (
    Boolean,
    CheckConstraint,
    Column,
    DateTime,
    Dialect,
    ForeignKey,
    ForeignKeyConstraint,
    Index,
    Integer,
    MetaData,
    String,
    Table,
    TypeDecorator,
    UniqueConstraint,
)

from webapp.study.questionnaire import MAX_RESPONSE_TIME_MS
from webapp.study.sections import MAX_TEXT_LENGTH

MAX_POINTS = 11
"""The longest scale that a study file may declare."""

NAMING_CONVENTION = {
    "ix": "ix_%(table_name)s_%(column_0_N_name)s",
    "uq": "uq_%(table_name)s_%(column_0_N_name)s",
    "ck": "ck_%(table_name)s_%(constraint_name)s",
    "fk": "fk_%(table_name)s_%(column_0_N_name)s_%(referred_table_name)s",
    "pk": "pk_%(table_name)s",
}


class UtcDateTime(TypeDecorator[datetime]):
    """A time with its zone in Python, stored as UTC with microseconds."""

    impl = DateTime
    cache_ok = True

    def process_bind_param(self, value: datetime | None, dialect: Dialect) -> datetime | None:  # noqa: ARG002
        """Convert to UTC; a time without a zone is refused."""
        if value is None:
            return None
        if value.tzinfo is None:
            raise ValueError(f"{value} has no time zone; use UTC")
        return value.astimezone(UTC).replace(tzinfo=None)

    def process_result_value(self, value: datetime | None, dialect: Dialect) -> datetime | None:  # noqa: ARG002
        """Say that the stored time is UTC."""
        return None if value is None else value.replace(tzinfo=UTC)


metadata = MetaData(naming_convention=NAMING_CONVENTION)

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
)
"""What participants decided and answered."""

researchers = Table(
    "researchers",
    metadata,
    Column("id", Integer, primary_key=True),
    Column("name", String(64), nullable=False, unique=True),
    Column("password_hash", String(255), nullable=False),
    Column("created_at", UtcDateTime, nullable=False),
)

researcher_sessions = Table(
    "researcher_sessions",
    metadata,
    Column("token_hash", String(64), primary_key=True),
    Column("researcher_id", ForeignKey("researchers.id"), nullable=False, index=True),
    Column("created_at", UtcDateTime, nullable=False),
    Column("last_seen_at", UtcDateTime, nullable=False),
    Column("revealed_at", UtcDateTime),
)

sign_in_attempts = Table(
    "sign_in_attempts",
    metadata,
    Column("name_hash", String(64), primary_key=True),
    Column("num_failures", Integer, nullable=False),
    Column("last_attempt_at", UtcDateTime, nullable=False),
    Column("blocked_until", UtcDateTime),
)

audit_log = Table(
    "audit_log",
    metadata,
    Column("id", Integer, primary_key=True),
    Column("at", UtcDateTime, nullable=False),
    Column("researcher", String(64), nullable=False),
    Column("action", String(32), nullable=False),
    Column("detail", String(255)),
)
