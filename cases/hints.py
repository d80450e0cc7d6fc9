"""Hints for unknown keys and values: the known word that was probably meant, found by synonym, abbreviation or typo."""

import difflib
import re
from collections.abc import Iterable

from tetlux.cases.synonyms import ALIASES, REMEDIES

# How much a misspelt synonym resembles one: "milimeter" is 0.95 like "millimeter".
ALIKE = 0.9
GREEK = {"µ": "mu_", "μ": "mu_", "σ": "sigma_", "η": "eta", "'": "_prime", "’": "_prime", "′": "_prime"}


def nearest_word(word: str, known: Iterable[str]) -> str | None:
    """Find the known word that an unknown one was probably meant to be.

    Parameters
    ----------
    word : str
        The unknown word.
    known : iterable of str
        The words that are valid in its place.

    Returns
    -------
    str or None
        None if no known word resembles it.

    Examples
    --------
    >>> nearest_word("mus'", ["sigma_a", "sigma_s", "sigma_s_prime"])
    'sigma_s_prime'
    """
    words = list(known)
    normal = _normalize(word)
    for form in (normal, normal.removesuffix("s")):
        matches = [key for key in words if _normalize(key) == form]
        matches += [key for key in ALIASES.get(form, ()) if key in words]
        if matches:
            return matches[0]
    abbreviated = [key for key in words if _abbreviates(normal, key)]
    if len(abbreviated) == 1:
        return abbreviated[0]
    close = difflib.get_close_matches(normal, words, n=1)
    if close:
        return close[0]
    # A misspelt other name.
    names = [name for name, keys in ALIASES.items() if any(key in words for key in keys)]
    other = difflib.get_close_matches(normal, names, n=1, cutoff=ALIKE)
    return next(key for key in ALIASES[other[0]] if key in words) if other else None


def did_you_mean(word: str, known: Iterable[str], meaning: str = "") -> str:
    """Write the clause of an error message that suggests a known word.

    Parameters
    ----------
    word : str
        The unknown word.
    known : iterable of str
        The words that are valid in its place.
    meaning : str, optional
        What the suggested word means, for the reader.

    Returns
    -------
    str
        Ends in a space; empty if no known word resembles the unknown one.

    Examples
    --------
    >>> did_you_mean("pencill", ["pencil", "point"])
    'did you mean "pencil"? '
    """
    words = list(known)
    remedy = REMEDIES.get(_normalize(word))
    if remedy and remedy[0] in words:
        return remedy[1]
    found = nearest_word(word, words)
    if found is None:
        return ""
    return f'did you mean "{found}"{f" ({meaning})" if meaning else ""}? '


def _normalize(word: str) -> str:
    """Lower case, parts joined by one underscore, Greek letters and primes spelt out."""
    text = word.strip()[:100]
    for letter, name in GREEK.items():
        text = text.replace(letter, name)
    return re.sub(r"[\s_.-]+", "_", text.casefold()).strip("_")


def _abbreviates(short: str, word: str) -> bool:
    """Whether `short`, of at least three letters, joins prefixes of all parts of `word`: sigma_sp, num_ap, tol."""
    parts = word.split("_")
    form = "_?".join("(?:".join(part) + ")?" * (len(part) - 1) for part in parts)
    return len(short) >= 3 and re.fullmatch(form, short) is not None
