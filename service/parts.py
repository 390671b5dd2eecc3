"""What an installation may lack, and the only place that knows it: the serving image has no PyTorch, SciPy, Matplotlib.

Nothing is imported here. Who needs a part says so with `require` before importing its libraries.
"""

from __future__ import annotations

import importlib.util
from functools import cache

from service.errors import MissingPartError

PICTURES, TRAINING = "pictures", "training"
_LIBRARIES = {PICTURES: ("matplotlib",), TRAINING: ("torch", "scipy", "matplotlib")}
_NAMES = {"torch": "PyTorch", "scipy": "SciPy", "matplotlib": "Matplotlib"}
_WHERE = "the whole image, rover-twin, and an ordinary installation have it"


def has(part: str) -> bool:
    """Whether its libraries are installed."""
    return not _missing(part)


def require(part: str, what: str) -> None:
    """Raises MissingPartError, unless the libraries of the part are installed; `what` cannot be done without them."""
    if missing := _missing(part):
        raise MissingPartError(_reason(what, *missing))


def missing_part(error: ImportError) -> MissingPartError | None:
    """The error to report for one that an import raised, if it is about a library that may be missing."""
    library = (error.name or "").partition(".")[0]
    if library not in _NAMES or _installed(library):
        return None
    return MissingPartError(_reason("this", library))


def _missing(part: str) -> tuple[str, ...]:
    return tuple(library for library in _LIBRARIES[part] if not _installed(library))


def _reason(what: str, *libraries: str) -> str:
    return f"{what} needs {' and '.join(_NAMES[each] for each in libraries)}, not installed here; {_WHERE}"


@cache
def _installed(library: str) -> bool:
    try:
        return importlib.util.find_spec(library) is not None
    except ModuleNotFoundError:
        return False
