"""Media by label of a mesh: look labels up by number or name, and warn of thin parts and of cavities."""

import difflib
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from tetlux.fem.media.coefficients import AnyMedium, MediaByLabel, base_of, check_labels
from tetlux.fem.outcome.solution import Solution
from tetlux.fem.validity.notes import warning_for_part
from tetlux.meshing.arrays import IntArray
from tetlux.meshing.errors import InputError
from tetlux.meshing.notes import Note
from tetlux.meshing.surface.triangles import signed_volume, triangle_areas
from tetlux.meshing.tets.mesh import TetMesh

# From the number or name of a label to its medium, or to a list with one medium for each channel.
GivenMedia = Mapping[Any, AnyMedium] | Mapping[Any, AnyMedium | Sequence[AnyMedium]]
# Power into cavities below this share of the incident power is called "next to none".
NEGLIGIBLE = 1e-6


def find_label(mesh: TetMesh, key: object) -> int:
    """Look up a label by its number or its name.

    Raises
    ------
    InputError
        If the mesh has no such label, or several of that name.
    """
    labels = list(mesh.region_volumes)
    known = f"its labels are {mesh.label_text(labels)}"
    if isinstance(key, str):
        named = [label for label in labels if mesh.labels.get(label) == key]
        if len(named) > 1:
            raise InputError(f'several labels of the mesh are called "{key}"; give their numbers: {known}.')
        if named:
            return named[0]
        if key.lstrip("-").isdecimal() and int(key) in labels:
            return int(key)
        close = difflib.get_close_matches(key, [mesh.labels.get(label, "") for label in labels], n=1)
        hint = f'did you mean "{close[0]}"? ' if close and close[0] else ""
        raise InputError(f'the mesh has no label "{key}"; {hint}{known}.')
    if isinstance(key, int | np.integer) and not isinstance(key, bool) and int(key) in labels:
        return int(key)
    raise InputError(f"the mesh has no label {key}; {known}.")


def resolve_media(mesh: TetMesh, media: GivenMedia | Sequence[GivenMedia]) -> list[MediaByLabel]:
    """Look up the labels of given media, and split lists into channels, with the outermost label first.

    Parameters
    ----------
    mesh : TetMesh
    media : mapping, or sequence of mappings
        From labels, or their names, to a medium, or to a list with one for each channel; or a mapping for each channel.

    Raises
    ------
    InputError
        If labels and media do not go together, or lists differ in length.
    """
    if not isinstance(media, Mapping):
        found = [by_label for channel in media for by_label in resolve_media(mesh, channel)]
        if len(found) != len(media):
            raise InputError("there are media by label for each channel; give each label one medium there, not a list.")
        return found
    named: dict[int, AnyMedium | Sequence[AnyMedium]] = {}
    for key, medium in media.items():
        label = find_label(mesh, key)
        if label in named:
            raise InputError(f"label {mesh.label_text([label])} is given a medium twice; give it one.")
        named[label] = medium
    for label, each in named.items():
        if not isinstance(each, AnyMedium | Sequence) or isinstance(each, str):
            raise InputError(f"label {mesh.label_text([label])} is given {each!r}; give it a Medium.")
    check_labels(mesh, named)
    counts = {label: len(each) for label, each in named.items() if not isinstance(each, AnyMedium)}
    count = next(iter(counts.values()), 1)
    for label, media_given in counts.items():
        if media_given != count or media_given == 0:
            raise InputError(
                f"label {mesh.label_text([label])} has {media_given} media for {count} channels; give one, or one for "
                "each."
            )
    order = order_outermost_first(mesh, named)
    channels: list[MediaByLabel] = []
    for channel in range(count):
        ordered = {label: named[label] for label in order}
        channels.append({label: m if isinstance(m, AnyMedium) else m[channel] for label, m in ordered.items()})
    for by_label in channels:
        _check_types(by_label)
    return channels


def check_single_label(mesh: TetMesh) -> None:
    """Refuse a single medium for a mesh of several labels.

    Raises
    ------
    InputError
    """
    labels = mesh.region_volumes
    if len(labels) > 1:
        first, second = list(labels)[:2]
        raise InputError(
            f"the mesh has the labels {mesh.label_text(labels)} and one medium is given; give one for each, as "
            f"{{{first}: medium, {second}: other}}."
        )


def _check_types(media: MediaByLabel) -> None:
    for label, medium in media.items():
        if not isinstance(medium, AnyMedium):
            raise InputError(f"label {label} is given {medium!r}; give it a Medium.")


def order_outermost_first(mesh: TetMesh, labels: Iterable[int]) -> list[int]:
    """Move the label with the largest part of the boundary to the front of some labels."""
    at_boundary, position = np.unique(mesh.regions[mesh.boundary_cells], return_inverse=True)
    outer = int(at_boundary[np.bincount(position, mesh.boundary_areas).argmax()])
    return [outer, *(label for label in labels if label != outer)]


def warnings_for_labels(mesh: TetMesh, media: MediaByLabel) -> list[str]:
    """Warn of labels whose parts are thin or whose medium diffusion models badly, as `warnings_for_regions` does."""
    outer = base_of(next(iter(media.values())))
    faces, pairs, _ = mesh.interfaces
    _, areas = triangle_areas(mesh.points, faces)
    boundary = mesh.regions[mesh.boundary_cells]
    found = []
    for label, medium in list(media.items())[1:]:
        area = float(areas[(pairs == label).any(axis=1)].sum() + mesh.boundary_areas[boundary == label].sum())
        chord = 4.0 * mesh.region_volumes[label] / area
        found += warning_for_part(f"label {mesh.label_text([label])}", chord, base_of(medium), outer)
    return found


def warnings_for_cavities(solution: Solution) -> list[str]:
    """Report the power that leaves into cavities of a mesh, whose walls count as boundary to the outside."""
    mesh = solution.mesh
    cavity = mesh.cache.get(warnings_for_cavities, lambda: _cavities(mesh))
    inside = np.flatnonzero(cavity >= 0)
    if len(inside) == 0:
        return []
    count = int(cavity.max()) + 1
    volume = -signed_volume(mesh.points, mesh.boundary_faces[inside])
    exitance = solution.exitance[mesh.boundary_triangles[inside]].mean(axis=1)
    share = float(mesh.boundary_areas[inside] @ exitance) / solution.power.incident
    which = "a cavity" if count == 1 else f"{count} cavities"
    figure = f"{share:.2%}" if share >= NEGLIGIBLE else "next to none"
    whose, there = ("whose wall is a boundary", "it") if count == 1 else ("whose walls are boundaries", "them")
    return [
        Note(
            "cavities",
            f"the mesh has {which} of {volume:.3g} {mesh.unit}³, {whose} to the outside: {figure} of the incident "
            f"power leaves into {there} and counts as exited.",
            value=share,
        )
    ]


def _cavities(mesh: TetMesh) -> IntArray:
    """For each boundary triangle the number of the cavity that it bounds, (f,); -1 on the outer boundary."""
    edges = mesh.boundary_edges
    count = len(edges)
    incidence = coo_array(
        (np.ones(3 * count), (np.repeat(np.arange(count), 3), np.unique(edges, return_inverse=True)[1].reshape(-1)))
    ).tocsr()
    parts, part = connected_components(incidence @ incidence.T, directed=False)
    if parts == 1:
        return np.full(count, -1)
    # Signed volumes by the divergence theorem: the normals of a cavity's wall point into the cavity.
    a, b, c = np.moveaxis(mesh.points[mesh.boundary_faces] - mesh.points.mean(axis=0), 1, 0)
    volumes = np.bincount(part, np.einsum("ij,ij->i", a, np.cross(b, c)))
    number = np.full(parts, -1)
    hollow = np.flatnonzero(volumes < 0)
    number[hollow] = np.arange(len(hollow))
    return np.asarray(number[part])
