"""`Note`: a sentence for the user with a code for programs."""

from collections.abc import Iterable


class Note(str):
    """A warning: a sentence with a code that does not depend on its wording.

    It is a `str`, so that it is printed, compared and written to JSON as the sentence.

    Parameters
    ----------
    code : str
        The kind of warning, such as ``"tolerance-missed"``.
    text : str
        The sentence.
    region : str, optional
        The region concerned; the sentence then begins with it.
    value : float, optional
        The figure concerned.

    Examples
    --------
    >>> note = Note("low-albedo", "the reduced albedo is 0.5.", region="core", value=0.5)
    >>> note
    'core: the reduced albedo is 0.5.'
    >>> note.code, note.region, note.value
    ('low-albedo', 'core', 0.5)
    >>> note.with_prefix("in red: ").code
    'low-albedo'
    """

    code: str
    text: str
    region: str | None
    value: float | None
    prefix: str

    def __new__(
        cls, code: str, text: str, region: str | None = None, value: float | None = None, prefix: str = ""
    ) -> "Note":
        """See the class."""
        note = super().__new__(cls, prefix + (text if region is None else f"{region}: {text}"))
        note.code, note.text, note.region, note.value, note.prefix = code, text, region, value, prefix
        return note

    def __getnewargs__(self) -> tuple[str, str, str | None, float | None, str]:  # type: ignore[override]
        return self.code, self.text, self.region, self.value, self.prefix

    def in_region(self, name: str) -> "Note":
        """The same note for a region of this name."""
        return Note(self.code, self.text, name, self.value, self.prefix)

    def with_prefix(self, prefix: str) -> "Note":
        """The same note, with a prefix to its sentence."""
        return Note(self.code, self.text, self.region, self.value, prefix + self.prefix)


def codes_of(warnings: Iterable[str]) -> set[str]:
    """The codes of the warnings that are notes."""
    return {warning.code for warning in warnings if isinstance(warning, Note)}


def add_prefix(warning: str, prefix: str) -> str:
    """A warning with a prefix; a note remains a note."""
    return warning.with_prefix(prefix) if isinstance(warning, Note) else prefix + warning


def in_region(warning: str, name: str) -> str:
    """A warning for a region of this name; a note remains a note."""
    return warning.in_region(name) if isinstance(warning, Note) else f"{name}: {warning}"
