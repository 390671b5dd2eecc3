"""The service over the shipped models, as the tests of the API have it."""

from __future__ import annotations

from tests.api.conftest import shipped

__all__ = ["shipped"]
