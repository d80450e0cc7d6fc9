"""`SurfaceValidity`: expected errors of diffusion at places of a body of one medium, without a mesh."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tetlux.fem.media.medium import Medium
from tetlux.fem.sources.deposit import Deposit
from tetlux.fem.validity.entry import Entry, entry_in
from tetlux.fem.validity.facet_media import LocalMedia
from tetlux.fem.validity.tables import far_error, thin_error, wide_error
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.thickness import thickness_below


@dataclass(frozen=True, eq=False)
class SurfaceValidity:
    """What `tetlux.fem.validity.local.Validity` is on a mesh.

    Parameters
    ----------
    surface : Surface
    medium : Medium
        Of the whole body.
    deposits : sequence of Deposit
        What each light leaves in the body.
    """

    surface: Surface
    medium: Medium
    deposits: Sequence[Deposit]

    def at(self, points: FloatArray) -> FloatArray:
        """1 minus the expected relative errors of the exitance at points (q, 3) of the surface, not below 0, (q,)."""
        media, free_path = self._media(points, True), self.medium.mean_free_path
        places, facets = self.surface.closest(points)
        thickness = thickness_below(self.surface.rays, places, self.surface.normals[facets]) / free_path
        lengths = np.min([entry.lengths(points) for entry in self._entries], axis=0)
        causes = [wide_error(media.albedo, self.medium.eta), far_error(media.albedo, lengths / free_path)]
        for entry in self._entries:
            causes += [thin_error(media.cosine, thickness, entry.spread), entry.errors(points)]
        return np.asarray(np.maximum(1.0 - np.max(causes, axis=0), 0.0))

    def _media(self, points: FloatArray, _: bool) -> LocalMedia:
        count, cosine = len(points), self.medium.mean_cosine
        return LocalMedia(
            np.full(count, self.medium.albedo),
            np.full(count, np.nan_to_num(cosine)),
            np.full(count, np.isnan(cosine)),
            np.full(count, self.medium.mean_free_path),
        )

    @cached_property
    def _entries(self) -> list[Entry]:
        return [entry_in(deposit, self._media) for deposit in self.deposits]

    __repr__ = one_line
