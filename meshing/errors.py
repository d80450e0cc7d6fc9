"""What can go wrong, in two kinds: the request is wrong, or the run failed."""


class TetluxError(Exception):
    """Base of every error that tetlux raises on purpose; its text is one plain sentence."""


class InputError(TetluxError, ValueError):
    """The request itself is wrong: a file, a surface, a coefficient, a light."""


class RunError(TetluxError, RuntimeError):
    """A sound request that could not be carried out: the mesher or the solver failed."""
