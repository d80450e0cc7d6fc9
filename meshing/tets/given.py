"""Repair and check tetrahedra of other programs, and make a `TetMesh` of them."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray
from tetlux.meshing.errors import InputError
from tetlux.meshing.repair.topology import distinct_rows
from tetlux.meshing.tets.conformity import check_conformity, check_facets, check_overlap, count_doubly_covered_faces
from tetlux.meshing.tets.geometry import tetrahedron_volumes
from tetlux.meshing.tets.mesh import TetMesh
from tetlux.meshing.tets.topology import EDGES

# Largest coordinate, in any unit.
LARGEST_COORDINATE = 1e30
# Nodes are merged if they are closer than the first share of the mesh's diagonal (rounding in files is a tenth of it),
# and than the second share of the shortest edge.
MERGE_DISTANCE, MERGE_SHARE_OF_EDGE = 1e-6, 1e-3
# A tetrahedron is flat if its volume is below this share of the cube of its size: the level of rounding errors.
FLAT_VOLUME = 1e-13


@dataclass(frozen=True, eq=False)
class _Tetrahedra:
    """Tetrahedra during their repair.

    Attributes
    ----------
    points : (n, 3) ndarray
    corners : (m, 4) ndarray
    nodes, cells : (n,), (m,) ndarray
        Indices of the nodes and tetrahedra in the arrays of the caller.
    repairs : tuple of str
    """

    points: FloatArray
    corners: IntArray
    nodes: IntArray
    cells: IntArray
    repairs: tuple[str, ...] = ()

    def select(self, kept: BoolArray, repair: str) -> "_Tetrahedra":
        """The tetrahedra to keep, (m,), and a sentence on the repair."""
        if kept.all():
            return self
        if not kept.any():
            raise InputError("all of its tetrahedra are flat; check its coordinates.")
        return replace(self, corners=self.corners[kept], cells=self.cells[kept], repairs=(*self.repairs, repair))


def mesh_from_arrays(
    points: npt.ArrayLike,
    tetrahedra: npt.ArrayLike,
    *,
    labels: npt.ArrayLike | None = None,
    names: Mapping[int, str] | None = None,
    unit: str = "mm",
    numbered_from: int | None = None,
) -> TetMesh:
    """Make a mesh of tetrahedra from other programs: repair what can be repaired safely, and refuse the rest.

    Parameters
    ----------
    points : (n, 3) array_like
        Nodes, in `unit`.
    tetrahedra : (m, 4) array_like of int
        Corners, in either orientation.
    labels : (m,) array_like of int, optional
        Label of each tetrahedron, any integer; `tetlux.fem.solve` takes media by label.
    names : mapping of int to str, optional
        Names of the labels.
    unit : str
        Unit of the coordinates.
    numbered_from : {0, 1}, optional
        The number of the first node in `tetrahedra`. If not given, it is 1 if number n is used and 0 is not, which
        `repairs` then reports, and otherwise 0.

    Returns
    -------
    TetMesh
        `repairs` lists what was repaired: coincident nodes are merged, unused nodes, flat tetrahedra and copies are
        removed, inverted tetrahedra are reoriented.

    Raises
    ------
    InputError
        If shapes or numbers are wrong, tetrahedra overlap, or parts touch without common nodes.

    Examples
    --------
    >>> corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    >>> mesh = mesh_from_arrays(corners, [[1, 2, 3, 4]], labels=[7], names={7: "skin"})
    >>> mesh.labels, mesh.regions, mesh.repairs
    ({7: 'skin'}, array([7]), ('nodes are numbered from 1.',))
    """
    given = Given(points, tetrahedra, labels, names or {}, numbered_from)
    return make_checked_mesh(given, unit)[0]


@dataclass(frozen=True, eq=False)
class Given:
    """The arguments of `mesh_from_arrays`, with the repairs and warnings of the reader of their file."""

    points: npt.ArrayLike
    tetrahedra: npt.ArrayLike
    labels: npt.ArrayLike | None = None
    names: Mapping[int, str] = field(default_factory=dict)
    numbered_from: int | None = 0
    repairs: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()


def make_checked_mesh(given: Given, unit: str) -> tuple[TetMesh, IntArray]:
    """Make a checked mesh of arrays; also return the index of each of its nodes in the given points, (k,).

    Raises
    ------
    InputError
        As `mesh_from_arrays`.
    """
    numbered = _check_tetrahedra(given.points, given.tetrahedra, given.numbered_from)
    regions = None if given.labels is None else whole_numbers(given.labels, len(numbered.corners))
    if given.labels is not None and regions is None:
        raise InputError("its labels are no whole numbers, one for each tetrahedron; give an integer for each.")
    repaired = _remove_copies(_reorient(_remove_flat(_merge_nodes(numbered))), regions)
    present = {} if regions is None else dict.fromkeys(np.unique(regions[repaired.cells]).tolist())
    mesh = TetMesh(
        repaired.points,
        repaired.corners,
        unit,
        labels={label: name for label, name in given.names.items() if label in present},
        repairs=(*given.repairs, *repaired.repairs),
        warnings=given.warnings,
        **({} if regions is None else {"regions": regions[repaired.cells]}),
    )
    found = check_facets(mesh, merged=True)
    if found:
        mesh = replace(mesh, warnings=(*given.warnings, *found))
    # Cached, so that a solve does not check the mesh again.
    mesh.cache.get(check_conformity, lambda: found)
    return mesh, repaired.nodes


def mesh_with_nodes(points: npt.ArrayLike, cells: npt.ArrayLike, unit: str = "mm") -> tuple[TetMesh, IntArray]:
    """Make a checked mesh without labels; also return the index of each of its nodes in `points`, (k,)."""
    return make_checked_mesh(Given(points, cells), unit)


def value_mesh(points: npt.ArrayLike, cells: npt.ArrayLike, unit: str = "mm") -> tuple[TetMesh, IntArray]:
    """Make a mesh to interpolate values on, whose parts need no common nodes; inverted tetrahedra are reoriented.

    Returns
    -------
    mesh : TetMesh
    nodes : (k,) ndarray
        The index of each of its nodes in `points`.
    """
    given = _reorient(_check_tetrahedra(points, cells))
    return TetMesh(given.points, given.corners, unit), given.nodes


def _check_tetrahedra(points: npt.ArrayLike, cells: npt.ArrayLike, numbered_from: int | None = 0) -> _Tetrahedra:
    """Check shapes, node numbers and coordinates; drop unused nodes."""
    try:
        vertices, corners = np.asarray(points, dtype=np.float64), np.array(cells)
    except (TypeError, ValueError) as error:
        raise InputError("its points and tetrahedra are no arrays of numbers.") from error
    if vertices.ndim != 2 or vertices.shape[1] != 3:
        raise InputError(f"its nodes are an array of shape {vertices.shape}; give three coordinates for each.")
    if corners.ndim != 2 or corners.shape[1] != 4 or len(corners) == 0 or corners.dtype.kind not in "iu":
        raise InputError(f"its tetrahedra are an array of shape {corners.shape}; give four node numbers for each.")
    corners = corners.astype(np.int64)
    repairs: list[str] = []
    if numbered_from is None and corners.min() >= 1 and corners.max() == len(vertices):
        repairs.append("nodes are numbered from 1.")
        numbered_from = 1
    corners -= numbered_from or 0
    if corners.min() < 0 or corners.max() >= len(vertices):
        raise InputError("a tetrahedron names a node that does not exist; the file is damaged.")
    vertices, corners, nodes = _drop_unused(vertices, corners, np.arange(len(vertices)))
    if not (np.abs(vertices) < LARGEST_COORDINATE).all():
        raise InputError("a node's coordinate is no number, or absurdly large; export the file again.")
    return _Tetrahedra(vertices, corners, nodes, np.arange(len(corners)), tuple(repairs))


def _drop_unused(points: FloatArray, corners: IntArray, nodes: IntArray) -> tuple[FloatArray, IntArray, IntArray]:
    """Points, corners and node numbers without the nodes that no tetrahedron uses."""
    used = np.zeros(len(points), dtype=bool)
    used[corners] = True
    if used.all():
        return points, corners, nodes
    return points[used], (np.cumsum(used) - 1)[corners], nodes[used]


def _merge_nodes(given: _Tetrahedra) -> _Tetrahedra:
    """Merge nodes that coincide."""
    points, corners = given.points, given.corners
    near = MERGE_DISTANCE * float(np.linalg.norm(np.ptp(points, axis=0)))
    pairs = cKDTree(points).query_pairs(near, output_type="ndarray")
    if len(pairs) == 0:
        return given
    # Do not merge the nodes of small tetrahedra.
    starts, ends = points[corners[:, EDGES]].transpose(2, 0, 1, 3)
    lengths = np.linalg.norm(ends - starts, axis=2)
    shortest = float(lengths.min(initial=near / MERGE_SHARE_OF_EDGE, where=lengths > 0.0))
    pairs = pairs[np.linalg.norm(np.diff(points[pairs], axis=1)[:, 0], axis=1) <= MERGE_SHARE_OF_EDGE * shortest]
    if len(pairs) == 0:
        return given
    size = len(points)
    _, group = connected_components(coo_array((np.ones(len(pairs)), pairs.T), shape=(size, size)), directed=False)
    _, representatives = np.unique(group, return_index=True)
    repair = f"{size - len(representatives):,} nodes that lie where another one does were joined with it."
    vertices, corners, nodes = _drop_unused(
        points[representatives], group[corners].astype(np.int64), given.nodes[representatives]
    )
    return replace(given, points=vertices, corners=corners, nodes=nodes, repairs=(*given.repairs, repair))


def _remove_flat(given: _Tetrahedra) -> _Tetrahedra:
    points, corners = given.points, given.corners
    volumes = np.abs(tetrahedron_volumes(points, corners))
    sizes = np.ptp(points[corners], axis=1).max(axis=1)
    flat = volumes <= FLAT_VOLUME * sizes**3
    remaining = given.select(~flat, f"{flat.sum():,} tetrahedra without volume were left out.")
    vertices, corners, nodes = _drop_unused(remaining.points, remaining.corners, remaining.nodes)
    return replace(remaining, points=vertices, corners=corners, nodes=nodes)


def _reorient(given: _Tetrahedra) -> _Tetrahedra:
    inverted = tetrahedron_volumes(given.points, given.corners) < 0
    if not inverted.any():
        return given
    corners = given.corners.copy()
    corners[inverted] = corners[inverted][:, [1, 0, 2, 3]]
    which = "all" if inverted.all() else f"{inverted.sum():,} of {len(corners):,}"
    return replace(
        given, corners=corners, repairs=(*given.repairs, f"{which} tetrahedra were inverted and have been turned.")
    )


def _remove_copies(given: _Tetrahedra, regions: IntArray | None) -> _Tetrahedra:
    """Keep one of several equal tetrahedra: that with the rarest label, since parts have rarer labels than wholes."""
    if not count_doubly_covered_faces(given.corners, len(given.points)):
        return given
    labels = np.zeros(len(given.corners), dtype=np.int64) if regions is None else regions[given.cells]
    _, label_index, sizes = np.unique(labels, return_inverse=True, return_counts=True)
    order = np.argsort(sizes[label_index.reshape(-1)], kind="stable")
    chosen, of_kind = distinct_rows(np.sort(given.corners[order], axis=1))
    kept = np.zeros(len(given.corners), dtype=bool)
    kept[order[chosen]] = True
    copies = int((~kept).sum())
    same_label = (labels[order] == labels[order[chosen]][of_kind]).all()
    which = "as the first of each" if same_label else "with the rarer label"
    remaining = given.select(kept, f"{copies:,} tetrahedra that are given more than once were counted once, {which}.")
    check_overlap(remaining.corners, len(remaining.points))
    return remaining


def whole_numbers(values: npt.ArrayLike, count: int) -> IntArray | None:
    """Values of any type as integers; None unless there are `count`, all whole and below 2^31."""
    array = np.asarray(values)
    if array.size != count or array.ndim > 2 or array.shape[:1] != (count,) or array.dtype.kind not in "biuf":
        return None
    numbers = array.reshape(-1).astype(np.float64)
    if not (np.isfinite(numbers).all() and (numbers == np.round(numbers)).all()) or np.abs(numbers).max() >= 2**31:
        return None
    return numbers.astype(np.int64)
