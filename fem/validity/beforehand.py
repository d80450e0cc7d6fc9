"""Expected errors of the diffusion approximation before a run, without a mesh."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tetlux.fem.body.body import Body
from tetlux.fem.sources.deposit import Deposit
from tetlux.fem.validity.tables import NEAR_LIMIT, Spread, near_error, near_rows, thin_error, wide_error

# Distance from an entry in mean free paths at which `ModelError.near` is taken: within twice this the note "near-light"
# of a run takes the mean.
NEAR = 1.0


@dataclass(frozen=True)
class ModelError:
    """Expected relative errors of the exitance by diffusion, in the outermost medium of a body.

    Attributes
    ----------
    near : float
        A mean free path from where a thin beam enters, or from a point source; 0 for other light.
    elsewhere : float
        By albedo, refractive index and thickness of the body; not where it is dark, see `tetlux.fem.validity.tables`.
    """

    near: float
    elsewhere: float


def expected_model_error(body: Body, deposits: Sequence[Deposit]) -> ModelError:
    """Expected errors of diffusion: those of `tetlux.fem.validity.local`, for the whole body at once.

    Parameters
    ----------
    body : Body
    deposits : sequence of Deposit
        What each light leaves in it.

    Returns
    -------
    ModelError
    """
    medium, surface = body.outer, body.surface
    albedo, cosine = np.array([medium.albedo]), np.array([medium.mean_cosine])
    thickness = np.array([4.0 * surface.volume / surface.area / medium.mean_free_path])
    near, elsewhere = 0.0, float(wide_error(albedo, medium.eta)[0])
    for deposit in deposits:
        spread = _spread(deposit, medium.mean_free_path)
        elsewhere = max(elsewhere, float(thin_error(cosine, thickness, spread)[0]))
        if spread == "narrow":
            is_beam, as_points = len(deposit.footprint.entries) > 0, deposit.footprint.beams_as_points
            rows = near_rows(albedo, None if not is_beam else cosine if as_points else np.ones(1))
            near = max(near, float(near_error(rows, np.array([NEAR]))[0]))
    return ModelError(near, elsewhere)


def _spread(deposit: Deposit, mean_free_path: float) -> Spread:
    footprint = deposit.footprint
    places = footprint.entries if len(footprint.entries) else deposit.terms.points
    if len(places) == 0:
        return "everywhere"
    radius = footprint.radius
    if radius is None:
        radius = float(np.sqrt(2.0 * ((places - places.mean(axis=0)) ** 2).sum(axis=1).mean()))
    return "wide" if radius >= NEAR_LIMIT * mean_free_path else "narrow"
