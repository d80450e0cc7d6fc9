"""What a light leaves in a medium: points, beams that fade along straight segments, diffuse light, emission."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from tetlux.fem.body.body import Body
from tetlux.fem.media.coefficients import Coefficients
from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh


def _no_vectors() -> FloatArray:
    return np.zeros((0, 3))


def _no_values() -> FloatArray:
    return np.zeros(0)


@dataclass(frozen=True, eq=False)
class Deposit:
    """Where the power of a light goes.

    What depends on the body alone is known at once; light that falls on each facet of a mesh, and paths through
    several media, are known on a mesh only: `on`.

    Parameters
    ----------
    incident : float
        Power that meets the body, W; for an irradiance it follows from the mesh's area.
    specular : float
        Power that its surface reflects at once, W.
    absorbed : float
        Power absorbed before it was ever scattered, W.
    ballistic : float
        Power that leaves the body without having been scattered, W.
    points, powers : (p, 3), (p,) ndarray
        Isotropic points and their power, W.
    homes : (p,) ndarray, optional
        The tetrahedra of a mesh in which they lie, -1 where not known.
    starts, directions, lengths, fluxes : (s, 3), (s, 3), (s,), (s,) ndarray
        Beam segments: start, unit direction, length, and power carried at the start, W. The power fades
        as ``exp(-sigma_t* l)``.
    cells : (s,) ndarray, optional
        The tetrahedra of a mesh in which they begin, -1 where not known.
    irradiance, transmitted_irradiance : float or (b,) ndarray
        Diffuse light on the outside, of the whole surface or at each boundary node of a mesh, and what of it
        passes to the inside, W/unit².
    emission : float or (m,) ndarray
        Power that the volume emits, throughout or in each tetrahedron of a mesh, W/unit³.
    resolution : float
        Length near the deposit that a mesh has to resolve, unit.
    lit : (p, 3) ndarray
        Other places near which it has to.
    entries : (e, 3) ndarray
        Some of the places where beams enter the body.
    breadth : float, optional
        Radius of an even disc that spreads as what is lit does, unit; inf for light on the whole body. If not given, it
        follows from `entries`, or from `points` where there are none.
    beams_as_points : bool
        Whether each point stands for a thin beam that enters at one of `entries`.
    warnings : tuple of str
    on_mesh : OnMesh, optional
        What comes to it on a mesh; plain data too, so that a deposit can be pickled.
    """

    incident: float = 0.0
    specular: float = 0.0
    absorbed: float = 0.0
    ballistic: float = 0.0
    points: FloatArray = field(default_factory=_no_vectors)
    powers: FloatArray = field(default_factory=_no_values)
    homes: IntArray | None = None
    starts: FloatArray = field(default_factory=_no_vectors)
    directions: FloatArray = field(default_factory=_no_vectors)
    lengths: FloatArray = field(default_factory=_no_values)
    fluxes: FloatArray = field(default_factory=_no_values)
    cells: IntArray | None = None
    irradiance: float | FloatArray = 0.0
    transmitted_irradiance: float | FloatArray = 0.0
    emission: float | FloatArray = 0.0
    resolution: float = np.inf
    lit: FloatArray = field(default_factory=_no_vectors)
    entries: FloatArray = field(default_factory=_no_vectors)
    breadth: float | None = None
    beams_as_points: bool = False
    warnings: tuple[str, ...] = ()
    on_mesh: "OnMesh | None" = None

    @property
    def even(self) -> bool:
        """Whether it is spread over surface or volume, and nothing of it lies at points or along segments."""
        return len(self.points) == 0 and len(self.starts) == 0

    def on(self, mesh: TetMesh, surface: Surface, coefficients: Coefficients) -> "Deposit":
        """What it is on a mesh of the surface with given coefficients."""
        if self.on_mesh is None:
            return self
        return together([replace(self, on_mesh=None), self.on_mesh.on(mesh, surface, coefficients)])

    __repr__ = one_line


def together(parts: Sequence[Deposit]) -> Deposit:
    """Several deposits as one."""
    on_mesh = tuple(part.on_mesh for part in parts if part.on_mesh is not None)
    return Deposit(
        incident=sum(p.incident for p in parts),
        specular=sum(p.specular for p in parts),
        absorbed=sum(p.absorbed for p in parts),
        ballistic=sum(p.ballistic for p in parts),
        points=np.vstack([p.points for p in parts]),
        powers=np.concatenate([p.powers for p in parts]),
        homes=_known([(p.homes, len(p.points)) for p in parts]),
        starts=np.vstack([p.starts for p in parts]),
        directions=np.vstack([p.directions for p in parts]),
        lengths=np.concatenate([p.lengths for p in parts]),
        fluxes=np.concatenate([p.fluxes for p in parts]),
        cells=_known([(p.cells, len(p.starts)) for p in parts]),
        irradiance=sum((p.irradiance for p in parts), 0.0),
        transmitted_irradiance=sum((p.transmitted_irradiance for p in parts), 0.0),
        emission=sum((p.emission for p in parts), 0.0),
        resolution=min(p.resolution for p in parts),
        lit=np.vstack([p.lit for p in parts]),
        entries=np.vstack([p.entries for p in parts]),
        breadth=max((p.breadth for p in parts if p.breadth is not None), default=None),
        beams_as_points=any(p.beams_as_points for p in parts),
        warnings=tuple(w for p in parts for w in p.warnings),
        on_mesh=_Several(on_mesh) if on_mesh else None,
    )


class OnMesh(Protocol):
    """What is known of a deposit on a mesh only: a dataclass of plain values, and no closure."""

    def on(self, mesh: TetMesh, surface: Surface, coefficients: Coefficients) -> Deposit:
        """Say what it deposits on a mesh of the surface with given coefficients."""
        ...


@dataclass(frozen=True, eq=False)
class _Several:
    """What several deposits leave on a mesh."""

    parts: tuple[OnMesh, ...]

    def on(self, mesh: TetMesh, surface: Surface, coefficients: Coefficients) -> Deposit:
        """See `OnMesh`."""
        return together([part.on(mesh, surface, coefficients) for part in self.parts])

    __repr__ = one_line


def _known(parts: Sequence[tuple[IntArray | None, int]]) -> IntArray | None:
    """Tetrahedra of all parts, by those of each and how many they are."""
    if all(cells is None for cells, _ in parts):
        return None
    return np.concatenate([np.full(count, -1) if cells is None else cells for cells, count in parts])


class Light(Protocol):
    """A light: any object with this method can stand in the list of lights that is solved for.

    Examples
    --------
    A glowing wire, as points along it:

    >>> class Wire:
    ...     def deposit_in(self, body):
    ...         points = np.column_stack([np.zeros((9, 2)), np.linspace(-4.0, 4.0, 9)])
    ...         finest = float(body.mean_free_paths(points).min())
    ...         return Deposit(incident=1.0, points=points, powers=np.full(9, 1.0 / 9.0), resolution=finest)
    """

    def deposit_in(self, body: Body) -> Deposit:
        """Say what this light leaves in a body.

        Parameters
        ----------
        body : Body
            Its surface, and the medium of each place: `Body.mean_free_paths`, `Body.region_at`, `Body.paths`.

        Returns
        -------
        Deposit
            Its ledger must close: ``incident`` is the sum of ``specular``, ``absorbed``, ``ballistic`` and the power of
            all that is deposited, W.
        """
        ...
