"""Is diffusion a fair model here? What a user should read before the picture."""

from collections.abc import Sequence

import numpy as np

from tetlux.fem.body.body import Body
from tetlux.fem.media.coefficients import AnyMedium, base_of
from tetlux.fem.media.medium import Medium
from tetlux.fem.validity.local import Validity
from tetlux.meshing.errors import InputError
from tetlux.meshing.notes import Note
from tetlux.meshing.surface.surface import Surface

# Bodies of fewer or more mean free paths than these are a mistaken unit, not a scene.
SMALLEST_BODY = 0.5
LARGEST_BODY = 2e4
LOW_ALBEDO = 0.9
# Mean free paths: a body thinner than the first is said to be, and so is what is nearer to the light than the second.
THIN, NEAR = 4.0, 2.0
# A part of the surface, and errors close to the light and far from it, that are worth a sentence.
NEGLIGIBLE_PART, WORTH_SAYING, DIM = 0.05, 0.1, 0.25
# A region that has less than this share of the scattering and absorption around it may be a void.
VOID = 0.1


def check_scattering(medium: AnyMedium) -> None:
    """Refuse a medium that light passes without being scattered; where it varies, that is seen when it is asked.

    Raises
    ------
    InputError
    """
    if isinstance(medium, Medium) and medium.reduced_scattering <= 0:
        raise InputError(
            "the medium does not scatter, and light does not diffuse through a void; "
            "give a scattering coefficient greater than 0."
        )


def check_size(body: Body) -> None:
    """Refuse a body that cannot be of the unit its coefficients are in.

    Raises
    ------
    InputError
        If the body's bounding box is under 0.5 or over 20,000 mean free paths across, in each of its media.
    """
    surface, ranges = body.surface, body.ranges_of_mean_free_path
    least, most = min(low for low, _ in ranges), max(high for _, high in ranges)
    if surface.diagonal / least < SMALLEST_BODY:
        size, mean_free_path = "small", least
    elif surface.diagonal / most > LARGEST_BODY:
        size, mean_free_path = "large", most
    else:
        return
    raise InputError(
        f"{surface.name} is {surface.diagonal:.3g} {surface.unit} from corner to corner, "
        f"{surface.diagonal / mean_free_path:.2g} mean free paths of {mean_free_path:.3g} {surface.unit}: absurdly "
        f"{size} for diffusion; check the unit, the scale of the surface, and that coefficients are in "
        f"1/{surface.unit}."
    )


def check_media(body: Body) -> None:
    """Refuse media that do not go together, or with the body.

    Raises
    ------
    InputError
    """
    check_together(list(body.by_label.values()))
    check_size(body)


def check_together(media: Sequence[AnyMedium]) -> None:
    """Refuse media of one body, its own first, that differ in what the whole body shares.

    Raises
    ------
    InputError
    """
    outer = base_of(media[0])
    for medium in media:
        check_scattering(medium)
        base = base_of(medium)
        if (base.eta, base.boundary) != (outer.eta, outer.boundary):
            raise InputError(
                f"a region's refractive index of {base.eta:g} is not the body's {outer.eta:g}, or its boundary "
                "is another; light that is reflected between regions is not modelled: give both the same."
            )


def warnings_for(surface: Surface, validity: Validity) -> list[str]:
    """Plain sentences on where the diffusion approximation itself is off, with figures.

    The figures are of diffusion against Monte Carlo. Those by reduced albedo and index are of slabs under a wide beam,
    as ``python -m tests.tables.diffusion_against_monte_carlo`` prints them; all others are those of
    `tetlux.fem.validity.tables`.
    """
    return [*_of_albedo(validity), *_of_thin_parts(surface, validity), *_of_distance(validity)]


def _of_albedo(validity: Validity) -> list[str]:
    low = validity.below.albedo < LOW_ALBEDO
    share = validity.mean(low)
    if share <= (NEGLIGIBLE_PART if not low.all() else 0.0):
        return []
    albedo, where = validity.below.albedo[low].min(), "" if low.all() else f" below {share:.0%} of the surface"
    return [
        Note(
            "low-albedo",
            f"the reduced albedo is {albedo:.3g}{where}, below the {LOW_ALBEDO} that diffusion is good for: expect "
            "reflectances too high by 3 % at 0.9 and 7 % at 0.6 where refractive indices match, by 8 % and 21 % at an "
            "index of 1.4, and by more close to the light.",
            value=float(albedo),
        )
    ]


def _of_distance(validity: Validity) -> list[str]:
    found: list[str] = []
    middles = validity.middles
    distances, near = validity.distances(middles), validity.near_errors(middles)
    close = distances < NEAR
    if (near[close] > WORTH_SAYING).any():
        error = validity.mean(near * close) / validity.mean(close)
        assumed = ""
        if validity.unknown_cosine(middles)[close].any():
            # A point stands for a beam half as well where scattering is isotropic, so the figure hangs on it.
            assumed = " (g = 0 assumed, as sigma_s_prime alone is given: give sigma_s and g instead)"
        found.append(
            Note(
                "near-light",
                f"within {NEAR:g} mean free paths of where light enters, {validity.mean(close):.1%} of the surface, "
                f"diffusion itself is off by about {error:.0%}, whatever the mesh{assumed}.",
                value=error,
            )
        )
    dim = validity.far_errors(middles, np.arange(len(middles))) > DIM
    if validity.mean(dim) > NEGLIGIBLE_PART:
        found.append(
            Note(
                "strong-absorption",
                f"diffusion fades too fast at this absorption: farther than {distances[dim].min():.2g} mean free paths "
                f"from the light, {validity.mean(dim):.0%} of the surface, it is off by more than {DIM:.0%}.",
            )
        )
    return found


def _of_thin_parts(surface: Surface, validity: Validity) -> list[str]:
    # The mean chord of the body itself, which on a coarse mesh is a little longer than that of the mesh.
    mesh = validity.mesh
    mean = validity.mean_chord * (surface.volume / mesh.volume) * (mesh.area / surface.area)
    errors = validity.thin_errors
    if mean < THIN:
        return [
            Note(
                "thin-body",
                f"the body is {mean:.2g} mean free paths thick on average, below the {THIN:g} that diffusion needs: "
                f"expect the exitance off by {validity.mean(errors):.0%} on average, and transmitted light by more.",
                value=mean,
            )
        ]
    thin = validity.thickness < THIN
    share = validity.mean(thin)
    if share <= NEGLIGIBLE_PART or validity.mean(errors * thin) < WORTH_SAYING * share:
        return []
    return [
        Note(
            "thin-parts",
            f"{share:.0%} of the surface bounds parts thinner than {THIN:g} mean free paths: expect the exitance there "
            f"off by {validity.mean(errors * thin) / share:.0%} on average, and transmitted light by more.",
            value=share,
        )
    ]


def warnings_for_regions(surfaces: Sequence[Surface], media: Sequence[AnyMedium]) -> list[str]:
    """The same of the media of regions, the body's own first, in short."""
    outer, *inner = map(base_of, media)
    found: list[str] = []
    for number, (surface, medium) in enumerate(zip(surfaces, inner, strict=True), 1):
        found += warning_for_part(f"region {number}", 4.0 * surface.volume / surface.area, medium, outer)
    return found


def warning_for_part(name: str, chord: float, medium: Medium, outer: Medium) -> list[str]:
    """A sentence on a part of a body that diffusion is not good for, by its mean chord and its medium, or none."""
    across = chord / medium.mean_free_path
    if across < 1.0 and medium.sigma_t_prime < VOID * outer.sigma_t_prime:
        return [
            Note(
                "void",
                f"it is {across:.2g} of its mean free paths thick and scatters much less than what is around it; "
                "light does not diffuse through such a void, and what comes through or past it is only a guess.",
                region=name,
                value=across,
            )
        ]
    if medium.albedo < LOW_ALBEDO:
        return [
            Note(
                "low-albedo",
                f"the reduced albedo is {medium.albedo:.3g}, below the {LOW_ALBEDO} that diffusion is good for; "
                "light that is absorbed there is only roughly right.",
                region=name,
                value=medium.albedo,
            )
        ]
    return []
