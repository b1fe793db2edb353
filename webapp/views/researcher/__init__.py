"""The dashboard: what researchers see of a study, and what they may do about it. Its pages are always English.

Every module adds its pages to the blueprint `bp`; whoever is not signed in gets into none of them.
"""

from webapp.views.researcher import (  # noqa: F401 - each adds its pages.
    account_pages,
    allocation,
    data_pages,
    log_pages,
    overview,
    people_list,
    person_actions,
    person_page,
    preview,
    quality,
    results,
    signing_in,
    study_page,
)
from webapp.views.researcher.door import bp

__all__ = ["bp"]
