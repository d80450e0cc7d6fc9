"""`Request`: what is asked for, which decides what a scene needs."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

from tetlux.fem.assessment import Tolerances
from tetlux.fem.body.body import Body
from tetlux.fem.inputs import DEFAULT_TOLERANCE
from tetlux.fem.known.split import check_scenes
from tetlux.fem.labels import GivenMedia
from tetlux.fem.media.coefficients import AnyMedium
from tetlux.fem.media.region import Region
from tetlux.fem.meshless.closed_form import homogeneous
from tetlux.fem.meshless.exact_field import ExactField, exact_field
from tetlux.fem.outcome.detector_kinds import Detector
from tetlux.fem.outcome.detectors import PlacedDetector, place_detector
from tetlux.fem.outcome.exitance_field import Dark
from tetlux.fem.planner.costs import Costs, read_costs
from tetlux.fem.scenes import build_scenes
from tetlux.fem.solve_scenes import check_tolerances
from tetlux.fem.sources.deposit import Deposit
from tetlux.fem.sources.light import Light
from tetlux.fem.truncated.part import Box, dark_box
from tetlux.meshing.describe import one_line
from tetlux.meshing.errors import InputError
from tetlux.meshing.mesher.api import is_cached
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh


@dataclass(frozen=True, eq=False)
class Request:
    """What is asked for.

    Attributes
    ----------
    surface : Surface
    inner : tuple of Surface
        Of the regions.
    bodies : tuple of Body
        The body with its media in each scene.
    lights : tuple of sequence of Light
        Of each scene.
    deposits : tuple of tuple of Deposit
        What each light of each scene leaves in the body.
    tolerances : Tolerances
    detectors : tuple of Detector
    mesh : TetMesh, optional
        A mesh that is used as it is.
    need_of_mesh : str
        Why a mesh is needed in any case; empty if it is not.
    runs : int
        Number of runs like this one, which share what can be shared.
    costs : Costs
        What past runs took.
    is_meshed : bool
        Whether the cache has the mesher's mesh of the body.
    frequencies : tuple of float
        Of the light of each scene, Hz; 0 where it is steady.
    outside_index : float
        Refractive index of what surrounds the body.
    """

    surface: Surface
    inner: tuple[Surface, ...]
    bodies: tuple[Body, ...]
    lights: tuple[Sequence[Light], ...]
    deposits: tuple[tuple[Deposit, ...], ...]
    tolerances: Tolerances
    detectors: tuple[Detector, ...]
    mesh: TetMesh | None
    need_of_mesh: str = ""
    runs: int = 1
    costs: Costs = field(default_factory=Costs)
    is_meshed: bool = False
    frequencies: tuple[float, ...] = ()
    outside_index: float = 1.0

    @property
    def exitance_tolerance(self) -> float:
        """The tolerance of the exitance, or the default where there is none."""
        return self.tolerances.exitance or DEFAULT_TOLERANCE

    @property
    def is_modulated(self) -> bool:
        """Whether light is modulated in some scene."""
        return any(self.frequencies)

    @property
    def points(self) -> int:
        """Number of points at which the exitance will be asked for, about."""
        return len(self.surface.points) if self.tolerances.exitance is not None else len(self.detectors)

    @cached_property
    def dark_box(self) -> Box:
        """The box beyond which the body is dark.

        Raises
        ------
        InputError
            If light enters or reaches everywhere.
        """
        return dark_box(self.bodies, self.deposits, self.exitance_tolerance)

    @cached_property
    def exact_fields(self) -> tuple[ExactField, ...]:
        """The closed form of each scene.

        Raises
        ------
        InputError
            If there is none.
        """
        return tuple(
            exact_field(self.surface.shape, homogeneous(body), deposits)
            for body, deposits in zip(self.bodies, self.deposits, strict=True)
        )

    __repr__ = one_line


def make_request(
    body: Surface | TetMesh,
    medium: AnyMedium | GivenMedia | Sequence[AnyMedium | GivenMedia],
    scenes: Sequence[Sequence[Light]],
    *,
    regions: Sequence[Region] = (),
    tolerances: Tolerances,
    detectors: Sequence[Detector] = (),
    mesh: TetMesh | None = None,
    need_of_mesh: str = "",
    runs: int = 1,
    cache: bool = True,
    frequency: float | Sequence[float] = 0.0,
    outside_index: float = 1.0,
) -> Request:
    """Check what is asked for: arguments of `tetlux.fem.solve_each`, and `need_of_mesh` and `runs` of `Request`.

    Without `cache` past runs are neither looked at nor learned from.

    Raises
    ------
    InputError
        As `tetlux.fem.solve`.
    """
    checked = check_tolerances(tolerances, detectors)
    check_scenes(scenes)
    if any(len(each) == 0 for each in scenes):
        raise InputError("there is no light; give at least one.")
    given = body if isinstance(body, TetMesh) else mesh
    built = build_scenes(body, given, medium, regions, len(scenes), frequency, outside_index, any_size=True)
    dark = Dark(built.surface, built.bodies[0].outer)
    placed: tuple[PlacedDetector, ...] = tuple(place_detector(detector, dark) for detector in detectors)
    deposits = tuple(
        tuple(light.deposit_in(each) for light in some) for some, each in zip(scenes, built.bodies, strict=True)
    )
    wanted = Tolerances(checked.exitance, checked.readings, placed, checked.everywhere, checked.volume)
    costs = read_costs() if cache else Costs()
    return Request(
        built.surface,
        built.inner,
        tuple(built.bodies),
        tuple(scenes),
        deposits,
        wanted,
        tuple(detectors),
        given,
        "a mesh is given" if given is not None else need_of_mesh,
        runs,
        costs,
        costs.directory is not None and given is None and is_cached(built.surface, built.inner),
        built.frequencies,
        outside_index,
    )
