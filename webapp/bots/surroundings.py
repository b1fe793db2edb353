"""What all bots of a run share, for whoever lets them take part."""

from functools import lru_cache

from webapp.bots.browser import Site
from webapp.bots.effects import Effects
from webapp.bots.walk import Surroundings
from webapp.config import Config
from webapp.stimuli.catalogue import Catalogue
from webapp.storage.database import Database
from webapp.storage.instance import secret_key
from webapp.views.tokens import bot_pass


def surroundings_on(
    site: Site, database: Database, config: Config, catalogue: Catalogue, effects: Effects, pace: float = 0.0
) -> Surroundings:
    """Return what bots need to take part on a server of an instance.

    Args:
        site: The server.
        database: The instance's.
        config: The instance, and which of its studies is tried.
        catalogue: What that study shows now.
        effects: What is planted.
        pace: The factor on response times with which bots really wait; 0 for not at all.

    Raises:
        InstanceError: The instance has no secret key that can be read.
    """
    return Surroundings(
        site=site,
        database=database,
        study=config.study,
        recruitment=catalogue.study.recruitment,
        version=lru_cache(lambda version: Catalogue.open(config.instance / "bundles" / version)),
        bot_pass=bot_pass(secret_key(config.instance)),
        effects=effects,
        pace=pace,
    )
