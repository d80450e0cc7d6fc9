"""Which libraries are installed: those without a wheel for every platform may be missing."""

from collections.abc import Iterable
from functools import cache
from importlib.metadata import PackageNotFoundError, version


def installed_versions(names: Iterable[str]) -> dict[str, str]:
    """The version of each distribution of these names that is installed."""
    versions = {name: _version_of(name) for name in names}
    return {name: found for name, found in versions.items() if found is not None}


@cache
def _version_of(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None
