"""The error of a build whose study can be read and still not be shown."""


class BuildError(RuntimeError):
    """Agents that cannot be had, or that do what the study cannot show; the message says what was missing."""
