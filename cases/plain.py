"""Numbers as plain data: JSON has no nan and no infinity."""

import math


def finite(value: float | None) -> float | None:
    """A number, or None if it is not finite."""
    return value if value is not None and math.isfinite(value) else None
