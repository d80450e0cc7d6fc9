"""Meshes whose tetrahedra have labels, with a medium for each label, and what a user should know of them."""

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

# Media by label or by its name, of one channel or of several.
GivenMedia = Mapping[Any, AnyMedium] | Mapping[Any, AnyMedium | Sequence[AnyMedium]]
# Power that leaves into cavities is worth a sentence from this share of the incident power.
NEGLIGIBLE = 1e-6


def label_of(mesh: TetMesh, key: object) -> int:
    """The label that a number or a name stands for.

    Raises
    ------
    InputError
        If the mesh has no such label, or several of that name.
    """
    labels = list(mesh.region_volumes)
    known = f"its labels are {mesh.named(labels)}"
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


def channels_by_label(mesh: TetMesh, media: GivenMedia | Sequence[GivenMedia]) -> list[MediaByLabel]:
    """Media by label for each channel, the outermost label first.

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
        found = [each for one in media for each in channels_by_label(mesh, one)]
        if len(found) != len(media):
            raise InputError(
                "media by label are given for each channel, so each label has one medium in it, not a list."
            )
        return found
    named: dict[int, AnyMedium | Sequence[AnyMedium]] = {}
    for key, medium in media.items():
        label = label_of(mesh, key)
        if label in named:
            raise InputError(f"label {mesh.named([label])} is given a medium twice; give it one.")
        named[label] = medium
    for label, each in named.items():
        if not isinstance(each, AnyMedium | Sequence) or isinstance(each, str):
            raise InputError(f"label {mesh.named([label])} is given {each!r}; give it a Medium.")
    check_labels(mesh, named)
    counts = {label: len(each) for label, each in named.items() if not isinstance(each, AnyMedium)}
    count = next(iter(counts.values()), 1)
    for label, own in counts.items():
        if own != count or own == 0:
            raise InputError(
                f"label {mesh.named([label])} has {own} media for {count} channels; give one, or one for each."
            )
    order = outermost_first(mesh, named)
    channels: list[MediaByLabel] = []
    for channel in range(count):
        of_label = {label: named[label] for label in order}
        channels.append({label: m if isinstance(m, AnyMedium) else m[channel] for label, m in of_label.items()})
    for of_labels in channels:
        _check_kinds(of_labels)
    return channels


def one_label(mesh: TetMesh) -> None:
    """Refuse a single medium for a mesh of several labels.

    Raises
    ------
    InputError
    """
    labels = mesh.region_volumes
    if len(labels) > 1:
        first, second = list(labels)[:2]
        raise InputError(
            f"the mesh has the labels {mesh.named(labels)} and one medium is given; give one for each, as "
            f"{{{first}: medium, {second}: other}}."
        )


def _check_kinds(media: MediaByLabel) -> None:
    for label, medium in media.items():
        if not isinstance(medium, AnyMedium):
            raise InputError(f"label {label} is given {medium!r}; give it a Medium.")


def outermost_first(mesh: TetMesh, labels: Iterable[int]) -> list[int]:
    """Labels in their order, but first the one that has the largest part of the boundary."""
    there, place = np.unique(mesh.regions[mesh.boundary_cells], return_inverse=True)
    outer = int(there[np.bincount(place, mesh.boundary_areas).argmax()])
    return [outer, *(label for label in labels if label != outer)]


def warnings_for_labels(mesh: TetMesh, media: MediaByLabel) -> list[str]:
    """What a user should know of the media of labels, as `warnings_for_regions` has it for regions."""
    outer = base_of(next(iter(media.values())))
    faces, pairs, _ = mesh.interfaces
    _, areas = triangle_areas(mesh.points, faces)
    boundary = mesh.regions[mesh.boundary_cells]
    found = []
    for label, medium in list(media.items())[1:]:
        area = float(areas[(pairs == label).any(axis=1)].sum() + mesh.boundary_areas[boundary == label].sum())
        chord = 4.0 * mesh.region_volumes[label] / area
        found += warning_for_part(f"label {mesh.named([label])}", chord, base_of(medium), outer)
    return found


def warnings_for_cavities(solution: Solution) -> list[str]:
    """How much power leaves into cavities of a mesh, whose walls are boundaries to the outside."""
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
    """The number of the cavity that each boundary triangle bounds, (f,), -1 for those to the outside."""
    edges = mesh.boundary_edges
    count = len(edges)
    incidence = coo_array(
        (np.ones(3 * count), (np.repeat(np.arange(count), 3), np.unique(edges, return_inverse=True)[1].reshape(-1)))
    ).tocsr()
    parts, part = connected_components(incidence @ incidence.T, directed=False)
    if parts == 1:
        return np.full(count, -1)
    # The divergence theorem: a wall seen from within has its normals towards the cavity.
    a, b, c = np.moveaxis(mesh.points[mesh.boundary_faces] - mesh.points.mean(axis=0), 1, 0)
    volumes = np.bincount(part, np.einsum("ij,ij->i", a, np.cross(b, c)))
    number = np.full(parts, -1)
    hollow = np.flatnonzero(volumes < 0)
    number[hollow] = np.arange(len(hollow))
    return np.asarray(number[part])
