"""Case files, batches, pictures and the command line."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tetlux.cases.results.load import RunResult, Volume, load_result, load_results

__all__ = ["RunResult", "Volume", "load_result", "load_results"]


def __getattr__(name: str) -> Any:
    """Import what loads results when it is asked for: the command line answers --help without numpy."""
    if name in __all__:
        from tetlux.cases.results import load  # noqa: PLC0415

        return getattr(load, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
