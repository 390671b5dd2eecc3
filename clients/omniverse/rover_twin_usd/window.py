"""The window: a question, the selected rover, and buttons. Everything else is in `showing` and `service`.

Runs inside Kit alone, so no test of this project has run it.
"""

from __future__ import annotations

import asyncio
import json
from pathlib import Path
from typing import Any

import omni.timeline
import omni.ui as ui
import omni.usd

from rover_twin_usd.failures import RoverTwinUsdError, StageError
from rover_twin_usd.service import USUAL_ADDRESS, Service
from rover_twin_usd.showing import Shown, hide, show
from rover_twin_usd.standing import Wishes

_NUMBERS = {
    "slope_deg": ("slope, degrees", 20.0),
    "mass_kg": ("mass, kg", 430.0),
    "torque_nm": ("torque of each wheel, N m", 80.0),
    "horizon_s": ("seconds", 10.0),
}
_LABEL_WIDTH = 170


class RoverTwinWindow:
    """Asks the service on a thread of its own; the stage is only touched on Kit's."""

    def __init__(self) -> None:
        self._window = ui.Window("Rover Twin", width=420, height=330)
        self._numbers = {name: ui.SimpleFloatModel(value) for name, (_, value) in _NUMBERS.items()}
        self._address = ui.SimpleStringModel(USUAL_ADDRESS)
        self._file = ui.SimpleStringModel("")
        self._prim = ui.SimpleStringModel("")
        self._forward = ui.SimpleStringModel("X")
        self._asking: asyncio.Future[None] | None = None
        with self._window.frame, ui.VStack(spacing=4):
            self._text("service", self._address)
            with ui.HStack(height=24):
                ui.Label("rover", width=_LABEL_WIDTH)
                ui.StringField(self._prim)
                ui.Button("selected", width=80, clicked_fn=self._take_selection)
            self._text("its axis that looks ahead", self._forward)
            for name, (label, _) in _NUMBERS.items():
                with ui.HStack(height=24):
                    ui.Label(label, width=_LABEL_WIDTH)
                    ui.FloatDrag(self._numbers[name])
            self._text("or a drive's JSON file", self._file)
            with ui.HStack(height=28):
                ui.Button("Predict", clicked_fn=self._predict)
                ui.Button("Take away", clicked_fn=self._take_away)
            self._said = ui.Label("", word_wrap=True)

    def destroy(self) -> None:
        """Close the window. What is on the stage stays."""
        if self._asking is not None:
            self._asking.cancel()
        self._window.destroy()

    def _text(self, label: str, model: Any) -> None:  # noqa: ANN401 - one of Kit's
        with ui.HStack(height=24):
            ui.Label(label, width=_LABEL_WIDTH)
            ui.StringField(model)

    def _take_selection(self) -> None:
        paths = omni.usd.get_context().get_selection().get_selected_prim_paths()
        self._prim.set_value(paths[0] if paths else "")

    def _take_away(self) -> None:
        if (stage := omni.usd.get_context().get_stage()) is not None:
            hide(stage)
        self._said.text = ""

    def _predict(self) -> None:
        if self._asking is None or self._asking.done():
            self._asking = asyncio.ensure_future(self._ask())

    async def _ask(self) -> None:
        self._said.text = "asking"
        try:
            question, service = self._question(), Service(self._address.get_value_as_string())
            loop = asyncio.get_running_loop()
            (answer, *_) = await loop.run_in_executor(None, lambda: list(service.answers(question)))
            stage = omni.usd.get_context().get_stage()
            if stage is None:
                raise StageError("no stage is open")
            wishes = Wishes(self._forward.get_value_as_string().strip().upper() or "X")
            shown = show(stage, self._prim.get_value_as_string(), answer, wishes)
        except (RoverTwinUsdError, OSError, ValueError) as error:
            self._said.text = str(error)
            return
        self._said.text = "\n".join(shown.notes)
        _play(shown)

    def _question(self) -> dict[str, Any]:
        file = self._file.get_value_as_string().strip()
        if file:
            found: dict[str, Any] = json.loads(Path(file).read_text())
            return found
        return {name: model.get_value_as_float() for name, model in self._numbers.items()} | {"include": ["speed"]}


def _play(shown: Shown) -> None:
    """Kit's timeline counts in seconds."""
    timeline = omni.timeline.get_timeline_interface()
    timeline.set_start_time(shown.first / shown.per_second)
    timeline.set_end_time(shown.last / shown.per_second)
    timeline.set_current_time(shown.first / shown.per_second)
