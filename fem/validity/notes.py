"""Checks of media against the diffusion approximation: what it cannot model is refused, what it models badly noted."""

from collections.abc import Sequence

from tetlux.fem.body.body import Body
from tetlux.fem.media.coefficients import AnyMedium, base_of
from tetlux.fem.media.medium import Medium
from tetlux.fem.validity.local import Validity
from tetlux.meshing.errors import InputError
from tetlux.meshing.notes import Note
from tetlux.meshing.surface.surface import Surface

# Diagonals in mean free paths below and above which the unit of a body must be wrong.
SMALLEST_BODY = 0.5
LARGEST_BODY = 2e4
# Reduced albedo below which diffusion is off by some per cent.
LOW_ALBEDO = 0.9
# Mean free paths: thickness below which a body is thin, and distance below which a place is near the light.
THIN, NEAR = 4.0, 2.0
# Notes are made if more than this share of the surface is concerned, and if the error in thin parts and near the light,
# or far from it, is more than these.
NEGLIGIBLE_SHARE, NOTABLE_ERROR, NOTABLE_FAR_ERROR = 0.05, 0.1, 0.25
# A region with less than this share of the extinction around it may be a void.
VOID = 0.1


def check_scattering(medium: AnyMedium) -> None:
    """Refuse a medium without scattering.

    Parameters
    ----------
    medium : Medium or VaryingMedium
        A medium that varies is checked when its coefficients are computed.

    Raises
    ------
    InputError
    """
    if isinstance(medium, Medium) and medium.reduced_scattering <= 0:
        raise InputError(
            "the medium does not scatter, and light does not diffuse through a void; "
            "give a scattering coefficient greater than 0."
        )


def check_size(body: Body, *, any_size: bool = False) -> None:
    """Refuse a body whose size and coefficients cannot be in the same unit.

    Parameters
    ----------
    body : Body
    any_size : bool
        Whether the body may be larger than finite elements can mesh as a whole.

    Raises
    ------
    InputError
        If the diagonal of the body is less than 0.5, or more than 20,000, mean free paths of each of its media.
    """
    surface, ranges = body.surface, body.ranges_of_mean_free_path
    least, most = min(low for low, _ in ranges), max(high for _, high in ranges)
    if surface.diagonal / least < SMALLEST_BODY:
        size, mean_free_path = "small", least
    elif surface.diagonal / most > LARGEST_BODY and not any_size:
        size, mean_free_path = "large", most
    else:
        return
    raise InputError(
        f"{surface.name} is {surface.diagonal:.3g} {surface.unit} from corner to corner, "
        f"{surface.diagonal / mean_free_path:.2g} mean free paths of {mean_free_path:.3g} {surface.unit}: absurdly "
        f"{size} for diffusion; check the unit, the scale of the surface, and that coefficients are in "
        f"1/{surface.unit}."
    )


def check_media(body: Body, *, any_size: bool = False) -> None:
    """Refuse media that cannot be in one body, or whose coefficients do not suit its size.

    Parameters
    ----------
    body : Body
    any_size : bool
        Whether the body may be larger than finite elements can mesh as a whole.

    Raises
    ------
    InputError
    """
    check_compatible(list(body.by_label.values()))
    check_size(body, any_size=any_size)


def check_compatible(media: Sequence[AnyMedium]) -> None:
    """Refuse media of one body that do not scatter, or that differ in refractive index or boundary.

    Parameters
    ----------
    media : sequence of Medium or VaryingMedium
        That of the body first, then those of its regions.

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
    """Notes on where the diffusion approximation itself is off.

    The figures are errors of diffusion compared with Monte Carlo. Those by reduced albedo and index are of slabs under
    a wide beam, printed by ``python -m tests.tables.diffusion_against_monte_carlo``; all others are those of
    `tetlux.fem.validity.tables`.

    Parameters
    ----------
    surface : Surface
        Of the body.
    validity : Validity
        On a mesh of it.

    Returns
    -------
    list of Note
    """
    return [*_albedo_notes(validity), *_thickness_notes(surface, validity), *_distance_notes(validity)]


def _albedo_notes(validity: Validity) -> list[str]:
    low = validity.below.albedo < LOW_ALBEDO
    share = validity.mean(low)
    if share <= (NEGLIGIBLE_SHARE if not low.all() else 0.0):
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


def _distance_notes(validity: Validity) -> list[str]:
    found: list[str] = []
    distances, near = validity.facet_distances, validity.facet_near_errors
    close = distances < NEAR
    if (near[close] > NOTABLE_ERROR).any():
        error = validity.mean(near * close) / validity.mean(close)
        assumed = ""
        if validity.lacks_cosine(validity.middles[close]).any():
            # A beam as a point has twice the error where scattering is isotropic, so that the figure depends on g.
            assumed = " (g = 0 assumed, as sigma_s_prime alone is given: give sigma_s and g instead)"
        found.append(
            Note(
                "near-light",
                f"within {NEAR:g} mean free paths of where light enters, {validity.mean(close):.1%} of the surface, "
                f"diffusion itself is off by about {error:.0%}, whatever the mesh{assumed}.",
                value=error,
            )
        )
    dim = validity.facet_far_errors > NOTABLE_FAR_ERROR
    if validity.mean(dim) > NEGLIGIBLE_SHARE:
        found.append(
            Note(
                "strong-absorption",
                f"diffusion fades too fast at this absorption: farther than {distances[dim].min():.2g} mean free paths "
                f"from the light, {validity.mean(dim):.0%} of the surface, it is off by more than "
                f"{NOTABLE_FAR_ERROR:.0%}.",
            )
        )
    return found


def _thickness_notes(surface: Surface, validity: Validity) -> list[str]:
    # The mean chord of a coarse mesh, 4 V/S, scaled to that of the body itself.
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
    if share <= NEGLIGIBLE_SHARE or validity.mean(errors * thin) < NOTABLE_ERROR * share:
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
    """Notes on regions with a low albedo and on voids.

    Parameters
    ----------
    surfaces : sequence of Surface
        Of the regions.
    media : sequence of Medium or VaryingMedium
        That of the body first, then those of the regions.

    Returns
    -------
    list of Note
    """
    outer, *inner = map(base_of, media)
    found: list[str] = []
    for number, (surface, medium) in enumerate(zip(surfaces, inner, strict=True), 1):
        found += warning_for_part(f"region {number}", 4.0 * surface.volume / surface.area, medium, outer)
    return found


def warning_for_part(name: str, chord: float, medium: Medium, outer: Medium) -> list[str]:
    """Note on a part of a body that diffusion models badly, if it is one.

    Parameters
    ----------
    name : str
        What the note calls the part.
    chord : float
        Mean chord of the part, unit.
    medium, outer : Medium
        Of the part, and around it.

    Returns
    -------
    list of Note
        At most one.
    """
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
