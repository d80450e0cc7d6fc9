"""Is diffusion a fair model here? What a user should read before the picture."""

from collections.abc import Sequence

from tetlux.fem.coefficients import AnyMedium, base_of
from tetlux.fem.medium import Medium
from tetlux.meshing.errors import InputError
from tetlux.meshing.surface import Surface

# Bodies of fewer or more mean free paths than these are a mistaken unit, not a scene.
SMALLEST_BODY = 0.5
LARGEST_BODY = 2e4
LOW_ALBEDO = 0.9
THIN = 4.0


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


def warnings_for(surface: Surface, medium: Medium) -> list[str]:
    """Plain sentences on where the diffusion approximation itself is off, with figures.

    The figures are of diffusion against Monte Carlo: slabs under a wide beam, by reduced albedo and index, as
    ``python -m tests.tables.diffusion_against_monte_carlo`` prints them.
    """
    found = []
    if medium.albedo < LOW_ALBEDO:
        found.append(
            f"the reduced albedo is {medium.albedo:.3g}, below the {LOW_ALBEDO} that diffusion is good for: expect "
            "reflectances too high by 3 % at 0.9 and 7 % at 0.6 where refractive indices match, by 8 % and 21 % at an "
            "index of 1.4, and by more close to the light."
        )
    # The mean chord of a body is 4 V/S (Cauchy).
    thickness = 4.0 * surface.volume / surface.area / medium.mean_free_path
    if thickness < THIN:
        found.append(
            f"the body is {thickness:.2g} mean free paths thick on average, below the {THIN:g} that diffusion needs: "
            "transmitted light in particular will be off by tens of per cent."
        )
    return found


def warnings_for_regions(media: Sequence[AnyMedium]) -> list[str]:
    """The same of the media of regions, in short."""
    return [
        f"region {number}: the reduced albedo is {base_of(medium).albedo:.3g}, below the {LOW_ALBEDO} that diffusion "
        "is good for; light that is absorbed there is only roughly right."
        for number, medium in enumerate(media, 1)
        if base_of(medium).albedo < LOW_ALBEDO
    ]
