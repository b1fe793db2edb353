"""What a participant is shown, as a template needs it: pictures with their words, strips of them, questions."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Frame:
    """One picture of the agent's view.

    Attributes:
        digest: SHA-256 of the picture's bytes, in hexadecimal; also its file name.
        alt: The picture in words, in the language asked for.
    """

    digest: str
    alt: str


@dataclass(frozen=True, slots=True)
class Strip:
    """Pictures in order of time, with the action between each and the next.

    Attributes:
        frames: At least one.
        actions: The actions in the language asked for, one fewer than frames.
    """

    frames: tuple[Frame, ...]
    actions: tuple[str, ...]

    def __post_init__(self) -> None:
        if len(self.frames) != len(self.actions) + 1:
            raise ValueError(f"{len(self.frames)} pictures need one action fewer between them, not {len(self.actions)}")


@dataclass(frozen=True, slots=True)
class Situation:
    """What a participant sees before an explanation.

    Attributes:
        current: The agent's view when the explanation is given.
        video: What happened so far, ending with the current view; None where only the current view is shown.
        announced: The next actions, in the language asked for; empty where none are announced.
    """

    current: Frame
    video: Strip | None
    announced: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class ProbeQuestion:
    """The question what the agent does next, and its answer.

    Attributes:
        state: The state whose view is shown.
        action: The name of what the agent does there.
        as_good: The names of all actions after which the goal is no farther than after the agent's, which is one of
            them.
    """

    state: int
    action: str
    as_good: tuple[str, ...]
