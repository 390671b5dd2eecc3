"""One text per JSON content, for digests."""

from __future__ import annotations

import json


def canonical_json(content: object) -> str:
    """Sorted keys, no spaces, shortest round-trip floats. Raises ValueError for NaN and infinities."""
    return json.dumps(content, sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
