"""Light diffusing in tetrahedra: media, lights, the weak form, and its solution."""

from tetlux.fem.body.body import Body
from tetlux.fem.dyes.solve import fluorescence
from tetlux.fem.inverse.fit import fit
from tetlux.fem.inverse.problem import FitProblem
from tetlux.fem.inverse.result import FitResult
from tetlux.fem.lights import (
    CollimatedBeam,
    Deposit,
    DiffuseLight,
    DiffusePatch,
    Disc,
    Emission,
    EnvironmentLight,
    Gaussian,
    Image,
    Light,
    PencilBeam,
    PointSource,
    Rectangle,
)
from tetlux.fem.media.fields import grid_field, mesh_field
from tetlux.fem.media.fluorophore import Fluorophore
from tetlux.fem.media.materials import material
from tetlux.fem.media.medium import Medium
from tetlux.fem.media.phase import henyey_greenstein, table, two_term
from tetlux.fem.media.region import Region
from tetlux.fem.media.spectra import Spectrum
from tetlux.fem.media.tissue import tissue
from tetlux.fem.media.varying import VaryingMedium
from tetlux.fem.meshless import ChargeSolution, ClosedFormSolution
from tetlux.fem.outcome.detector_kinds import DiscDetector, FibreDetector, PointDetector
from tetlux.fem.outcome.detectors import read
from tetlux.fem.outcome.plan import Candidate, Plan
from tetlux.fem.outcome.power import DyePower, Power
from tetlux.fem.outcome.radiance import radiance
from tetlux.fem.outcome.reading import Reading
from tetlux.fem.outcome.solution import Solution
from tetlux.fem.planner import plan
from tetlux.fem.sensitivity.parameters import Grid
from tetlux.fem.sensitivity.sensitivity import Sensitivity, sensitivity
from tetlux.fem.solve import solve
from tetlux.fem.solve_scenes import solve_each
from tetlux.fem.sources.footprint import Footprint
from tetlux.fem.sources.hints import MeshHints
from tetlux.fem.sources.ledger import Ledger
from tetlux.fem.sources.segments import Segments
from tetlux.fem.sources.terms import SourceTerms
from tetlux.fem.system import System
from tetlux.fem.transient.moments import Moments, moments
from tetlux.fem.transient.transient import Transient
from tetlux.fem.truncated import TruncatedSolution

__all__ = [
    "Body",
    "Candidate",
    "ChargeSolution",
    "ClosedFormSolution",
    "CollimatedBeam",
    "Deposit",
    "DiffuseLight",
    "DiffusePatch",
    "Disc",
    "DiscDetector",
    "DyePower",
    "Emission",
    "EnvironmentLight",
    "FibreDetector",
    "FitProblem",
    "FitResult",
    "Fluorophore",
    "Footprint",
    "Gaussian",
    "Grid",
    "Image",
    "Ledger",
    "Light",
    "Medium",
    "MeshHints",
    "Moments",
    "PencilBeam",
    "Plan",
    "PointDetector",
    "PointSource",
    "Power",
    "Reading",
    "Rectangle",
    "Region",
    "Segments",
    "Sensitivity",
    "Solution",
    "SourceTerms",
    "Spectrum",
    "System",
    "Transient",
    "TruncatedSolution",
    "VaryingMedium",
    "fit",
    "fluorescence",
    "grid_field",
    "henyey_greenstein",
    "material",
    "mesh_field",
    "moments",
    "plan",
    "radiance",
    "read",
    "sensitivity",
    "solve",
    "solve_each",
    "table",
    "tissue",
    "two_term",
]
