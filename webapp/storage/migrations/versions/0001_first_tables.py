"""Make the first tables."""

import sqlalchemy as sa
from alembic import op

from webapp.storage.migrations.triggers import refuse, refuse_truncation

revision = "0001"
down_revision = None

INSERT_ONLY = ("arrangements", "trials", "pages", "ratings")


def upgrade() -> None:
    """Make the tables of participants and researchers, and the triggers that keep answers as they are."""
    _make_participant_tables()
    _make_answer_tables()
    _make_researcher_tables()
    for table in INSERT_ONLY:
        _keep_rows(table, unless="(SELECT withdrawn_at FROM participants WHERE id = OLD.participant_id) IS NOT NULL")
    _keep_rows("audit_log", unless="FALSE")


def _make_participant_tables() -> None:
    op.create_table(
        "participants",
        sa.Column("id", sa.Integer, nullable=False),
        sa.Column("code", sa.String(12), nullable=False),
        sa.Column("token_hash", sa.String(64), nullable=False),
        sa.Column("mode", sa.String(4), nullable=False),
        sa.Column("study", sa.String(64), nullable=False),
        sa.Column("study_version", sa.String(64), nullable=False),
        sa.Column("consent_version", sa.String(64), nullable=False),
        sa.Column("num_pages", sa.Integer, nullable=False),
        sa.Column("consented_at", sa.DateTime, nullable=False),
        sa.Column("last_seen_at", sa.DateTime, nullable=False),
        sa.Column("completed_at", sa.DateTime),
        sa.Column("withdrawn_at", sa.DateTime),
        sa.PrimaryKeyConstraint("id", name="pk_participants"),
        sa.UniqueConstraint("code", name="uq_participants_code"),
        sa.UniqueConstraint("token_hash", name="uq_participants_token_hash"),
        sa.CheckConstraint("mode IN ('live', 'test', 'bot')", name=op.f("ck_participants_mode")),
    )
    op.create_index("ix_participants_study_study_version_mode", "participants", ["study", "study_version", "mode"])
    op.create_table(
        "arrangements",
        sa.Column("participant_id", sa.Integer, nullable=False),
        sa.Column("experiment", sa.String(64), nullable=False),
        sa.Column("arrangement", sa.Integer, nullable=False),
        sa.PrimaryKeyConstraint("participant_id", "experiment", name="pk_arrangements"),
        _of_participant("arrangements"),
    )


def _make_answer_tables() -> None:
    op.create_table(
        "trials",
        sa.Column("participant_id", sa.Integer, nullable=False),
        sa.Column("number", sa.Integer, nullable=False),
        sa.Column("experiment", sa.String(64), nullable=False),
        sa.Column("position", sa.Integer, nullable=False),
        sa.Column("num_trials", sa.Integer, nullable=False),
        sa.Column("layout", sa.String(64), nullable=False),
        sa.Column("kind", sa.String(32), nullable=False),
        sa.Column("draw", sa.Integer),
        sa.PrimaryKeyConstraint("participant_id", "number", name="pk_trials"),
        _of_participant("trials"),
    )
    op.create_table(
        "pages",
        sa.Column("participant_id", sa.Integer, nullable=False),
        sa.Column("number", sa.Integer, nullable=False),
        sa.Column("kind", sa.String(16), nullable=False),
        sa.Column("trial_number", sa.Integer),
        sa.Column("nonce", sa.String(32), nullable=False),
        sa.Column("submitted_at", sa.DateTime, nullable=False),
        sa.PrimaryKeyConstraint("participant_id", "number", name="pk_pages"),
        sa.UniqueConstraint("nonce", name="uq_pages_nonce"),
        _of_participant("pages"),
        sa.ForeignKeyConstraint(
            ["participant_id", "trial_number"],
            ["trials.participant_id", "trials.number"],
            name="fk_pages_participant_id_trial_number_trials",
        ),
    )
    op.create_table(
        "ratings",
        sa.Column("participant_id", sa.Integer, nullable=False),
        sa.Column("page_number", sa.Integer, nullable=False),
        sa.Column("item", sa.String(64), nullable=False),
        sa.Column("rating", sa.Integer, nullable=False),
        sa.Column("response_time_ms", sa.Integer),
        sa.PrimaryKeyConstraint("participant_id", "page_number", "item", name="pk_ratings"),
        sa.CheckConstraint("rating BETWEEN 1 AND 11", name=op.f("ck_ratings_rating")),
        sa.CheckConstraint("response_time_ms BETWEEN 0 AND 86400000", name=op.f("ck_ratings_response_time_ms")),
        sa.ForeignKeyConstraint(
            ["participant_id", "page_number"],
            ["pages.participant_id", "pages.number"],
            name="fk_ratings_participant_id_page_number_pages",
        ),
    )


def _make_researcher_tables() -> None:
    op.create_table(
        "researchers",
        sa.Column("id", sa.Integer, nullable=False),
        sa.Column("name", sa.String(64), nullable=False),
        sa.Column("password_hash", sa.String(255), nullable=False),
        sa.Column("created_at", sa.DateTime, nullable=False),
        sa.PrimaryKeyConstraint("id", name="pk_researchers"),
        sa.UniqueConstraint("name", name="uq_researchers_name"),
    )
    op.create_table(
        "researcher_sessions",
        sa.Column("token_hash", sa.String(64), nullable=False),
        sa.Column("researcher_id", sa.Integer, nullable=False),
        sa.Column("created_at", sa.DateTime, nullable=False),
        sa.Column("last_seen_at", sa.DateTime, nullable=False),
        sa.Column("revealed_at", sa.DateTime),
        sa.PrimaryKeyConstraint("token_hash", name="pk_researcher_sessions"),
        sa.ForeignKeyConstraint(
            ["researcher_id"], ["researchers.id"], name="fk_researcher_sessions_researcher_id_researchers"
        ),
    )
    op.create_index("ix_researcher_sessions_researcher_id", "researcher_sessions", ["researcher_id"])
    op.create_table(
        "sign_in_attempts",
        sa.Column("name_hash", sa.String(64), nullable=False),
        sa.Column("num_failures", sa.Integer, nullable=False),
        sa.Column("last_attempt_at", sa.DateTime, nullable=False),
        sa.Column("blocked_until", sa.DateTime),
        sa.PrimaryKeyConstraint("name_hash", name="pk_sign_in_attempts"),
    )
    op.create_table(
        "audit_log",
        sa.Column("id", sa.Integer, nullable=False),
        sa.Column("at", sa.DateTime, nullable=False),
        sa.Column("researcher", sa.String(64), nullable=False),
        sa.Column("action", sa.String(32), nullable=False),
        sa.Column("detail", sa.String(255)),
        sa.PrimaryKeyConstraint("id", name="pk_audit_log"),
    )


def _of_participant(table: str) -> sa.ForeignKeyConstraint:
    return sa.ForeignKeyConstraint(
        ["participant_id"], ["participants.id"], name=f"fk_{table}_participant_id_participants"
    )


def _keep_rows(table: str, unless: str) -> None:
    """Refuse to change a table's rows, and to delete them unless a condition on the old row holds."""
    refuse(table, "never_change", "UPDATE", None, "never change")
    refuse(table, "stay", "DELETE", f"NOT ({unless})", "stay")
    refuse_truncation(table)
