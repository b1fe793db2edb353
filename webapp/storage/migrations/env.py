"""Run the steps on the connection that `Database.upgrade` hands over, within its transaction."""

from alembic import context

from webapp.storage.schema import metadata

context.configure(
    connection=context.config.attributes["connection"],
    target_metadata=metadata,
    render_as_batch=True,
    transactional_ddl=True,
)
context.run_migrations()
