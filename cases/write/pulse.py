"""Light in time: ``pulse.csv``, arrays of the surface at each time, and the film of the surface as a pulse spreads."""

import csv
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tetlux.cases.file.channels import ALL
from tetlux.cases.write.results import Results
from tetlux.fem.transient.transient import Transient
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.describe import one_line

if TYPE_CHECKING:
    from tetlux.cases.picture.draw import PictureScene

# More times are not arrays of the surface, nor frames of the film: there is one for every second, third, ... time.
MOST_ARRAYS, MOST_FRAMES = 24, 60
PULSE_FILES = ("pulse.csv", "film.gif")
# The colours of a film span so many decades.
DECADES = 4.0


class PulseResults:
    """What a pulse leaves at the vertices of the written surface, and at detectors.

    Parameters
    ----------
    results : Results
        With a `Transient` for each channel.
    """

    def __init__(self, results: Results) -> None:
        self.results = results

    @cached_property
    def exitance(self) -> FloatArray:
        """Exitance at the vertices, of all channels, (t, v), W/unit² per J; nan where it is not resolved in any."""
        points = self.results.surface.points
        return _sum([transient.exitance_at(points) for transient in self.results.transients])

    @cached_property
    def readings(self) -> FloatArray:
        """What detectors read of all channels, (t, d), W/unit² per J; nan where it is not resolved in any."""
        return _sum([transient.readings for transient in self.results.transients])

    @property
    def times(self) -> FloatArray:
        """Times, (t,), s."""
        return self.results.transients[0].times

    def arrays(self) -> dict[str, FloatArray]:
        """Arrays of the surface, by names such as ``exitance_50ps``."""
        return {f"exitance_{picoseconds(time)}": values for time, values in self.some(MOST_ARRAYS)}

    def some(self, most: int) -> list[tuple[float, FloatArray]]:
        """Times, s, and the exitance then, (v,): all of them, or every second, third, ... of too many."""
        return [(float(self.times[i]), self.exitance[i]) for i in _spread(len(self.times), most)]

    def some_readings(self, most: int) -> list[dict[str, float]]:
        """What each detector reads, by its name, at the times of `some`."""
        names = [detector.name for detector in self.results.case.detectors]
        rows = self.readings if names else np.empty((len(self.times), 0))
        return [dict(zip(names, rows[i].tolist(), strict=True)) for i in _spread(len(self.times), most)]

    def ends(self) -> tuple[float, float] | None:
        """The ends of one logarithmic scale for all times; None if no light leaves."""
        brightest = float(np.nanmax(self.exitance, initial=0.0))
        return (brightest / 10.0**DECADES, brightest) if brightest > 0 else None

    def write(self, readings: list[dict[str, Any]], folder: Path) -> None:
        """Write what detectors read, if there are some, and the film, if it is among the outputs."""
        csv_name, film_name = PULSE_FILES
        if self.results.case.detectors:
            self.write_readings(folder / csv_name)
        if "film" in self.results.case.outputs:
            from tetlux.cases.write.pictures import picture_scene  # noqa: PLC0415

            self.draw_film(picture_scene(self.results, readings), folder / film_name)

    def write_readings(self, path: Path) -> None:
        """Write what each detector reads at each time."""
        case = self.results.case
        unit = case.surface.unit
        with path.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            quantities = [f"exitance [W/{unit}² per J]", "power [W per J]", "relative_error"]
            writer.writerow(["name", "kind", "channel", "light", "time [s]", *quantities])
            for channel, transient in zip(case.channels, self.results.transients, strict=True):
                parts = [(ALL, transient), *zip(channel.lights, transient.of_lights, strict=False)]
                for light, part in parts:
                    for number, entry in enumerate(case.detectors):
                        names = [entry.name, entry.kind, channel.name, light]
                        writer.writerows([*names, *row] for row in _rows(part, number))

    def draw_film(self, scene: "PictureScene", path: Path) -> None:
        """Draw the surface at each time, all in one scale."""
        from tetlux.cases.picture.draw import draw_film  # noqa: PLC0415
        from tetlux.cases.picture.scale import scale_of  # noqa: PLC0415

        ends = self.ends() or (None, None)
        scale = scale_of(np.nan_to_num(self.exitance).ravel(), "exitance", f"W/{scene.unit}² per J", ends=ends)
        frames = [
            replace(
                scene,
                values=np.nan_to_num(values),
                scale=scale,
                colours=None,
                title=f"{scene.title}, {time * 1e12:.4g} ps",
            )
            for time, values in self.some(MOST_FRAMES)
        ]
        draw_film(frames, path)

    __repr__ = one_line


def picoseconds(time: float) -> str:
    """A time in the name of an array."""
    return f"{time * 1e12:.6g}ps"


def _sum(each: Sequence[FloatArray]) -> FloatArray:
    """The sum over channels, (channel, ...); nan where none is known."""
    values = np.array(each)
    return np.where(np.isfinite(values).any(axis=0), np.nansum(values, axis=0), np.nan)


def _spread(count: int, most: int) -> list[int]:
    """Numbers of all items, or of every second, third, ... of too many."""
    return list(range(0, count, -(-count // most)))


def _rows(transient: Transient, detector: int) -> list[list[str]]:
    """Time, exitance, power and relative error of one detector; what is not resolved is empty."""
    rows = []
    relative = transient.errors / transient.readings
    columns = transient.readings, transient.powers, relative
    for number, time in enumerate(transient.times.tolist()):
        figures = [float(column[number, detector]) for column in columns]
        rows.append([repr(time), *("" if np.isnan(value) else f"{value:.9g}" for value in figures)])
    return rows
