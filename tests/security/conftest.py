from tests.web.conftest import app, clock, database_of_the_run, instance, start_app

__all__ = ["app", "clock", "database_of_the_run", "instance", "start_app"]
