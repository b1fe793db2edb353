"""Make room for everything around the ratings: languages, recruits, answers, predictions, drives, events."""

import sqlalchemy as sa
from alembic import op

from webapp.storage.migrations.triggers import refuse, refuse_truncation

revision = "0002"
down_revision = "0001"

NEW_ANSWER_TABLES = ("recruits", "answers", "predictions", "drive_steps", "drives", "events")

_LONGEST_TIME_MS = 86_400_000


def upgrade() -> None:
    """Add columns and tables; participants of before took part in English, in the fixed order of the layouts."""
    op.add_column("participants", sa.Column("language", sa.String(16), nullable=False, server_default="en"))
    op.add_column("participants", sa.Column("translation", sa.String(16), nullable=False, server_default="original"))
    op.add_column("participants", sa.Column("guardian_agreed", sa.Boolean))
    op.add_column("participants", sa.Column("screened_out_at", sa.DateTime))
    op.add_column("arrangements", sa.Column("layout_order", sa.Integer, nullable=False, server_default="0"))
    _make_recruits()
    _make_answers()
    _make_predictions()
    _make_drives()
    _make_events()
    for table in NEW_ANSWER_TABLES:
        _keep_rows(table)


def _make_recruits() -> None:
    op.create_table(
        "recruits",
        sa.Column("participant_id", sa.Integer, nullable=False),
        sa.Column("study", sa.String(64), nullable=False),
        sa.Column("mode", sa.String(4), nullable=False),
        sa.Column("service", sa.String(16), nullable=False),
        sa.Column("external_id", sa.String(128), nullable=False),
        sa.Column("external_study", sa.String(128)),
        sa.Column("external_session", sa.String(128)),
        sa.PrimaryKeyConstraint("participant_id", name="pk_recruits"),
        sa.UniqueConstraint(
            "study", "mode", "service", "external_id", name="uq_recruits_study_mode_service_external_id"
        ),
        _of_participant("recruits"),
    )


def _make_answers() -> None:
    op.create_table(
        "answers",
        sa.Column("participant_id", sa.Integer, nullable=False),
        sa.Column("page_number", sa.Integer, nullable=False),
        sa.Column("attempt", sa.Integer, nullable=False),
        sa.Column("question", sa.String(64), nullable=False),
        sa.Column("purpose", sa.String(16), nullable=False),
        sa.Column("answer", sa.String(500), nullable=False),
        sa.Column("is_correct", sa.Boolean),
        sa.Column("submitted_at", sa.DateTime, nullable=False),
        sa.PrimaryKeyConstraint("participant_id", "page_number", "attempt", "question", name="pk_answers"),
        _of_participant("answers"),
    )


def _make_predictions() -> None:
    op.create_table(
        "predictions",
        sa.Column("participant_id", sa.Integer, nullable=False),
        sa.Column("page_number", sa.Integer, nullable=False),
        sa.Column("question", sa.Integer, nullable=False),
        sa.Column("state", sa.Integer, nullable=False),
        sa.Column("predicted", sa.String(16), nullable=False),
        sa.Column("action", sa.String(16), nullable=False),
        sa.Column("is_correct", sa.Boolean, nullable=False),
        sa.Column("is_as_good", sa.Boolean, nullable=False),
        sa.Column("confidence", sa.Integer, nullable=False),
        sa.Column("response_time_ms", sa.Integer),
        sa.PrimaryKeyConstraint("participant_id", "page_number", "question", name="pk_predictions"),
        sa.CheckConstraint("confidence BETWEEN 1 AND 5", name=op.f("ck_predictions_confidence")),
        sa.CheckConstraint(
            f"response_time_ms BETWEEN 0 AND {_LONGEST_TIME_MS}", name=op.f("ck_predictions_response_time_ms")
        ),
        _of_page("predictions"),
    )


def _make_drives() -> None:
    op.create_table(
        "drive_steps",
        sa.Column("participant_id", sa.Integer, nullable=False),
        sa.Column("page_number", sa.Integer, nullable=False),
        sa.Column("number", sa.Integer, nullable=False),
        sa.Column("page_kind", sa.String(16), nullable=False),
        sa.Column("trial_number", sa.Integer),
        sa.Column("action", sa.String(16), nullable=False),
        sa.Column("elapsed_ms", sa.Integer),
        sa.Column("received_at", sa.DateTime, nullable=False),
        sa.PrimaryKeyConstraint("participant_id", "page_number", "number", name="pk_drive_steps"),
        _of_participant("drive_steps"),
        sa.ForeignKeyConstraint(
            ["participant_id", "trial_number"],
            ["trials.participant_id", "trials.number"],
            name="fk_drive_steps_participant_id_trial_number_trials",
        ),
    )
    op.create_table(
        "drives",
        sa.Column("participant_id", sa.Integer, nullable=False),
        sa.Column("page_number", sa.Integer, nullable=False),
        sa.Column("phase", sa.String(16), nullable=False),
        sa.Column("layout", sa.String(64), nullable=False),
        sa.Column("end", sa.String(16), nullable=False),
        sa.Column("num_steps", sa.Integer, nullable=False),
        sa.Column("optimum", sa.Integer, nullable=False),
        sa.Column("step_limit", sa.Integer, nullable=False),
        sa.Column("subgoals_passed", sa.String(255), nullable=False),
        sa.Column("key_points", sa.String(255), nullable=False),
        sa.PrimaryKeyConstraint("participant_id", "page_number", name="pk_drives"),
        _of_page("drives"),
    )


def _make_events() -> None:
    op.create_table(
        "events",
        sa.Column("participant_id", sa.Integer, nullable=False),
        sa.Column("page_number", sa.Integer, nullable=False),
        sa.Column("number", sa.Integer, nullable=False),
        sa.Column("event", sa.String(32), nullable=False),
        sa.Column("target", sa.String(64), nullable=False),
        sa.Column("value", sa.String(64), nullable=False),
        sa.Column("at_ms", sa.Integer, nullable=False),
        sa.PrimaryKeyConstraint("participant_id", "page_number", "number", name="pk_events"),
        _of_page("events"),
    )


def _of_participant(table: str) -> sa.ForeignKeyConstraint:
    return sa.ForeignKeyConstraint(
        ["participant_id"], ["participants.id"], name=f"fk_{table}_participant_id_participants"
    )


def _of_page(table: str) -> sa.ForeignKeyConstraint:
    return sa.ForeignKeyConstraint(
        ["participant_id", "page_number"],
        ["pages.participant_id", "pages.number"],
        name=f"fk_{table}_participant_id_page_number_pages",
    )


def _keep_rows(table: str) -> None:
    """Refuse to change a table's rows, and to delete them before their participant withdrew."""
    unless = "(SELECT withdrawn_at FROM participants WHERE id = OLD.participant_id) IS NOT NULL"
    refuse(table, "never_change", "UPDATE", None, "never change")
    refuse(table, "stay", "DELETE", f"NOT ({unless})", "stay")
    refuse_truncation(table)
