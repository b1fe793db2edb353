"""The tables, as the program sees them; `migrations` makes them, and a test keeps the two equal.

What participants decided and answered is insert-only: triggers refuse to change a row of `arrangements`, `trials`,
`pages`, `ratings` or `audit_log`, and let the rows of a participant be deleted only after that participant withdrew.
"""

from datetime import UTC, datetime

from sqlalchemy import (
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
)

from webapp.study.questionnaire import MAX_RESPONSE_TIME_MS

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
    Column("num_pages", Integer, nullable=False),
    Column("consented_at", UtcDateTime, nullable=False),
    Column("last_seen_at", UtcDateTime, nullable=False),
    Column("completed_at", UtcDateTime),
    Column("withdrawn_at", UtcDateTime),
    Index(None, "study", "study_version", "mode"),
)

arrangements = Table(
    "arrangements",
    metadata,
    Column("participant_id", ForeignKey("participants.id"), primary_key=True),
    Column("experiment", String(64), primary_key=True),
    Column("arrangement", Integer, nullable=False),
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
