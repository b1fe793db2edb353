"""The compared study as an oTree app: consent, three pages of a picture and three ratings, the end."""

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


class _Trial(Page):
    form_model = "player"


class Trial1(_Trial):
    template_name = "load/Trial.html"
    form_fields = ["likeliness1", "loveliness1", "general1"]

    @staticmethod
    def vars_for_template(player):
        return dict(picture="load/1.png")


class Trial2(_Trial):
    template_name = "load/Trial.html"
    form_fields = ["likeliness2", "loveliness2", "general2"]

    @staticmethod
    def vars_for_template(player):
        return dict(picture="load/2.png")


class Trial3(_Trial):
    template_name = "load/Trial.html"
    form_fields = ["likeliness3", "loveliness3", "general3"]

    @staticmethod
    def vars_for_template(player):
        return dict(picture="load/3.png")


class End(Page):
    pass


page_sequence = [Consent, Trial1, Trial2, Trial3, End]
