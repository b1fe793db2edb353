"""Whom a recruiter sent, and the way back: what stands in the query of a link, checked."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from webapp.study.sections import Recruitment, ReturnPath

Service = Literal["prolific", "sona", "label"]
Ending = Literal["completed", "screened_out", "no_consent", "withdrawn"]
"""How somebody's part in the study ended, as recruiters tell it apart."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """A parameter of a recruiter's link.

    Attributes:
        name: As it stands in the query.
        pattern: What its value has to look like.
        wish: The same in a word that a participant can pass on.
    """

    name: str
    pattern: str
    wish: str


_PROLIFIC = r"[0-9a-f]{24}"

PARAMETERS: Mapping[Service, tuple[Parameter, ...]] = {
    "prolific": (
        Parameter("PROLIFIC_PID", _PROLIFIC, "24 characters, 0-9 and a-f"),
        Parameter("STUDY_ID", _PROLIFIC, "24 characters, 0-9 and a-f"),
        Parameter("SESSION_ID", r"[0-9a-z]{12,64}", "12 to 64 characters, 0-9 and a-z"),
    ),
    "sona": (Parameter("id", r"[0-9A-Za-z]{1,64}", "up to 64 letters and digits"),),
    "label": (Parameter("label", r"[0-9A-Za-z._-]{1,64}", "up to 64 letters, digits, . _ and -"),),
}
"""What each service puts into its link; the first names the person. Prolific's ids are those of its documentation."""


class RecruitmentError(ValueError):
    """A recruiter's link that lacks something or holds something that cannot be.

    Attributes:
        name: The parameter.
        value: What stands there; empty if nothing does.
        wish: What should stand there.
    """

    def __init__(self, name: str, value: str, wish: str) -> None:
        self.name = name
        self.value = value
        self.wish = wish
        super().__init__(f"{name} is {value!r}; it should be {wish}")


@dataclass(frozen=True, slots=True)
class Recruit:
    """Whom a recruiter sent. It is kept apart from the answers.

    Attributes:
        service: The recruiter.
        external_id: The person's id there.
        external_study: The study's id there, None where the service has none.
        external_session: The id of this submission there, None where the service has none.
    """

    service: Service
    external_id: str
    external_study: str | None = None
    external_session: str | None = None


def parse_recruit(recruitment: Recruitment, query: Mapping[str, str]) -> Recruit | None:
    """Read a recruiter's link.

    Args:
        recruitment: What the study file says.
        query: The parameters of the link.

    Returns:
        Whom it was made for, or None if it holds none of the service's parameters.

    Raises:
        RecruitmentError: It holds some of them, and one is missing or makes no sense.
    """
    parameters = PARAMETERS[recruitment.service]
    if not any(parameter.name in query for parameter in parameters):
        return None
    values: list[str] = []
    for parameter in parameters:
        value = query.get(parameter.name, "").strip()
        if not re.fullmatch(parameter.pattern, value):
            raise RecruitmentError(parameter.name, value[:64], parameter.wish)
        values.append(value)
    return Recruit(recruitment.service, *values)


def way_back(recruitment: Recruitment, ending: Ending, recruit: Recruit | None) -> ReturnPath:
    """Return the code and the link for an ending, the link with everything filled in.

    A link that needs the person's id is left out for somebody whose id is not known.
    """
    path: ReturnPath = getattr(recruitment, ending)
    if path.link is None or ("{id}" in path.link and recruit is None):
        return ReturnPath(code=path.code)
    external_id = "" if recruit is None else recruit.external_id
    return ReturnPath(code=path.code, link=path.link.format(code=path.code or "", id=external_id))
