"""The two kinds of errors: the request is wrong, or the run failed."""

from functools import partial
from typing import Any

# Characters of a message; longer ones lose their middle, since a quoted name can have any length.
LONGEST_SENTENCE = 900


class TetluxError(Exception):
    """Base of all errors that tetlux raises deliberately; the text is one sentence on one printable line."""

    def __init__(self, sentence: str) -> None:
        if len(sentence) > LONGEST_SENTENCE:
            sentence = f"{sentence[: LONGEST_SENTENCE // 2]} ... {sentence[-LONGEST_SENTENCE // 2 :]}"
        super().__init__(
            "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in sentence)
        )


class InputError(TetluxError, ValueError):
    """The request itself is wrong: a file, a surface, a coefficient, a light.

    Parameters
    ----------
    text : str
        What is wrong: a whole sentence, or its first half if a remedy follows.
    field : str, optional
        The wrong argument or key, by the caller's name for it.
    remedy : str, optional
        What to do about it.
    """

    def __init__(self, text: str, *, field: str | None = None, remedy: str | None = None) -> None:
        super().__init__(text if remedy is None else f"{text}; {remedy}.")
        self.text, self.field, self.remedy = text, field, remedy

    def about(self, field: str) -> "InputError":
        """The same error with the argument or key that it concerns."""
        return InputError(self.text, field=field, remedy=self.remedy)

    def __reduce__(self) -> tuple[Any, ...]:
        return partial(InputError, field=self.field, remedy=self.remedy), (self.text,)


class RunError(TetluxError, RuntimeError):
    """A valid request could not be carried out: the mesher or the solver failed."""


def memory_ran_out(error: BaseException) -> bool:
    """Whether an error means that memory ran out; Python raises RuntimeError if it is memory for a thread."""
    return isinstance(error, MemoryError) or str(error) == "can't start new thread"
