"""What can go wrong, in two kinds: the request is wrong, or the run failed."""

from functools import partial
from typing import Any

# What is longer is cut in its middle: a sentence may quote a name of a megabyte.
LONGEST = 900


class TetluxError(Exception):
    """Base of every error that tetlux raises on purpose; its text is one plain sentence, on one printable line."""

    def __init__(self, sentence: str) -> None:
        if len(sentence) > LONGEST:
            sentence = f"{sentence[: LONGEST // 2]} ... {sentence[-LONGEST // 2 :]}"
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
        The argument or key that is wrong, as its caller knows it.
    remedy : str, optional
        What to do about it.
    """

    def __init__(self, text: str, *, field: str | None = None, remedy: str | None = None) -> None:
        super().__init__(text if remedy is None else f"{text}; {remedy}.")
        self.text, self.field, self.remedy = text, field, remedy

    def about(self, field: str) -> "InputError":
        """The same error, of a field that what raised it does not know."""
        return InputError(self.text, field=field, remedy=self.remedy)

    def __reduce__(self) -> tuple[Any, ...]:
        return partial(InputError, field=self.field, remedy=self.remedy), (self.text,)


class RunError(TetluxError, RuntimeError):
    """A sound request that could not be carried out: the mesher or the solver failed."""


def memory_ran_out(error: BaseException) -> bool:
    """Whether that is what an error says: Python has another one for a thread that there is no memory for."""
    return isinstance(error, MemoryError) or str(error) == "can't start new thread"
