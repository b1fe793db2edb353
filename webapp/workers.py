"""Several processes that serve one study from PostgreSQL: this process becomes gunicorn, which starts them."""

import os
import sys
from typing import NoReturn

from webapp.app import refuse_debugging, refuse_several_for_sqlite
from webapp.config import Config
from webapp.wsgi import LIVE, TEST_RUN


def serve_with_workers(config: Config) -> NoReturn:
    """Become gunicorn; what is wrong with the settings is told by `gunicorn_settings`.

    Raises:
        webapp.config.ConfigError: The database is SQLite's.
    """
    refuse_debugging()
    refuse_several_for_sqlite(config)
    settings = {
        "XAR_INSTANCE": str(config.instance),
        "XAR_STUDY": config.study,
        "XAR_HOST": config.host,
        "XAR_PORT": str(config.port),
        "WEB_CONCURRENCY": str(config.workers),
    }
    os.environ.pop("GUNICORN_CMD_ARGS", None)
    command = [sys.executable, "-m", "gunicorn", "--config", "python:webapp.gunicorn_settings"]
    app = LIVE if config.live else TEST_RUN
    os.execve(sys.executable, [*command, app], os.environ | settings)  # noqa: S606 - no shell is wanted.
