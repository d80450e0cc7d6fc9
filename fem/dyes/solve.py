"""`fluorescence`: solve for the light that excites dyes, and for what they emit."""

from collections.abc import Mapping, Sequence

from tetlux.fem.adapt import MOST_TETRAHEDRA, Problem
from tetlux.fem.assessment import Tolerances
from tetlux.fem.dyes.emitter import DyeEmitter, split_glows
from tetlux.fem.dyes.placed import Dyes, place_dyes
from tetlux.fem.inputs import DEFAULT_TOLERANCE
from tetlux.fem.known.kept_fits import KeptFits, fits_of, keep_fits
from tetlux.fem.known.split import Subtract, check_lights, replace_fitted, split_lights
from tetlux.fem.labels import GivenMedia, resolve_media
from tetlux.fem.media.coefficients import AnyMedium
from tetlux.fem.media.fluorophore import Fluorophore
from tetlux.fem.media.region import Region, check_list_of_regions
from tetlux.fem.operators.assembly import Lumping
from tetlux.fem.outcome.detector_kinds import Detector
from tetlux.fem.outcome.detectors import MOST_TETRAHEDRA_TO_READ
from tetlux.fem.outcome.exitance_field import Dark
from tetlux.fem.outcome.solution import Solution
from tetlux.fem.scenes import build_scenes
from tetlux.fem.solve_scenes import Report, check_tolerances, no_report, place_all, solve_problem
from tetlux.fem.sources.deposit import Deposit
from tetlux.fem.sources.light import Light
from tetlux.fem.stopwatch import Stopwatch
from tetlux.meshing.errors import InputError
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh

AnyMedia = AnyMedium | GivenMedia


def fluorescence(
    body: Surface | TetMesh,
    excitation: AnyMedia,
    emission: AnyMedia,
    lights: Sequence[Light],
    fluorophores: Sequence[Fluorophore],
    *,
    regions: Sequence[Region] = (),
    tolerance: float | None = DEFAULT_TOLERANCE,
    detectors: Sequence[Detector] = (),
    detector_tolerance: float | None = None,
    everywhere_tolerance: float | None = None,
    volume_tolerance: float | None = None,
    mesh: TetMesh | None = None,
    mass: Lumping = "lumped",
    subtract: Subtract = "fitted",
    limit: bool = True,
    most_tetrahedra: int = MOST_TETRAHEDRA,
    cache: bool = True,
    report: Report = no_report,
    frequency: float = 0.0,
    outside_index: float = 1.0,
) -> tuple[Solution, Solution]:
    """Solve for light that excites dyes, and for the light that they emit, on one mesh that is fine enough for both.

    Parameters
    ----------
    body : Surface or TetMesh
    excitation, emission : Medium, VaryingMedium, or mapping of label to these
        The medium at the wavelength of excitation, without the dyes, whose absorption is added, and that at the
        wavelength of emission, with what dyes absorb there. Coefficients in 1/unit.
    lights : sequence of Light
        At least one, at the wavelength of excitation.
    fluorophores : sequence of Fluorophore
    regions : sequence of Region
        Closed surfaces within the body; each has one medium for both wavelengths, or a list of two.
    tolerance, detectors, detector_tolerance, everywhere_tolerance, volume_tolerance
        As in `tetlux.fem.solve`, of both solutions.
    mesh, mass, subtract, limit, most_tetrahedra, cache, report, frequency, outside_index
        As in `tetlux.fem.solve`.

    Returns
    -------
    excitation, emission : Solution
        Each light of the second is what dyes emit by one light of the first. `Solution.dyes` of the second is the
        ledger of each fluorophore: what it absorbed, lost and emitted.

    Raises
    ------
    InputError
        If an argument is out of range, media, regions and mesh do not fit each other, or a fluorophore is where the
        body has nothing.
    RunError
        As in `tetlux.fem.solve`.

    Notes
    -----
    With the excitation phi_x, the source of the emission is ``quantum_yield absorption phi_x / (1 + i omega lifetime)``
    (Patterson & Pogue 1994, Appl. Opt. 33, 1963). It is integrated from what is subtracted too, which is singular at
    point sources. The estimated error of the emission is that of both equations. Diffusion's own error, `valid_at`, is
    that of the emission alone.

    Examples
    --------
    >>> from tetlux.fem import Fluorophore, Medium, PointSource, fluorescence
    >>> from tetlux.meshing import sphere
    >>> red, infrared = (Medium(sigma_a=a, sigma_s_prime=1.0, eta=1.4) for a in (0.015, 0.01))
    >>> dye = Fluorophore(absorption=0.005, quantum_yield=0.5)
    >>> lit, glowing = fluorescence(sphere(10.0), red, infrared, [PointSource((0, 0, 5.0))], [dye], tolerance=0.05)
    >>> abs(glowing.power.incident / (0.5 * 0.25 * lit.power.absorbed) - 1.0) < 1e-9
    True
    """
    given = body if isinstance(body, TetMesh) else mesh
    if isinstance(body, TetMesh) and mesh is not None:
        raise InputError("a mesh is given twice; give it as the body, or a surface and its mesh.")
    for name, medium in (("excitation", excitation), ("emission", emission)):
        if not isinstance(medium, AnyMedium | Mapping):
            raise InputError(f"the medium of the {name} is {medium!r}; give a Medium, or media by label.", field=name)
    pairs = solve_pairs(
        body,
        [excitation],
        [emission],
        [lights],
        fluorophores,
        regions=regions,
        tolerances=Tolerances(tolerance, detector_tolerance, (), everywhere_tolerance, volume_tolerance),
        detectors=detectors,
        mesh=given,
        mass=mass,
        subtract=subtract,
        limit=limit,
        most_tetrahedra=most_tetrahedra,
        cache=cache,
        report=report,
        frequency=[frequency],
        outside_index=outside_index,
    )
    return pairs[0]


def solve_pairs(
    body: Surface | TetMesh,
    excitation: Sequence[AnyMedia],
    emission: Sequence[AnyMedia],
    lights: Sequence[Sequence[Light]],
    fluorophores: Sequence[Fluorophore],
    *,
    regions: Sequence[Region],
    tolerances: Tolerances,
    detectors: Sequence[Detector],
    mesh: TetMesh | None,
    frequency: Sequence[float],
    outside_index: float,
    mass: Lumping = "lumped",
    subtract: Subtract = "fitted",
    limit: bool = True,
    most_tetrahedra: int = MOST_TETRAHEDRA,
    cache: bool = True,
    report: Report = no_report,
) -> list[tuple[Solution, Solution]]:
    """Solve for several channels, each a pair of excitation and emission; arguments are those of `fluorescence`.

    A region has one medium, or a list of those of the excitations, then those of the emissions.
    """
    tolerances, count = check_tolerances(tolerances, detectors), len(excitation)
    if not most_tetrahedra >= 1:
        raise InputError(f"most_tetrahedra is {most_tetrahedra}; give a number of at least 1.")
    watch = Stopwatch()
    with watch.stage("surface"):
        dyes, media, with_dyes = _media(mesh, excitation, emission, regions, fluorophores)
        frequencies = [*frequency, *frequency]
        scenes = build_scenes(body, mesh, media, with_dyes, 2 * count, frequencies, outside_index)
    kept = KeptFits() if mesh is None else fits_of(mesh)
    with watch.stage("assemble"):
        wanted = tolerances.exitance or tolerances.readings or DEFAULT_TOLERANCE
        subtracted = replace_fitted(subtract) if isinstance(body, TetMesh) else subtract
        for each in lights:
            check_lights(each)
        split = [
            split_lights(
                own, scenes.bodies[i], subtracted, tolerance=wanted, kept=kept, scene=i, shift=scenes.shifts[i]
            )
            for i, own in enumerate(lights)
        ]
        deposits = [tuple(light.deposit_in(scenes.bodies[i]) for light in own) for i, own in enumerate(lights)]
        # What dyes emit follows on each mesh.
        split += [split_glows([Deposit()] * len(own)) for own in lights]
        by_scene = [detectors] * (2 * count)
        tolerances = place_all(tolerances, by_scene, Dark(scenes.surface, scenes.bodies[0].outer))
    if tolerances.need_quadratic:
        most_tetrahedra = min(most_tetrahedra, MOST_TETRAHEDRA_TO_READ)
    emitters = {count + i: DyeEmitter(dyes, i, frequency[i], mass, deposits[i]) for i in range(count)}
    problem = Problem(scenes, split, mass, limit, watch, emitters=emitters)
    found = solve_problem(problem, tolerances, by_scene, mesh, most_tetrahedra, report, cache=cache)
    keep_fits(found[0].mesh, kept)
    return [(found[i], emitters[count + i].add_ledger(found[count + i])) for i in range(count)]


def _media(
    mesh: TetMesh | None,
    excitation: Sequence[AnyMedia],
    emission: Sequence[AnyMedia],
    regions: Sequence[Region],
    fluorophores: Sequence[Fluorophore],
) -> tuple[Dyes, list[AnyMedia], list[Region]]:
    """The dyes, the media of all excitations, with dyes, and then of all emissions, and the regions with theirs."""
    check_list_of_regions(regions)
    if any(isinstance(medium, Mapping) for medium in excitation):
        if mesh is None:
            raise InputError("media by label need a mesh with labelled tetrahedra; for a surface give regions.")
        dyes = place_dyes(fluorophores, mesh, None)
        labelled = resolve_media(mesh, list(excitation))  # type: ignore[arg-type]
        emitted = [dict.fromkeys(labelled[0], each) if isinstance(each, AnyMedium) else each for each in emission]
        return dyes, [*map(dyes.add_to, labelled), *emitted], list(regions)
    dyes = place_dyes(fluorophores, mesh, len(regions))
    body_media = [dyes.add_to({0: each})[0] for each in excitation if isinstance(each, AnyMedium)]
    inner = []
    for number, region in enumerate(regions, 1):
        own = region.medium
        of_region = [own] * (2 * len(excitation)) if isinstance(own, AnyMedium) else list(own)
        lit = [dyes.add_to({number: each})[number] for each in of_region[: len(excitation)]]
        inner.append(Region(region.surface, [*lit, *of_region[len(excitation) :]]))
    return dyes, [*body_media, *emission], inner


__all__ = ["fluorescence", "solve_pairs"]
