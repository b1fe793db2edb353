"""Who may do what: every rule and method of the application, asked by everybody who could.

A case is one request; an outcome says the status, `+` where something is stored by it, and where it leads to:
`303+ /study/4`. `tests.security.test_routes` asks every case as everybody, and fails for a rule that has no case.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, get_args

from tests.web.researchers import PASSWORD
from webapp.storage.exports import FILE_NAMES

Who = Literal["nobody", "A", "B", "bot", "viewer", "owner", "admin"]
"""Nobody known, two participants, a bot that takes part, and the three roles at the dashboard."""

EVERYBODY: tuple[Who, ...] = get_args(Who)
PARTICIPANTS: tuple[Who, ...] = ("A", "B", "bot")
RESEARCHERS: tuple[Who, ...] = ("viewer", "owner", "admin")

Stage = Literal["rating", "driving", "unblinded"]
"""Participants are at page 3, which is rated; at page 4, which is driven; owner and admin see the arms."""

SIGN_IN = "303 /researcher/sign-in"
REASON = {"reason": "They wrote to us"}
CONFIRMED = REASON | {"password": PASSWORD}


@dataclass(frozen=True, slots=True)
class Case:
    """One request.

    Attributes:
        method: The method.
        rule: The rule of the map of addresses.
        said: What everybody is told.
        path: The address, with names in braces that `stage.Stage` fills in; None for the rule as it is.
        form: The fields, with such names too.
        stage: How far everybody is.
        what: What is special about it.
    """

    method: Literal["GET", "POST"]
    rule: str
    said: Mapping[Who, str]
    path: str | None = None
    form: Mapping[str, str] = field(default_factory=dict)
    stage: Stage = "rating"
    what: str = ""

    @property
    def address(self) -> str:
        """The address, names still in braces."""
        return self.rule if self.path is None else self.path

    @property
    def name(self) -> str:
        """How a failure calls it."""
        return f"{self.method} {self.rule}{f' ({self.what})' if self.what else ''}"


def everybody(said: str, **others: str) -> Mapping[Who, str]:
    """Tell all the same, some excepted."""
    return {who: others.get(who, said) for who in EVERYBODY}


def participants(said: str, others: str = "403", **special: str) -> Mapping[Who, str]:
    """Let those do it who take part."""
    return {who: special.get(who, said if who in PARTICIPANTS else others) for who in EVERYBODY}


def researchers(said: str, outside: str = SIGN_IN, **special: str) -> Mapping[Who, str]:
    """Let everybody do it who is signed in."""
    return {who: special.get(who, said if who in RESEARCHERS else outside) for who in EVERYBODY}


def owners(said: str) -> Mapping[Who, str]:
    """Let owners and admins do it."""
    return researchers(said, viewer="403")


def admins(said: str) -> Mapping[Who, str]:
    """Let admins do it."""
    return researchers("403", admin=said)


_PERSON = "/researcher/people/<code>"
_A = "/researcher/people/{code_A}"
_RATED = {"rating-likeliness": "4", "rating-general": "2"}
_DRIVEN = {"nonce": "{drive_A}", "step": "1", "action": "pickup", "elapsed": "1000"}

ARRIVAL = (
    Case("GET", "/", everybody("200", A="303 /study/3", B="303 /study/3", bot="303 /study/3")),
    Case(
        "POST",
        "/consent",
        everybody("303+ /study/1", A="303 /study/3", B="303 /study/3", bot="303 /study/3"),
        form={"agree": "yes", "nonce": "{consent}"},
    ),
    Case("POST", "/consent", everybody("422", A="303 /study/3", B="303 /study/3", bot="303 /study/3"), what="no tick"),
    Case("GET", "/declined", everybody("200", A="303 /leave", B="303 /leave", bot="303 /leave")),
    Case("GET", "/another-device", participants("200")),
    Case("GET", "/resume/<token>", everybody("403"), "/resume/{guess}", what="a guess"),
    Case("POST", "/resume/<token>", everybody("403"), "/resume/{guess}", what="a guess"),
    Case("GET", "/resume/<token>", everybody("200"), "/resume/{token_A}", what="whoever has the link"),
    Case("POST", "/resume/<token>", everybody("303 /study/3"), "/resume/{token_A}", what="whoever has the link"),
    Case("GET", "/ask", everybody("200")),
    Case("GET", "/healthz", everybody("200")),
    Case("GET", "/pictures/<digest>.png", everybody("200"), "/pictures/{picture}.png"),
    Case("GET", "/pictures/<digest>.png", everybody("404"), "/pictures/" + "0" * 64 + ".png", what="a guess"),
    Case("GET", "/static/<path:filename>", everybody("200"), "{static}/css/base.css"),
    Case("GET", "/static/<path:filename>", everybody("404"), "{static}/../pyproject.toml", what="outside"),
)

TAKING_PART = (
    Case("GET", "/study", participants("303 /study/3")),
    Case("GET", "/study/<int:number>", participants("200"), "/study/3"),
    Case("GET", "/study/<int:number>", participants("303 /study/3"), "/study/1", what="behind"),
    Case("GET", "/study/<int:number>", participants("303 /study/3"), "/study/4", what="ahead"),
    Case("GET", "/study/<int:number>", participants("404"), "/study/99", what="no page"),
    Case(
        "POST",
        "/study/<int:number>",
        participants("303 /study/3", A="303+ /study/4"),
        "/study/3",
        {"nonce": "{nonce_A}"} | _RATED,
        what="the form of A",
    ),
    Case("POST", "/study/<int:number>", participants("303 /study/3"), "/study/3", _RATED, what="no nonce"),
    Case(
        "POST",
        "/study/<int:number>",
        participants("303 /study/3"),
        "/study/4",
        {"nonce": "{nonce_A}"} | _RATED,
        what="a page ahead",
    ),
    Case(
        "POST",
        "/study/<int:number>/action",
        participants("303 /study/4", A="303+ /study/4"),
        "/study/4/action",
        _DRIVEN,
        "driving",
        what="the form of A",
    ),
    Case("POST", "/study/<int:number>/action", participants("404"), "/study/3/action", what="no drive"),
    Case("GET", "/leave", participants("200")),
    Case("POST", "/leave", participants("303+ /study")),
    Case("GET", "/left", participants("303 /study/3")),
    Case("GET", "/ended", participants("303 /study/3")),
    Case("GET", "/done", participants("303 /study/3")),
)

LOOKING_ON = (
    Case("GET", "/researcher/sign-in", everybody("200", **dict.fromkeys(RESEARCHERS, "303 /researcher/"))),
    Case(
        "POST",
        "/researcher/sign-in",
        everybody("303+ /researcher/"),
        form={"name": "owner", "password": PASSWORD},
        what="right",
    ),
    Case("POST", "/researcher/sign-in", everybody("422+"), form={"name": "owner", "password": "wrong"}, what="wrong"),
    Case("POST", "/researcher/sign-out", researchers("303+ /researcher/sign-in")),
    *(
        Case("GET", f"/researcher/{page}", researchers("200"))
        for page in (
            "",
            "people",
            "allocation",
            "quality",
            "results",
            "data",
            "records",
            "study",
            "preview",
            "accounts",
        )
    ),
    Case("GET", "/researcher/status.json", researchers("200", outside="401")),
    Case("GET", "/researcher/people.json", researchers("200", outside="401")),
    Case("GET", _PERSON, researchers("200"), _A),
    Case("GET", _PERSON, researchers("404"), "/researcher/people/AAAAAAAAAAAA", what="a guess"),
    Case("GET", "/researcher/preview/<int:number>", researchers("200"), "/researcher/preview/1"),
    Case("POST", "/researcher/preview/<int:number>", researchers("303"), "/researcher/preview/1"),
    Case("POST", "/researcher/preview", researchers("303")),
    Case("POST", "/researcher/allocation/replay", researchers("200")),
    Case("POST", "/researcher/records/verify", researchers("200")),
    Case("POST", "/researcher/accounts/sessions", researchers("422"), form={"session": "guess"}, what="of another"),
    Case(
        "POST",
        "/researcher/accounts/sessions",
        researchers("422", owner="303+ /researcher/accounts?done=revoked"),
        form={"session": "{session_owner}"},
        what="of the owner",
    ),
)


def _about(action: str, said: str, form: Mapping[str, str], what: str = "") -> Case:
    return Case("POST", f"{_PERSON}/{action}", owners(said), f"{_A}/{action}", form, what=what)


_MASKED_AND_OPEN: tuple[tuple[Stage, str], ...] = (("rating", "403"), ("unblinded", "200+"))

CHANGING = (
    Case("GET", "/researcher/consort.svg", owners("403"), what="masked"),
    Case("GET", "/researcher/consort.svg", owners("200"), stage="unblinded", what="unblinded"),
    _about("note", "303+", {"text": "They called us"}),
    _about("exclude", "303+", REASON),
    _about("include", "422", REASON, "not excluded"),
    _about("correct", "422", {"place": "ratings|1|likeliness", "value": "3"} | REASON, "masked"),
    _about("release", "303+", {"page": "3"} | REASON),
    _about("restart", "303+", {"page": "3"} | REASON),
    _about("restart", "422", {"page": "2"} | REASON, "a page behind"),
    _about("link", "200+", REASON),
    _about("look", "303+", CONFIRMED),
    _about("look", "422+", REASON | {"password": "wrong"}, "a wrong password is counted"),
    Case("GET", f"{_PERSON}/erase", owners("200"), f"{_A}/erase"),
    _about("erase", "303+", {"code": "{code_A}", "password": PASSWORD}),
    _about("erase", "422", {"code": "AAAAAAAAAAAA", "password": PASSWORD}, "another code"),
    Case("GET", "/researcher/unblind", owners("200")),
    Case("POST", "/researcher/unblind", owners("303+"), form=CONFIRMED),
    Case("POST", "/researcher/unblind", owners("422+"), form=REASON | {"password": "wrong"}, what="wrong password"),
    Case("POST", "/researcher/reconcile", owners("422"), what="no list"),
    Case("POST", "/researcher/recruits.csv", owners("422"), what="not confirmed"),
    Case("POST", "/researcher/recruits.csv", owners("200+"), form={"confirm": "yes"}),
    *(
        Case("GET", "/researcher/<name>.csv", owners(said), f"/researcher/{name}", stage=stage, what=f"{name}, {stage}")
        for name in FILE_NAMES
        for stage, said in _MASKED_AND_OPEN
    ),
    Case("GET", "/researcher/<name>.csv", owners("404"), "/researcher/researchers.csv", what="no file of the data"),
    *(
        Case("GET", f"/researcher/{name}", owners(said), stage=stage, what=stage)
        for name in ("dataset.zip",)
        for stage, said in _MASKED_AND_OPEN
    ),
    *(
        Case(
            "POST",
            f"/researcher/accounts/<name>/{action}",
            admins("303+"),
            f"/researcher/accounts/owner/{action}",
            form,
        )
        for action, form in (("role", {"role": "viewer"}), ("close", {}), ("sessions", {}))
    ),
    *(
        Case(
            "POST",
            f"/researcher/accounts/<name>/{action}",
            admins("422"),
            f"/researcher/accounts/admin/{action}",
            {"role": "viewer"},
            what="oneself",
        )
        for action in ("role", "close")
    ),
)

CASES: tuple[Case, ...] = (*ARRIVAL, *TAKING_PART, *LOOKING_ON, *CHANGING)
