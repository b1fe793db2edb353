"""Chain what happened into a log, keep a ledger of places, give accounts roles, let researchers help participants."""

import hashlib
import json
from datetime import datetime

import sqlalchemy as sa
from alembic import op

from webapp.storage.migrations.triggers import refuse, refuse_truncation

revision = "0003"
down_revision = "0002"

_FIRST_HASH = "0" * 64
_RANDOM = {"sqlite": "lower(hex(randomblob(16)))", "postgresql": "replace(gen_random_uuid()::text, '-', '')"}


def upgrade() -> None:
    """Add columns and tables; the chain begins with the earlier log of researchers and with the places given out."""
    op.add_column("participants", sa.Column("salt", sa.String(32), nullable=False, server_default=""))
    participants = sa.table("participants", sa.column("salt"))
    op.execute(participants.update().values(salt=sa.literal_column(_RANDOM[op.get_bind().dialect.name])))
    op.add_column("participants", sa.Column("slot_released_at", sa.DateTime))
    op.add_column("participants", sa.Column("returned_late_at", sa.DateTime))
    _make_page_restarts()
    _make_records()
    _change_accounts()
    _fill_the_log()
    _keep_rows()


def _make_page_restarts() -> None:
    op.create_table(
        "page_restarts",
        sa.Column("participant_id", sa.Integer, nullable=False),
        sa.Column("page_number", sa.Integer, nullable=False),
        sa.Column("number", sa.Integer, nullable=False),
        sa.Column("after_step", sa.Integer, nullable=False),
        sa.Column("after_attempt", sa.Integer, nullable=False),
        sa.Column("at", sa.DateTime, nullable=False),
        sa.PrimaryKeyConstraint("participant_id", "page_number", "number", name="pk_page_restarts"),
        _of_participant("page_restarts"),
    )
    op.create_table(
        "participant_tokens",
        sa.Column("token_hash", sa.String(64), nullable=False),
        sa.Column("participant_id", sa.Integer, nullable=False),
        sa.Column("made_at", sa.DateTime, nullable=False),
        sa.PrimaryKeyConstraint("token_hash", name="pk_participant_tokens"),
        _of_participant("participant_tokens"),
    )
    op.create_index("ix_participant_tokens_participant_id", "participant_tokens", ["participant_id"])


def _make_records() -> None:
    op.create_table(
        "records",
        sa.Column("number", sa.Integer, nullable=False),
        sa.Column("at", sa.DateTime, nullable=False),
        sa.Column("actor", sa.String(64), nullable=False),
        sa.Column("action", sa.String(32), nullable=False),
        sa.Column("study", sa.String(64)),
        sa.Column("study_version", sa.String(64)),
        sa.Column("mode", sa.String(4)),
        sa.Column("subject", sa.String(64)),
        sa.Column("content_digest", sa.String(64), nullable=False),
        sa.Column("previous_hash", sa.String(64), nullable=False),
        sa.Column("hash", sa.String(64), nullable=False),
        sa.PrimaryKeyConstraint("number", name="pk_records"),
    )
    op.create_index("ix_records_action", "records", ["action"])
    op.create_table(
        "record_contents",
        sa.Column("number", sa.Integer, nullable=False),
        sa.Column("participant_id", sa.Integer),
        sa.Column("page_number", sa.Integer),
        sa.Column("part", sa.Integer),
        sa.Column("content", sa.Text),
        sa.PrimaryKeyConstraint("number", name="pk_record_contents"),
        sa.ForeignKeyConstraint(["number"], ["records.number"], name="fk_record_contents_number_records"),
        _of_participant("record_contents"),
    )
    op.create_index("ix_record_contents_participant_id", "record_contents", ["participant_id"])


def _change_accounts() -> None:
    """Whoever had an account could do everything there was, accounts of others excepted, and goes on as an owner."""
    op.execute(
        "ALTER TABLE researchers ADD COLUMN role VARCHAR(8) DEFAULT 'owner' NOT NULL "
        "CONSTRAINT ck_researchers_role CHECK (role IN ('viewer', 'owner', 'admin'))"
    )
    op.add_column("researchers", sa.Column("disabled_at", sa.DateTime))
    op.drop_column("researcher_sessions", "revealed_at")


def _keep_rows() -> None:
    withdrew = "(SELECT withdrawn_at FROM participants WHERE id = OLD.participant_id) IS NOT NULL"
    equal = "IS" if op.get_bind().dialect.name == "sqlite" else "IS NOT DISTINCT FROM"
    same = " AND ".join(f"NEW.{name} {equal} OLD.{name}" for name in ("number", "page_number", "part", "content"))
    refuse("page_restarts", "never_change", "UPDATE", "TRUE", "never change")
    refuse("page_restarts", "stay", "DELETE", f"NOT ({withdrew})", "stay")
    refuse("records", "never_change", "UPDATE", "TRUE", "never change")
    refuse("records", "stay", "DELETE", "TRUE", "stay")
    unless_forgotten = f"NOT (NEW.participant_id IS NULL AND {same} AND {withdrew})"
    refuse("record_contents", "never_change", "UPDATE", unless_forgotten, "never change")
    refuse("record_contents", "stay", "DELETE", f"NOT ({withdrew})", "stay")
    for table in ("page_restarts", "records", "record_contents"):
        refuse_truncation(table)


class _Chain:
    """Adds records to the new log."""

    def __init__(self) -> None:
        self._previous, self._number = _FIRST_HASH, 0

    def append(
        self, at: str, actor: str, action: str, content: object, scope: tuple[str | None, ...], **about: object
    ) -> None:
        self._number += 1
        at = at if "." in at else f"{at}.000000"
        digest = _sha256(_canonical(content))
        told = f"{at.replace(' ', 'T')}Z"
        fields = [self._number, told, actor, action, *scope, about.get("subject"), digest]
        current = _sha256(_canonical([self._previous, *fields]))
        stored = at if op.get_bind().dialect.name == "sqlite" else datetime.fromisoformat(at)
        row = dict(zip(_FIELDS, [*fields, self._previous, current], strict=True)) | {"at": stored}
        _insert("records", row)
        written = None if content is None else _canonical(content)
        who = about.get("participant_id")
        _insert("record_contents", {"number": self._number, "participant_id": who, "content": written})
        self._previous = current


_FIELDS = (
    *("number", "at", "actor", "action", "study", "study_version", "mode"),
    *("subject", "content_digest", "previous_hash", "hash"),
)


def _fill_the_log() -> None:
    connection, chain = op.get_bind(), _Chain()
    query = sa.text("SELECT at, researcher, action, detail FROM audit_log ORDER BY id")
    for at, actor, action, detail in connection.execute(query).all():
        chain.append(str(at), actor, action, _content(actor, action, detail), (None, None, None))
    op.drop_table("audit_log")
    if connection.dialect.name == "postgresql":
        op.execute("DROP FUNCTION audit_log_never_change, audit_log_stay, audit_log_not_emptied")
    query = sa.text("SELECT id, code, salt, study, study_version, mode, consented_at FROM participants ORDER BY id")
    for participant_id, code, salt, *scope, at in connection.execute(query).all():
        content = {"word": None, "experiments": _places(participant_id), "draws": [], "num_draws": 0}
        about = {"subject": _sha256(f"{salt}{code}"), "participant_id": participant_id}
        chain.append(str(at), "system", "allocated", content, tuple(scope), **about)


def _content(actor: str, action: str, detail: str | None) -> dict[str, str] | None:
    """Return what an earlier line of the log told, as it is told now."""
    if action == "created":
        return {"account": actor, "role": "owner"}
    if detail is None:
        return None
    return {"file": detail} if action == "downloaded" else {"detail": detail}


def _places(participant_id: int) -> list[dict[str, object]]:
    query = sa.text(
        "SELECT experiment, arrangement, layout_order FROM arrangements WHERE participant_id = :id ORDER BY experiment"
    )
    return [
        {"experiment": experiment, "arrangement": arrangement, "layout_order": order, "sizes": None, "uses": {}}
        for experiment, arrangement, order in op.get_bind().execute(query, {"id": participant_id})
    ]


def _insert(table: str, row: dict[str, object]) -> None:
    op.bulk_insert(sa.table(table, *(sa.column(name) for name in row)), [row])


def _canonical(content: object) -> str:
    return json.dumps(content, sort_keys=True, ensure_ascii=False, separators=(",", ":"))


def _sha256(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def _of_participant(table: str) -> sa.ForeignKeyConstraint:
    return sa.ForeignKeyConstraint(
        ["participant_id"], ["participants.id"], name=f"fk_{table}_participant_id_participants"
    )
