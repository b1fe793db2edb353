"""Which form of a text goes with a number, by the plural rules of the Unicode CLDR."""

from functools import lru_cache

from babel import Locale, UnknownLocaleError


def plural_categories(language: str) -> tuple[str, ...]:
    """Return the names of the forms that a language needs, such as `one` and `other` in English.

    Args:
        language: A language's code, such as `en` or `pt-br`; one that the CLDR does not know needs `other` alone.
    """
    locale = _locale(language)
    return ("other",) if locale is None else tuple(sorted({*locale.plural_form.tags, "other"}))


def plural_category(language: str, number: int) -> str:
    """Return the name of the form that goes with a number."""
    locale = _locale(language)
    return "other" if locale is None else str(locale.plural_form(number))


@lru_cache
def _locale(language: str) -> Locale | None:
    try:
        return Locale.parse(language, sep="-")
    except (UnknownLocaleError, ValueError):
        return None
