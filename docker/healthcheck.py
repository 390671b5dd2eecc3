"""Asks the service in this container whether it can predict; exits 0 for yes, 1 with a one-line reason for no.

Plain Python, since the image has no curl. Reads ROVER_TWIN_PORT (8000 when not set), as the service does.
"""

from __future__ import annotations

import os
import sys
import urllib.request
from http.client import HTTPException

TIMEOUT_S = 4.0  # less than the HEALTHCHECK's own, so that the reason is still printed


def main() -> int:
    """One request to /health/ready, past any proxy: the service is on this very machine."""
    address = f"http://127.0.0.1:{os.environ.get('ROVER_TWIN_PORT', '8000')}/health/ready"
    opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
    try:
        opener.open(address, timeout=TIMEOUT_S).close()
    # HTTP errors, refused connections and time-outs are OSErrors; nonsense instead of a port or answer is not.
    except (OSError, HTTPException) as fault:
        print(f"not ready: {fault}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
