"""The version that is installed, and those of the libraries that it runs with."""

from __future__ import annotations

import platform
import re
from importlib.metadata import PackageNotFoundError, requires, version

__version__ = version("mckibben")


def versions() -> dict[str, str]:
    """Return the versions of this package, Python, the system and all libraries that are installed.

    Libraries are those that the package requires, then those of its extras.
    """
    required = [re.split(r"[^\w.-]", line, maxsplit=1)[0] for line in requires("mckibben") or ()]
    found = {
        "mckibben": __version__,
        "Python": platform.python_version(),
        "system": platform.platform(),
    }
    for name in dict.fromkeys(required):
        try:
            found.setdefault(name, version(name))
        except PackageNotFoundError:
            continue
    return found
