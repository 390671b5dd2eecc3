"""Predicted drives on USD stages. Needs `pxr` and the standard library; only `extension` and `window` need Kit."""

from __future__ import annotations

__version__ = "0.1.0"
