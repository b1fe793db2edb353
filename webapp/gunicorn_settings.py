"""How gunicorn runs the workers; `xar serve --workers` hands this module over.

Each worker opens the database for itself. What they share is in the database, or in the instance folder.
"""

import os
import sys
from contextlib import ExitStack
from pathlib import Path

import click
from flask import Flask
from gunicorn.arbiter import Arbiter

from webapp.app import MAX_CONNECTIONS, NUM_THREADS, create_app, refuse_debugging, refuse_several_for_sqlite, tell_start
from webapp.config import read_config
from webapp.storage.instance import only_server, prepare_instance
from webapp.views.logs import configure_logging
from webapp.views.services import services_of
from webapp.wsgi import LIVE, REFUSALS

_CONFIG = read_config(os.environ)
# Where Linux has it: the workers' signs of life need no disk, and gunicorn makes their files under names of its own.
_MEMORY = Path("/dev/shm")  # noqa: S108 # nosec B108

bind = f"[{_CONFIG.host}]:{_CONFIG.port}" if ":" in _CONFIG.host else f"{_CONFIG.host}:{_CONFIG.port}"
workers = _CONFIG.workers
worker_class = "gthread"
threads = NUM_THREADS
worker_connections = max(MAX_CONNECTIONS // workers, 100)
worker_tmp_dir = str(_MEMORY) if os.access(_MEMORY, os.W_OK) else None
preload_app = False
timeout = 30
graceful_timeout = 30
keepalive = 30
limit_request_line = 4094
limit_request_fields = 50
forwarded_allow_ips = ""
control_socket_disable = True
loglevel = "warning"

_held = ExitStack()
_checked: list[Flask] = []


def on_starting(server: Arbiter) -> None:
    """Hold the instance, and put the app together once, so that what is wrong is told in one line."""
    try:
        config = read_config(os.environ, live=server.app.app_uri == LIVE)
        refuse_debugging()
        refuse_several_for_sqlite(config)
        configure_logging(with_requests=config.access_log)
        prepare_instance(config.instance)
        _held.enter_context(only_server(config.instance))
        _checked.append(create_app(config))
    except REFUSALS as error:
        click.echo(f"xar: {error}", err=True)
        sys.exit(2)


def when_ready(server: Arbiter) -> None:
    """Tell where the server listens, before there are workers; none of them inherits a connection."""
    app = _checked.pop()
    try:
        port = server.LISTENERS[0].sock.getsockname()[1]
        tell_start(app, port, lambda line: print(line, flush=True))  # noqa: T201 - as the command line does.
    finally:
        services_of(app).database.close()
