"""`Tolerances`: what a mesh is refined for, and how far solutions on it are from that."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from tetlux.fem.error.tolerance import MOST_ROUNDS, cells_to_split, height_ratio, splits_for_fields, splits_for_readings
from tetlux.fem.outcome.detectors import PlacedDetector, estimate_reading
from tetlux.fem.quadratic.field_error import field_errors
from tetlux.fem.quadratic.reading_error import ReadingError
from tetlux.fem.quadratic.solution import Where
from tetlux.fem.system import MeshSolution
from tetlux.meshing.arrays import FloatArray, IntArray

# How progress lines call errors of fields.
FIELD_NAMES: dict[Where, str] = {"surface": "everywhere", "inside": "inside"}


@dataclass(frozen=True, eq=False)
class Tolerances:
    """What a mesh is refined for: wanted errors.

    Attributes
    ----------
    exitance : float, optional
        Wanted relative L2 error of the exitance.
    readings : float, optional
        Wanted relative error of what each detector reads.
    placed : tuple of PlacedDetector
        The detectors of all scenes.
    of_scenes : tuple of tuple of PlacedDetector
        Those of each scene, where scenes differ in them.
    everywhere, volume : float, optional
        Wanted relative error of the exitance at almost every point of the surface, and of the fluence inside: see
        `tetlux.fem.quadratic.field_error`.
    """

    exitance: float | None
    readings: float | None = None
    placed: tuple[PlacedDetector, ...] = ()
    everywhere: float | None = None
    volume: float | None = None
    of_scenes: tuple[tuple[PlacedDetector, ...], ...] = ()

    def placed_in(self, scene: int) -> tuple[PlacedDetector, ...]:
        """The detectors of a scene."""
        return self.of_scenes[scene] if self.of_scenes else self.placed

    def places_in(self, scene: int) -> tuple[FloatArray, float] | None:
        """Where the detectors of a scene are (d, 3), and their tolerance, if they have one."""
        placed = self.placed_in(scene)
        if self.readings is None or not placed:
            return None
        return np.array([each.position for each in placed]), self.readings

    @property
    def fields(self) -> dict[Where, float]:
        """Those of the exitance everywhere and of the fluence inside that are given."""
        given: dict[Where, float | None] = {"surface": self.everywhere, "inside": self.volume}
        return {where: tolerance for where, tolerance in given.items() if tolerance is not None}

    @property
    def need_quadratic(self) -> bool:
        """Whether quadratic elements are solved for on each mesh."""
        return self.readings is not None or len(self.fields) > 0

    def assess(self, by_scene: Mapping[int, MeshSolution], *, rounds: int = MOST_ROUNDS) -> "Assessment":
        """Compare the errors of solutions of scenes, by their number, on one mesh with the tolerances.

        Tetrahedra are split for the exitance in so many rounds at most.
        """
        steps = list(by_scene.values())
        splits = np.zeros(len(steps[0].solution.mesh.tetrahedra), dtype=np.int64)
        error = max(step.estimate.error for step in steps)
        largest_ratio, heights, summary = 0.0, 1.0, f"estimated error {error:.2%}"
        if self.exitance is not None:
            largest_ratio = error / self.exitance
            estimates = [step.estimate for step in steps]
            splits += cells_to_split(estimates, self.exitance, rounds)
            heights = height_ratio(estimates, self.exitance)
        if self.readings is not None:
            readings = [reading for scene, step in by_scene.items() for reading in self._read(scene, step)]
            of_readings = max((reading.relative for reading in readings), default=0.0)
            largest_ratio = max(largest_ratio, of_readings / self.readings)
            # A reading of next to nothing may be off by many thousands of times itself.
            summary += f", of readings {of_readings:.2%}" if of_readings <= 1.0 else ", of readings above 100%"
            splits = np.maximum(splits, splits_for_readings(readings, self.readings, len(splits)))
        for where, tolerance in self.fields.items():
            bands = [band for step in steps for band in _bands(step, where)]
            error = max((band.relative for band in bands), default=0.0)
            largest_ratio = max(largest_ratio, error / tolerance)
            summary += f", {FIELD_NAMES[where]} {error:.2%}"
            splits = np.maximum(splits, splits_for_fields(bands, tolerance, len(splits)))
        return Assessment(largest_ratio, splits, heights, summary)

    def _read(self, scene: int, step: MeshSolution) -> list[ReadingError]:
        quadratic = step.solution.quadratic
        assert quadratic is not None
        parts = quadratic.prepare([placed.measurement for placed in self.placed_in(scene)])
        return [estimate_reading(step.solution, measurement) for some in parts for measurement in some]


def _bands(step: MeshSolution, where: Where) -> list[ReadingError]:
    quadratic = step.solution.quadratic
    assert quadratic is not None
    return field_errors(quadratic, where)


@dataclass(frozen=True, eq=False)
class Assessment:
    """How far solutions on one mesh are from the tolerances.

    Attributes
    ----------
    largest_error_ratio : float
        The largest ratio of an estimated error to its tolerance.
    splits : (m,) ndarray of int
        How often to split each tetrahedron.
    heights : float
        What to multiply the heights of layers by.
    summary : str
        The errors, in a few words.
    """

    largest_error_ratio: float
    splits: IntArray
    heights: float
    summary: str
