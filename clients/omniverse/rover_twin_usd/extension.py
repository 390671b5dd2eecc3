"""What Omniverse Kit starts: a window, and nothing else. Runs inside Kit alone."""

from __future__ import annotations

import omni.ext

from rover_twin_usd.window import RoverTwinWindow


class RoverTwinExtension(omni.ext.IExt):  # type: ignore[misc] # Kit has no types
    """Opens the window with the extension and closes it with it."""

    def on_startup(self, ext_id: str) -> None:  # noqa: ARG002 - Kit's signature
        """Called by Kit."""
        self._window: RoverTwinWindow | None = RoverTwinWindow()

    def on_shutdown(self) -> None:
        """Called by Kit."""
        if self._window is not None:
            self._window.destroy()
            self._window = None
