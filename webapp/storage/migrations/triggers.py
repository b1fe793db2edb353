"""The triggers that keep rows as they are, in the words of either database."""

from alembic import op


def refuse(table: str, name: str, change: str, condition: str | None, wish: str) -> None:
    """Refuse a change of a table's rows.

    Args:
        table: The table.
        name: Of the trigger, after the table's name.
        change: `UPDATE` or `DELETE`.
        condition: Of the rows `OLD` and, for an update, `NEW`: when to refuse, in words that both databases know; None
            for always.
        wish: What is said of the rows, such as `never change`.
    """
    if op.get_bind().dialect.name == "postgresql":
        _refuse_on_postgres(table, name, change, condition, wish)
    else:
        when = "" if condition is None else f"WHEN {condition} "
        op.execute(
            f"CREATE TRIGGER {table}_{name} BEFORE {change} ON {table} {when}"
            f"BEGIN SELECT RAISE(ABORT, 'rows of {table} {wish}'); END"
        )


def refuse_truncation(table: str) -> None:
    """Refuse to empty a table at once, which PostgreSQL can do past the triggers on rows."""
    if op.get_bind().dialect.name == "postgresql":
        op.execute(_function(table, "not_emptied", None, "stay", "NULL"))
        op.execute(
            f"CREATE TRIGGER {table}_not_emptied BEFORE TRUNCATE ON {table} "
            f"FOR EACH STATEMENT EXECUTE FUNCTION {table}_not_emptied()"
        )


def _refuse_on_postgres(table: str, name: str, change: str, condition: str | None, wish: str) -> None:
    op.execute(_function(table, name, condition, wish, "NEW" if change == "UPDATE" else "OLD"))
    op.execute(
        f"CREATE TRIGGER {table}_{name} BEFORE {change} ON {table} FOR EACH ROW EXECUTE FUNCTION {table}_{name}()"
    )


def _function(table: str, name: str, condition: str | None, wish: str, row: str) -> str:
    return (
        f"CREATE FUNCTION {table}_{name}() RETURNS trigger LANGUAGE plpgsql AS $$ BEGIN "
        f"IF {condition or 'TRUE'} THEN "
        f"RAISE EXCEPTION 'rows of {table} {wish}' USING ERRCODE = 'restrict_violation'; END IF; "
        f"RETURN {row}; END $$"
    )
