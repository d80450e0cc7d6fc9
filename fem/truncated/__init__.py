"""Only the part of a body that light reaches: ``solve(..., model="truncated")``.

part      the part: how far light matters, and the body and its regions cut there
solution  `TruncatedSolution`
solve     makes one
"""

from tetlux.fem.truncated.solution import TruncatedSolution

__all__ = ["TruncatedSolution"]
