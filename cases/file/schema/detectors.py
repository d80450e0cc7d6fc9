"""The sections of the case file that describe detectors."""

from tetlux.cases.file.schema.parts import Choice, Label, Number, Vector3
from tetlux.cases.file.schema.spots import DiscSpec
from tetlux.fem.outcome.detector_kinds import Detector, DiscDetector, FibreDetector, PointDetector


class FibreSpec(DiscSpec):
    """An optical fibre whose end touches the surface."""

    numerical_aperture: Number


class DetectorSpec(Choice):
    """A detector on the surface, see `tetlux.fem.outcome.detector_kinds`."""

    name: Label
    point: Vector3 | None = None
    disc: DiscSpec | None = None
    fibre: FibreSpec | None = None

    def detector(self) -> Detector:
        """Build the detector.

        Raises
        ------
        InputError
            If a number is out of range.
        """
        if self.point is not None:
            return PointDetector(self.point)
        if self.disc:
            return DiscDetector(**dict(self.disc))
        assert self.fibre is not None
        return FibreDetector(**dict(self.fibre))
