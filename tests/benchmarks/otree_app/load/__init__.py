"""The compared study as an oTree app, page for page as ours.

Consent, the instructions, three times a page with the picture and a page with three ratings, the end.
"""

from otree.api import BaseConstants, BaseGroup, BasePlayer, BaseSubsession, Page, models, widgets


class C(BaseConstants):
    NAME_IN_URL = "load"
    PLAYERS_PER_GROUP = None
    NUM_ROUNDS = 1


class Subsession(BaseSubsession):
    pass


class Group(BaseGroup):
    pass


def _rating(label):
    return models.IntegerField(label=label, choices=[1, 2, 3, 4, 5], widget=widgets.RadioSelectHorizontal)


_LIKELINESS = "Could you predict the route that the agent took?"
_LOVELINESS = "Was it a succinct explanation?"
_GENERAL = "Comprehensive evaluation of explanation"


class Player(BasePlayer):
    agree = models.BooleanField(label="I agree to take part.", widget=widgets.CheckboxInput)
    likeliness1 = _rating(_LIKELINESS)
    loveliness1 = _rating(_LOVELINESS)
    general1 = _rating(_GENERAL)
    likeliness2 = _rating(_LIKELINESS)
    loveliness2 = _rating(_LOVELINESS)
    general2 = _rating(_GENERAL)
    likeliness3 = _rating(_LIKELINESS)
    loveliness3 = _rating(_LOVELINESS)
    general3 = _rating(_GENERAL)


class Consent(Page):
    form_model = "player"
    form_fields = ["agree"]


class Instructions(Page):
    pass


class _Situation(Page):
    template_name = "load/Situation.html"


class _Ratings(Page):
    form_model = "player"
    template_name = "load/Ratings.html"


class Situation1(_Situation):
    @staticmethod
    def vars_for_template(player):
        return dict(picture="load/1.png")


class Ratings1(_Ratings):
    form_fields = ["likeliness1", "loveliness1", "general1"]


class Situation2(_Situation):
    @staticmethod
    def vars_for_template(player):
        return dict(picture="load/2.png")


class Ratings2(_Ratings):
    form_fields = ["likeliness2", "loveliness2", "general2"]


class Situation3(_Situation):
    @staticmethod
    def vars_for_template(player):
        return dict(picture="load/3.png")


class Ratings3(_Ratings):
    form_fields = ["likeliness3", "loveliness3", "general3"]


class End(Page):
    pass


page_sequence = [
    Consent,
    Instructions,
    Situation1,
    Ratings1,
    Situation2,
    Ratings2,
    Situation3,
    Ratings3,
    End,
]
