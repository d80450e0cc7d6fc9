"""What can go wrong, in two kinds: the request is wrong, or the run failed."""


class TetluxError(Exception):
    """Base of every error that tetlux raises on purpose; its text is one plain sentence."""


class InputError(TetluxError, ValueError):
    """The request itself is wrong: a file, a surface, a coefficient, a light."""


class RunError(TetluxError, RuntimeError):
    """A sound request that could not be carried out: the mesher or the solver failed."""


def memory_ran_out(error: BaseException) -> bool:
    """Whether that is what an error says: Python has another one for a thread that there is no memory for."""
    return isinstance(error, MemoryError) or str(error) == "can't start new thread"
