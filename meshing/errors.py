"""What can go wrong, in two kinds: the request is wrong, or the run failed."""

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
    """The request itself is wrong: a file, a surface, a coefficient, a light."""


class RunError(TetluxError, RuntimeError):
    """A sound request that could not be carried out: the mesher or the solver failed."""


def memory_ran_out(error: BaseException) -> bool:
    """Whether that is what an error says: Python has another one for a thread that there is no memory for."""
    return isinstance(error, MemoryError) or str(error) == "can't start new thread"
