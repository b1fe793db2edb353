"""What a table of phrases must hold, whichever language it is in."""

from collections.abc import Collection, Mapping
from string import Formatter


def phrase_problems(
    phrases: Mapping[str, str], wanted: Mapping[str, frozenset[str]], joints: Collection[str]
) -> list[str]:
    """Return what is wrong with a table of phrases, one line each; none if it can be used.

    Args:
        phrases: A text for each name.
        wanted: The names, each with the placeholders that its text must hold, once each.
        joints: The names of phrases that only join others, and so may be alike.
    """
    problems = [f"the phrase {key!r} is missing" for key in wanted if key not in phrases]
    problems += [f"there is no phrase {key!r}" for key in phrases if key not in wanted]
    known = {key: phrases[key] for key in wanted if key in phrases}
    problems += [problem for key, text in known.items() for problem in _placeholder_problems(key, text, wanted[key])]
    keys_by_text: dict[str, list[str]] = {}
    for key in known.keys() - set(joints):
        keys_by_text.setdefault(known[key].strip().casefold(), []).append(key)
    alike = sorted(sorted(keys) for keys in keys_by_text.values() if len(keys) > 1)
    return problems + [f"the phrases {', '.join(map(repr, keys))} say the same" for keys in alike]


def _placeholder_problems(key: str, text: str, wanted: frozenset[str]) -> list[str]:
    try:
        fields = [name for _, name, _, _ in Formatter().parse(text) if name is not None]
    except ValueError as error:
        return [f"the phrase {key!r} cannot be read: {error}"]
    wish = sorted(wanted)
    if sorted(fields) == wish:
        return []
    names = " and ".join(f"{{{name}}}" for name in wish)
    return [f"the phrase {key!r} must hold {names}" if wish else f"the phrase {key!r} takes no placeholder"]
