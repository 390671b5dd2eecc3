"""What the form (or options) say of runs, where runs.csv and the rows of a run do not say it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from service.datasets.columns import INPUTS
from service.datasets.findings import Code, Finding, UnusableFileError, warn

if TYPE_CHECKING:
    from service.datasets.readers.table import Samples
    from service.datasets.run_table import RunEntry


@dataclass(frozen=True, slots=True)
class Given:
    """`values` are slope_deg, mass_kg, torque_nm and horizon_s, as far as given; `used` are those that some run needed.

    `set_name` is the set of the runs that name none.
    """

    values: Mapping[str, float] = field(default_factory=dict)
    set_name: str = "default"
    used: set[str] = field(default_factory=set)

    def value(self, name: str) -> float | None:
        """What is given for a cell of runs.csv that says nothing; it then counts as used."""
        if name in self.values:
            self.used.add(name)
        return self.values.get(name)

    def name_of_set(self) -> str:
        """The same for a set."""
        self.used.add("set_name")
        return self.set_name

    def unused(self, why: str) -> list[Finding]:
        """A word about everything that was given and that no run needed."""
        given: dict[str, float | str] = {
            **self.values,
            **({} if self.set_name == "default" else {"set_name": self.set_name}),
        }
        return [
            warn("form", Code.IGNORED_FIELD, f"{name} {value!r} is not used: {why}", column=name)
            for name, value in given.items()
            if name not in self.used
        ]

    def over(self, entry: RunEntry, read: Callable[[], Samples]) -> tuple[RunEntry, Callable[[], Samples]]:
        """The entry with slope and torque that neither it nor its rows say. `read` is called now, and not again."""
        missing = [name for name in self.values if name in INPUTS and getattr(entry, name) is None]
        if not missing:
            return entry, read
        try:
            samples = read()
        except UnusableFileError:
            return entry, read
        filled = {name: self.value(name) for name in missing if name not in samples.columns}
        return replace(entry, **filled), lambda: samples  # type: ignore[arg-type]
