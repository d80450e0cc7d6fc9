"""Hints for unknown keys and values: the known word that was probably meant, found by synonym, abbreviation or typo."""

import difflib
import re
from collections.abc import Iterable

# Other names of the keys and values of a case file. Of several candidates the first that is known in its place counts.
ALIASES: dict[str, tuple[str, ...]] = {
    # Media. Names as of MCX, NIRFASTer, Redbird, ValoMC, PBRT and Mitsuba, as `_normalize` writes them.
    "mu_a": ("sigma_a",),
    "mua": ("sigma_a",),
    "absorption": ("sigma_a",),
    "absorption_coefficient": ("sigma_a",),
    "sigmaa": ("sigma_a",),
    "mu_s": ("sigma_s",),
    "mus": ("sigma_s",),
    "scattering": ("sigma_s",),
    "scattering_coefficient": ("sigma_s",),
    "sigmas": ("sigma_s",),
    "mu_s_prime": ("sigma_s_prime",),
    "mus_prime": ("sigma_s_prime",),
    "mu_sp": ("sigma_s_prime",),
    "musp": ("sigma_s_prime",),
    "musr": ("sigma_s_prime",),
    "mu_s_r": ("sigma_s_prime",),
    "sigmasp": ("sigma_s_prime",),
    "sigmas_prime": ("sigma_s_prime",),
    "sigma_s_reduced": ("sigma_s_prime",),
    "mu_s_reduced": ("sigma_s_prime",),
    "reduced_scattering": ("sigma_s_prime",),
    "reduced_scattering_coefficient": ("sigma_s_prime",),
    "n": ("eta",),
    "ior": ("eta",),
    "int_ior": ("eta",),
    "index": ("eta",),
    "ref": ("eta",),
    "ri": ("eta",),
    "refractive_index": ("eta",),
    "refraction_index": ("eta",),
    "index_of_refraction": ("eta",),
    "anisotropy": ("g",),
    "asymmetry": ("g",),
    "mean_cosine": ("g",),
    "hg": ("henyey_greenstein",),
    "phase_function": ("phase",),
    "substance": ("material",),
    "preset": ("material",),
    # Sections.
    "body": ("surface",),
    "shape": ("surface",),
    "geometry": ("surface",),
    "object": ("surface",),
    "model": ("surface",),
    "domain": ("surface",),
    "tissue": ("medium",),
    "media": ("medium",),
    "optical_properties": ("medium",),
    "properties": ("medium",),
    "prop": ("medium",),
    "coefficients": ("medium",),
    "source": ("lights",),
    "sources": ("lights",),
    "src": ("lights",),
    "illumination": ("lights",),
    "inclusions": ("regions",),
    "inclusion": ("regions",),
    "layers": ("regions",),
    "layer": ("regions",),
    "inner": ("regions",),
    "sensors": ("detectors",),
    "sensor": ("detectors",),
    "probes": ("detectors",),
    "receivers": ("detectors",),
    "wavelengths": ("channels",),
    "colors": ("channels",),
    "colours": ("channels",),
    "accuracy": ("tolerance",),
    "precision": ("tolerance",),
    "error": ("tolerance",),
    "eps": ("tolerance",),
    "write": ("outputs",),
    "save": ("outputs",),
    "results": ("outputs",),
    "view": ("camera",),
    "viewer": ("camera",),
    "viewpoint": ("camera",),
    "eye": ("camera", "position"),
    "parameters": ("sweep",),
    "scan": ("sweep",),
    "variations": ("sweep",),
    "title": ("name",),
    "label": ("name",),
    "id": ("name",),
    "up_axis": ("up",),
    "upaxis": ("up",),
    "length_unit": ("unit",),
    "closed_forms": ("compare",),
    "reference": ("compare",),
    # Shapes and places.
    "path": ("file", "files"),
    "filename": ("file", "files"),
    "stl": ("file",),
    "obj": ("file",),
    "folder": ("files",),
    "ball": ("sphere",),
    "cube": ("box",),
    "cuboid": ("box",),
    "plate": ("slab",),
    "layer_plate": ("slab",),
    "ring": ("torus",),
    "donut": ("torus",),
    "smoothing": ("crease_angle",),
    "smooth": ("crease_angle",),
    "r": ("radius", "minor"),
    "waist": ("radius",),
    "w0": ("radius",),
    "thickness": ("depth",),
    "height": ("depth", "size"),
    "length": ("height", "size", "width"),
    "dimensions": ("size",),
    "extent": ("size",),
    "side": ("size", "width"),
    "major_radius": ("major",),
    "ring_radius": ("major",),
    "minor_radius": ("minor",),
    "tube_radius": ("minor",),
    "origin": ("position", "center"),
    "position": ("origin", "center", "point"),
    "pos": ("origin", "position", "center", "point"),
    "location": ("origin", "position", "center", "point"),
    "place": ("origin", "position", "center", "point"),
    "from": ("origin", "position"),
    "center": ("position", "origin"),
    "centre": ("center", "position", "origin"),
    "point": ("position", "origin"),
    "start": ("origin",),
    "dir": ("direction",),
    "axis": ("direction", "up"),
    "voxel_size": ("spacing",),
    "pixel_size": ("spacing",),
    "array": ("name",),
    "range": ("values",),
    "zoom": ("scale",),
    "factor": ("scale",),
    # Lights and detectors.
    "laser": ("pencil",),
    "beam": ("pencil", "collimated"),
    "pencil_beam": ("pencil",),
    "ray": ("pencil",),
    "isotropic": ("point",),
    "point_source": ("point",),
    "sun": ("collimated",),
    "directional": ("collimated",),
    "parallel": ("collimated",),
    "planar": ("collimated",),
    "plane_wave": ("collimated",),
    "ambient": ("diffuse",),
    "sky": ("diffuse", "environment"),
    "uniform": ("diffuse",),
    "lambertian": ("diffuse",),
    "hdri": ("environment",),
    "envmap": ("environment",),
    "environment_map": ("environment",),
    "glow": ("emission",),
    "emitter": ("emission",),
    "luminescence": ("emission",),
    "intensity": ("power", "irradiance", "density"),
    "strength": ("power", "irradiance", "density"),
    "energy": ("power", "irradiance", "density"),
    "watts": ("power",),
    "flux": ("power", "irradiance"),
    "radiance": ("brightest",),
    "brightness": ("brightest", "irradiance"),
    "power_density": ("irradiance", "density"),
    "fluence": ("irradiance",),
    "profile": ("spot",),
    "circle": ("disc",),
    "disk": ("disc",),
    "round": ("disc",),
    "gauss": ("gaussian",),
    "square": ("rectangle",),
    "rect": ("rectangle",),
    "picture": ("image",),
    "pattern": ("image",),
    "texture": ("image",),
    "fiber": ("fibre",),
    "na": ("numerical_aperture",),
    "aperture": ("numerical_aperture",),
    "azim": ("azimuth",),
    "elev": ("elevation",),
    # Values.
    "png": ("picture",),
    "pictures": ("picture",),
    "image": ("picture",),
    "ply": ("surface",),
    "vtp": ("surface",),
    "exitance": ("surface",),
    "vtu": ("volume",),
    "vtk": ("volume",),
    "mesh": ("volume",),
    "millimeter": ("mm",),
    "millimetre": ("mm",),
    "micron": ("um",),
    "micrometer": ("um",),
    "micrometre": ("um",),
    "mum": ("um",),
    "nanometer": ("nm",),
    "nanometre": ("nm",),
    "centimeter": ("cm",),
    "centimetre": ("cm",),
    "meter": ("m",),
    "metre": ("m",),
    "inch": ("in",),
    "inches": ("in",),
}
# Quantities that are no key themselves: the key that has to be known in this place, and what to give instead.
REMEDIES: dict[str, tuple[str, str]] = {
    **dict.fromkeys(("sigma_t", "mu_t", "mut", "extinction"), ("sigma_s", "give its two parts, sigma_a and sigma_s; ")),
    **dict.fromkeys(
        ("d", "diffusion", "diffusion_coefficient", "kappa"),
        ("sigma_s_prime", "give sigma_s_prime = 1/(3 D) - sigma_a; "),
    ),
    **dict.fromkeys(
        ("sigma_tr", "mu_eff", "mueff", "albedo", "mfp", "mean_free_path"),
        ("sigma_s_prime", "give sigma_a and sigma_s_prime, from which it follows; "),
    ),
    "diameter": ("radius", 'give "radius", half of it; '),
    "type": ("pencil", "write the kind of light as a key, as in pencil: {...}; "),
    "kind": ("pencil", "write the kind of light as a key, as in pencil: {...}; "),
}
GREEK = {"µ": "mu_", "μ": "mu_", "σ": "sigma_", "η": "eta", "'": "_prime", "’": "_prime", "′": "_prime"}


def nearest_word(word: str, known: Iterable[str]) -> str | None:
    """Find the known word that an unknown one was probably meant to be.

    Parameters
    ----------
    word : str
        The unknown word.
    known : iterable of str
        The words that are valid in its place.

    Returns
    -------
    str or None
        None if no known word resembles it.

    Examples
    --------
    >>> nearest_word("mus'", ["sigma_a", "sigma_s", "sigma_s_prime"])
    'sigma_s_prime'
    """
    words = list(known)
    normal = _normalize(word)
    for form in (normal, normal.removesuffix("s")):
        matches = [key for key in words if _normalize(key) == form]
        matches += [key for key in ALIASES.get(form, ()) if key in words]
        if matches:
            return matches[0]
    abbreviated = [key for key in words if _abbreviates(normal, key)]
    if len(abbreviated) == 1:
        return abbreviated[0]
    close = difflib.get_close_matches(normal, words, n=1)
    return close[0] if close else None


def did_you_mean(word: str, known: Iterable[str], meaning: str = "") -> str:
    """Write the clause of an error message that suggests a known word.

    Parameters
    ----------
    word : str
        The unknown word.
    known : iterable of str
        The words that are valid in its place.
    meaning : str, optional
        What the suggested word means, for the reader.

    Returns
    -------
    str
        Ends in a space; empty if no known word resembles the unknown one.

    Examples
    --------
    >>> did_you_mean("pencill", ["pencil", "point"])
    'did you mean "pencil"? '
    """
    words = list(known)
    remedy = REMEDIES.get(_normalize(word))
    if remedy and remedy[0] in words:
        return remedy[1]
    found = nearest_word(word, words)
    if found is None:
        return ""
    return f'did you mean "{found}"{f" ({meaning})" if meaning else ""}? '


def _normalize(word: str) -> str:
    """Lower case, parts joined by one underscore, Greek letters and primes spelt out."""
    text = word.strip()[:100]
    for letter, name in GREEK.items():
        text = text.replace(letter, name)
    return re.sub(r"[\s_.-]+", "_", text.casefold()).strip("_")


def _abbreviates(short: str, word: str) -> bool:
    """Whether `short`, of at least three letters, joins prefixes of all parts of `word`: sigma_sp, num_ap, tol."""
    parts = word.split("_")
    form = "_?".join("(?:".join(part) + ")?" * (len(part) - 1) for part in parts)
    return len(short) >= 3 and re.fullmatch(form, short) is not None
