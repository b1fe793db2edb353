"""What bots refuse to do, and where they give up."""


class BotError(ValueError):
    """A wish that cannot be granted; the message names the value and what is wanted."""


class NotLetInAsBotError(RuntimeError):
    """The server took a bot for a person, so that its answers would be taken for data; no other bot may follow."""


class WalkError(RuntimeError):
    """A page that a bot cannot get past; the message says which, and what the server did."""


class OutOfTimeError(RuntimeError):
    """The time that a bot has is over."""
