"""What made a version: our code and the libraries under it."""

from __future__ import annotations

import platform
import subprocess
from importlib import metadata
from pathlib import Path

import service

_LIBRARIES = (
    "torch", "numpy", "scipy", "safetensors", "pyarrow", "pydantic", "obstore", "matplotlib", "dbos", "sqlalchemy",
)  # fmt: skip


def library_versions() -> dict[str, str]:
    """Versions of Python and of the libraries that read, compute, draw, store and order the steps of a training."""
    return {"python": platform.python_version()} | {name: metadata.version(name) for name in _LIBRARIES}


def code_version() -> str:
    """Our version, with the commit where the code lies in a git checkout ("+changes" when that differs from it)."""
    root = Path(service.__file__).resolve().parent.parent
    if not (root / ".git").exists():
        return service.__version__
    commit = _git(root, "rev-parse", "--short=12", "HEAD")
    changed = _git(root, "status", "--porcelain", "--untracked-files=no", "--", "service", "model_store/*.py")
    if commit is None:
        return service.__version__
    return f"{service.__version__} commit {commit}" + ("+changes" if changed else "")


def _git(root: Path, *arguments: str) -> str | None:
    """Output of a git command, None where git is missing or refuses."""
    try:
        done = subprocess.run(  # noqa: S603 - fixed arguments
            ["git", "-C", str(root), *arguments],  # noqa: S607 - git is where the user has it
            capture_output=True,
            text=True,
            timeout=10,
            check=True,
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.strip()
