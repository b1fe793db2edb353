"""A participant who is shown what a test is about: consent is given until the assignment is one that will do."""

from collections.abc import Callable, Sequence

from tests.browser.site import Site
from tests.browser.walker import Walker

MAX_ARRIVALS = 60


def agree_until(walker: Walker, site: Site, will_do: Callable[[Sequence[str]], bool]) -> None:
    """Give consent, as one newcomer after another, until the kinds of the trials, in order, will do."""
    for _ in range(MAX_ARRIVALS):
        walker.page.context.clear_cookies()
        walker.agree()
        newest = max(site.export("participants.csv"), key=lambda row: row["consented_at"])
        if will_do([trial.split("/")[2] for trial in newest["assignment"].split()]):
            return
    raise AssertionError(f"nobody of {MAX_ARRIVALS} was shown what will do")
