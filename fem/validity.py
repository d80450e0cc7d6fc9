"""Is diffusion a fair model here? What a user should read before the picture."""

from collections.abc import Sequence

from tetlux.fem.coefficients import AnyMedium, base_of
from tetlux.fem.local_validity import Validity
from tetlux.fem.medium import Medium
from tetlux.fem.validity_tables import far_error
from tetlux.meshing.errors import InputError
from tetlux.meshing.notes import Note
from tetlux.meshing.surface import Surface

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


def check_scattering(medium: Medium) -> None:
    """Refuse a medium that light passes without being scattered.

    Raises
    ------
    InputError
    """
    if medium.reduced_scattering <= 0:
        raise InputError(
            "the medium does not scatter, and light does not diffuse through a void; "
            "give a scattering coefficient greater than 0."
        )


def check_size(surface: Surface, medium: Medium) -> None:
    """Refuse a body that cannot be of the unit its coefficients are in.

    Raises
    ------
    InputError
        If the body's bounding box is under 0.5 or over 20,000 mean free paths across.
    """
    across = surface.diagonal / medium.mean_free_path
    if SMALLEST_BODY <= across <= LARGEST_BODY:
        return
    size = "small" if across < SMALLEST_BODY else "large"
    raise InputError(
        f"{surface.name} is {surface.diagonal:.3g} {surface.unit} from corner to corner, {across:.2g} mean free paths "
        f"of {medium.mean_free_path:.3g} {surface.unit}: absurdly {size} for diffusion; check the unit, the scale "
        f"of the surface, and that coefficients are in 1/{surface.unit}."
    )


def check_media(surface: Surface, media: Sequence[AnyMedium]) -> None:
    """Refuse media that do not go together, or with the body: the body's own first, then those of its regions.

    Raises
    ------
    InputError
    """
    outer = base_of(media[0])
    for medium in map(base_of, media):
        check_scattering(medium)
        if (medium.eta, medium.boundary) != (outer.eta, outer.boundary):
            raise InputError(
                f"a region's refractive index of {medium.eta:g} is not the body's {outer.eta:g}, or its boundary "
                "is another; light that is reflected between regions is not modelled: give both the same."
            )
    check_size(surface, outer)


def warnings_for(surface: Surface, validity: Validity) -> list[str]:
    """Plain sentences on where the diffusion approximation itself is off, with figures.

    The figures are of diffusion against Monte Carlo. Those by reduced albedo and index are of slabs under a wide beam,
    as ``python -m tests.tables.diffusion_against_monte_carlo`` prints them; all others are those of
    `tetlux.fem.validity_tables`.
    """
    medium = validity.medium
    found: list[str] = []
    if medium.albedo < LOW_ALBEDO:
        found.append(
            Note(
                "low-albedo",
                f"the reduced albedo is {medium.albedo:.3g}, below the {LOW_ALBEDO} that diffusion is good for: expect "
                "reflectances too high by 3 % at 0.9 and 7 % at 0.6 where refractive indices match, by 8 % and 21 % at "
                "an index of 1.4, and by more close to the light.",
                value=medium.albedo,
            )
        )
    found += _of_thin_parts(surface, validity)
    distances, near = validity.distances(validity.middles), validity.near_errors(validity.middles)
    close = distances < NEAR
    if (near[close] > WORTH_SAYING).any():
        error = validity.mean(near * close) / validity.mean(close)
        found.append(
            Note(
                "near-light",
                f"within {NEAR:g} mean free paths of where light enters, {validity.mean(close):.1%} of the surface, "
                f"diffusion itself is off by about {error:.0%}, whatever the mesh.",
                value=error,
            )
        )
    dim = far_error(medium, distances) > DIM
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
    # The mean chord of a body is 4 V/S (Cauchy).
    mean = 4.0 * surface.volume / surface.area / validity.medium.mean_free_path
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
        across = 4.0 * surface.volume / surface.area / medium.mean_free_path
        if across < 1.0 and medium.sigma_t_prime < VOID * outer.sigma_t_prime:
            found.append(
                Note(
                    "void",
                    f"it is {across:.2g} of its mean free paths thick and scatters much less than what is "
                    "around it; light does not diffuse through such a void, and what comes through or past it is only "
                    "a guess.",
                    region=f"region {number}",
                    value=across,
                )
            )
        elif medium.albedo < LOW_ALBEDO:
            found.append(
                Note(
                    "low-albedo",
                    f"the reduced albedo is {medium.albedo:.3g}, below the {LOW_ALBEDO} that diffusion "
                    "is good for; light that is absorbed there is only roughly right.",
                    region=f"region {number}",
                    value=medium.albedo,
                )
            )
    return found
