"""What the views work with: configuration, database, bundles, secret and clock of the running app."""

import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path

from flask import Flask, current_app

from webapp.config import Config
from webapp.stimuli.catalogue import BundleError, Catalogue, Picture
from webapp.storage.database import Database
from webapp.storage.live import LiveNumbers
from webapp.storage.visits import RecentTrials

_EXTENSION = "xar"


class StudyChangedError(LookupError):
    """The bundle that a participant began with is gone."""


class Bundles:
    """The bundle that newcomers see, and earlier ones for participants who began with them.

    Attributes:
        current: What newcomers see.
    """

    def __init__(self, folder: Path, current: Catalogue) -> None:
        self.current = current
        self._folder = folder
        self._opened = {current.version: current}
        self._lock = threading.Lock()

    def version(self, version: str) -> Catalogue:
        """Return the bundle of a study version.

        Raises:
            StudyChangedError: It is not there any more.
        """
        with self._lock:
            if version not in self._opened:
                try:
                    self._opened[version] = Catalogue.open(self._folder / version)
                except BundleError as error:
                    raise StudyChangedError(f"the bundle {version} is gone: {error}") from error
            return self._opened[version]

    def picture(self, digest: str) -> Picture | None:
        """Return a picture, or None if no bundle in use has one of this digest.

        Raises:
            BundleError: Its file has gone or was changed.
        """
        with self._lock:
            opened = tuple(self._opened.values())
        pictures = (catalogue.picture(digest) for catalogue in opened)
        return next((picture for picture in pictures if picture is not None), None)


@dataclass(frozen=True, slots=True)
class Services:
    """Everything that outlives a request.

    Attributes:
        config: The settings.
        database: Where answers go.
        live: What the dashboard counts of them.
        bundles: What is shown.
        secret: The instance's secret key.
        clock: Returns the time, with its zone.
        recent_trials: The trials of participants who asked last.
    """

    config: Config
    database: Database
    live: LiveNumbers
    bundles: Bundles
    secret: bytes
    clock: Callable[[], datetime]
    recent_trials: RecentTrials = field(default_factory=RecentTrials)


def utc_now() -> datetime:
    """Return the time of this machine."""
    return datetime.now(UTC)


def attach(app: Flask, services: Services) -> None:
    """Give an app its services."""
    app.extensions[_EXTENSION] = services


def services_of(app: Flask) -> Services:
    """Return an app's services."""
    services = app.extensions[_EXTENSION]
    assert isinstance(services, Services)  # noqa: S101 - for the type checker
    return services


def services() -> Services:
    """Return the services of the app that handles the request."""
    return services_of(current_app)
