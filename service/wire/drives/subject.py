"""A drive to write, in every form that a prediction has."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy.typing as npt

from service.twin import Loaded
from service.twin.drives import Drive, DriveDomain
from service.wire.drives.side import side_of
from service.wire.forms.subject import ColumnTexts, Picture, Stage, headers_of, model_of, unit_of

_LABELS = {
    "slope": "x, m\nalong the track",
    "world": "x, m\nhorizontal",
}
_MOST_MARKS = 12
_UNITS = {"brake": "", "slip_ratio": "1", "slope_deg": "deg", "torque_nm": "N m"}


@dataclass(frozen=True, slots=True, eq=False)
class DriveSubject:
    """One drive. Its band is written whenever it has one: it has none unless asked for. A `Writable`."""

    loaded: Loaded
    drive: Drive

    def columns(self) -> Mapping[str, npt.NDArray[Any]]:
        """Trajectory and band."""
        band = self.drive.band
        return self.drive.trajectory if band is None else {**self.drive.trajectory, **band.columns()}

    def scalars(self) -> Mapping[str, object]:
        """Summary, events and stretches."""
        return {
            "summary": self.drive.summary,
            "events": self.drive.events,
            "stretches": self.drive.domain.stretches,
        }

    def echo(self) -> dict[str, Any]:
        """The drive as it was understood."""
        asked = self.drive.question
        return {
            "mass_kg": asked.mass_kg,
            "knots": len(asked.ground.distance_m),
            "controls": len(asked.controls.time_s),
            "start_speed_m_s": asked.start_speed_m_s,
            "horizon_s": asked.horizon_s,
            "until_distance_m": asked.until_distance_m,
        }

    def groups(self) -> Mapping[str, Mapping[str, npt.NDArray[Any]]]:
        """`trajectory`, and `band` where asked for."""
        band = {} if self.drive.band is None else {"band": self.drive.band.columns()}
        return {"trajectory": self.drive.trajectory, **band}

    def answer(self, texts: ColumnTexts) -> dict[str, Any]:
        """`service.wire.drives.answer.DriveAnswer`."""
        drive = self.drive
        answer: dict[str, Any] = {
            "model": model_of(self.loaded),
            "drive": self.echo(),
            "frame": drive.frame,
            "trajectory": texts["trajectory"],
        }
        if drive.band is not None:
            answer["band"] = {"level": drive.band.level, **texts["band"]}
        return answer | self.rest()

    def rest(self) -> dict[str, Any]:
        """What stands behind the columns in the answer."""
        drive = self.drive
        return {
            "events": drive.events,
            "events_left_out": drive.events_left_out,
            "summary": drive.summary,
            "domain": domain_of(drive.domain),
        }

    def about(self) -> dict[str, Any]:
        """Everything that is no column."""
        drive = self.drive
        band = {} if drive.band is None else {"band": {"level": drive.band.level}}
        return {
            "model": model_of(self.loaded),
            "drive": self.echo(),
            "frame": drive.frame.value,
            "units": {name: unit_of_drive(name) for name in self.columns()},
            **self.rest(),
            **band,
        }

    def headers(self) -> dict[str, str]:
        """Model, frame, domain, outcome and the band's level, if there is one."""
        drive = self.drive
        level = {} if drive.band is None else {"Rover-Twin-Band-Level": f"{drive.band.level:.12g}"}
        return {
            **headers_of(self.loaded, drive.frame, drive.domain.inside),
            "Rover-Twin-Outcome": drive.summary.outcome.value,
            **level,
        }

    def picture(self) -> Picture:
        """The track from the side; position, speed, slip, slope and torque with the events; shaded while braking."""
        drive, twin = self.drive, self.loaded.twin
        outside = "" if drive.domain.inside else ", partly OUTSIDE the domain: extrapolated"
        band = "" if drive.band is None else f", band {drive.band.level:.3g}"
        title = (
            f"Drive of {drive.question.mass_kg:g} kg over {drive.summary.duration_s:.4g} s: "
            f"{drive.summary.outcome}{outside}\n{twin.name}@{twin.version}, {drive.frame} frame{band}"
        )
        where = drive.position_names[0], _LABELS[drive.frame]
        more = (
            ("speed_m_s", "speed\nm/s"),
            ("slip_ratio", "slip ratio"),
            ("slope_deg", "slope, °\nunder the middle"),
            ("torque_nm", "torque\nN m"),
        )
        marks = tuple((each.time_s, each.event.value.replace("_", " ")) for each in drive.events[:_MOST_MARKS])
        return Picture(
            title,
            (where, *more),
            marks,
            held=("torque_nm",),
            shaded="brake",
            hatched=tuple((each.from_s, each.to_s) for each in drive.domain.stretches if not each.inside),
            description=self._told(),
            side=side_of(drive, twin.model.prior.rover, _MOST_MARKS),
        )

    def _told(self) -> str:
        """What the picture shows, in sentences."""
        drive, found = self.drive, self.drive.summary
        events = ", ".join(f"{each.event.value.replace('_', ' ')} at {each.time_s:.3g} s" for each in drive.events[:5])
        return (
            f"The track from the side with the way of the rover; below it position, speed, slip ratio, slope and "
            f"torque against time. The rover {found.outcome.value}: after {found.duration_s:.4g} s it is "
            f"{found.final_x_m:.3g} m along the track. Events: {events or 'none'}. The drive is "
            f"{'inside' if drive.domain.inside else 'partly outside'} the model's domain."
        )

    def stage(self) -> Stage:
        """The world in both frames, since a track bends; the rover's pitch is the slope under its middle."""
        drive, twin = self.drive, self.loaded.twin
        across, up = drive.world_m()
        doc = (
            f"{twin.name}@{twin.version}: rear wheel's centre of a rover on a track; columns in the {drive.frame} frame"
        )
        return Stage(across, up, drive.trajectory["slope_deg"], doc)


def unit_of_drive(column: str) -> str:
    """The unit of a column; empty for true and false."""
    return _UNITS[column] if column in _UNITS else unit_of(column)


def domain_of(domain: DriveDomain) -> dict[str, Any]:
    """The verdict as every answer shows it."""
    stretches = [
        {
            "from_m": each.from_m,
            "to_m": each.to_m,
            "from_s": each.from_s,
            "to_s": each.to_s,
            "inside": each.inside,
            "reasons": [asdict(reason) | {"detail": reason.detail} for reason in each.reasons],
        }
        for each in domain.stretches
    ]
    return {"inside": domain.inside, "stretches": stretches, "left_out": domain.left_out}
