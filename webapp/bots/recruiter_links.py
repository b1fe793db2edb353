"""The links by which bots come to a study whose participants a recruiter sends."""

import secrets
from collections.abc import Mapping

from webapp.study.recruitment import Service
from webapp.study.sections import Recruitment


def bot_query(recruitment: Recruitment) -> str:
    """Return what a recruiter's link for a bot adds to the query: ids that no person has, and no two bots share.

    Prolific's ids begin with the time at which they were made; a bot's begins with zeros, which was in 1970. SONA's are
    numbers, a bot's begins with letters.
    """
    own = secrets.token_hex(12)
    queries: Mapping[Service, str] = {
        "prolific": f"&PROLIFIC_PID=00000000{own[:16]}&STUDY_ID={'0' * 24}&SESSION_ID=00000000{own[:16]}",
        "sona": f"&id=bot{own}",
        "label": f"&label=bot-{own}",
    }
    return queries[recruitment.service]
