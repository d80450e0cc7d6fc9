"""The panels of the stress map: pairs of axes, the scenes between them, and the methods that are driven over them."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from tetlux.cases.stress import scenes
from tetlux.cases.stress.measure import DEFAULT, FREE_SPACE, NOTHING, OF_SIGN, PLAIN, Method
from tetlux.cases.stress.scenes import Scene
from tetlux.cases.stress.shapes import SHAPES

Value = float | str


@dataclass(frozen=True)
class Axis:
    """What is varied, and how.

    Attributes
    ----------
    name : str
        With its unit, if it has one.
    values : tuple of float or str
    few : tuple of float or str
        Those of a quick map; the same if it is not given.
    """

    name: str
    values: tuple[Value, ...]
    few: tuple[Value, ...] = ()


@dataclass(frozen=True)
class Panel:
    """A pair of axes, by the methods that are compared on it.

    Attributes
    ----------
    name : str
    told : str
        What is solved for.
    x, y : Axis
    make : callable
        The scene at a pair of values; a function of a module, as it is called in other processes.
    methods : tuple of Method
    fits : callable
        Whether there is a scene at a pair of values.
    """

    name: str
    told: str
    x: Axis
    y: Axis
    make: Callable[..., Scene]
    methods: tuple[Method, ...]
    fits: Callable[..., bool] = lambda *_: True

    def quick(self) -> "Panel":
        """The same with few values."""
        x, y = (replace(axis, values=axis.few or axis.values) for axis in (self.x, self.y))
        return replace(self, x=x, y=y)

    def places(self) -> list[tuple[Value, Value]]:
        """The pairs of values that there are scenes at, row by row."""
        return [(x, y) for y in self.y.values for x in self.x.values if self.fits(x, y)]


ALBEDO = Axis("reduced albedo", (1e-3, 0.1, 0.5, 0.9, 0.99, 0.9999, 1.0), (1e-3, 0.9, 1.0))
BELOW_ONE = Axis("reduced albedo", (1e-3, 0.1, 0.5, 0.9, 0.99, 0.9999), (1e-3, 0.5, 0.9999))
DECAY = Axis("σ_tr h", (0.01, 0.1, 1.0, 3.0, 10.0, 30.0, 100.0, 1000.0), (0.01, 1.0, 10.0, 1000.0))
INDEX = Axis("refractive index n", (0.5, 0.75, 1.0, 1.4, 2.0, 3.0, 4.0), (0.5, 1.0, 4.0))
PEAK = Axis("g", (-0.9, -0.5, 0.0, 0.5, 0.8, 0.95, 0.99), (-0.9, 0.0, 0.99))
DEPTH = Axis("depth (mean free paths)", (0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0), (0.01, 1.0, 10.0))
RADIUS = Axis("radius (mean free paths)", (0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0), (0.1, 0.3, 1.0, 100.0))
THICKNESS = replace(RADIUS, name="thickness (mean free paths)", few=(0.1, 1.0, 100.0))
CONTRAST = Axis("contrast, core to shell", (1e-6, 1e-4, 1e-2, 1.0, 1e2, 1e4, 1e6), (1e-6, 1.0, 1e6))
LENGTH = Axis("radius (units)", (1e-9, 1e-6, 1e-3, 1.0, 1e3, 1e6, 1e9), (1e-9, 1.0, 1e9))
QUALITY = Axis("worst quality", (1e-4, 1e-3, 1e-2, 1e-1), (1e-4, 1e-2))

PANELS = (
    Panel(
        "albedo and mesh, point",
        "a point in a ball, on a given mesh of edges h",
        DECAY,
        BELOW_ONE,
        scenes.point_by_decay_and_albedo,
        (*OF_SIGN, FREE_SPACE, NOTHING),
    ),
    Panel(
        "albedo and mesh, diffuse light",
        "a ball in diffuse light, on a given mesh of edges h",
        DECAY,
        BELOW_ONE,
        scenes.diffuse_by_decay_and_albedo,
        OF_SIGN,
    ),
    Panel(
        "albedo and mesh, glow",
        "a ball that glows throughout, on a given mesh of edges h",
        DECAY,
        BELOW_ONE,
        scenes.glow_by_decay_and_albedo,
        OF_SIGN,
    ),
    Panel(
        "bad tetrahedra",
        "a point in a ball on a given mesh of edges h, slivers and needles among its tetrahedra",
        DECAY,
        QUALITY,
        scenes.by_decay_and_quality,
        (*OF_SIGN, NOTHING),
    ),
    Panel(
        "contrast and mesh",
        "concentric balls in diffuse light, on a given mesh; σ_tr h of the shell",
        CONTRAST,
        DECAY,
        scenes.by_contrast_and_decay,
        OF_SIGN,
    ),
    Panel(
        "contrasts",
        "concentric balls of radius 10 and 6 mean free paths, the core glows",
        replace(CONTRAST, name="contrast of σ_s'"),
        replace(CONTRAST, name="contrast of σ_a"),
        scenes.by_contrasts,
        (DEFAULT, PLAIN),
    ),
    Panel(
        "core",
        "a ball of radius 10 in diffuse light, with a core of the shell's scattering; its radius in mean free paths",
        replace(
            CONTRAST, name="σ_a of the core by σ_s'", values=(1e-4, 0.01, 1.0, 10.0, 100.0, 1e3), few=(0.01, 1.0, 100.0)
        ),
        Axis("core radius", (2.0, 4.0, 6.0, 8.0), (2.0, 6.0)),
        scenes.diffuse_by_core,
        (DEFAULT, PLAIN),
    ),
    Panel(
        "wide beam",
        "a beam as wide as the ball, matched index",
        replace(RADIUS, values=(0.3, 1.0, 3.0, 10.0, 30.0), few=(0.3, 3.0)),
        ALBEDO,
        scenes.beam_by_radius_and_albedo,
        (DEFAULT, PLAIN),
    ),
    Panel(
        "albedo and index",
        "a point 1 mean free path deep in a ball of radius 10",
        INDEX,
        ALBEDO,
        scenes.by_index_and_albedo,
        (*OF_SIGN, PLAIN, NOTHING),
    ),
    Panel(
        "depth and curvature",
        "a point in a ball, reduced albedo 0.99",
        RADIUS,
        DEPTH,
        scenes.by_radius_and_depth,
        (DEFAULT, PLAIN, FREE_SPACE, NOTHING),
        lambda radius, depth: depth <= radius,
    ),
    Panel(
        "thickness and albedo",
        "a point 1 mean free path below the face of a slab, or half-way through it",
        THICKNESS,
        ALBEDO,
        scenes.by_thickness_and_albedo,
        (DEFAULT, PLAIN, NOTHING),
    ),
    Panel(
        "forward peak and index",
        "a beam through a ball of radius 5, compared 1 mean free path off",
        PEAK,
        INDEX,
        scenes.by_peak_and_index,
        (DEFAULT, PLAIN),
    ),
    Panel(
        "lengths",
        "balls of radius 10 mean free paths, all lengths scaled",
        LENGTH,
        Axis("", scenes.LENGTH_KINDS),
        scenes.by_length,
        (DEFAULT, NOTHING),
    ),
    Panel(
        "shapes",
        "bodies some mean free paths large",
        Axis("", tuple(SHAPES)),
        Axis("", scenes.SHAPE_LIGHTS, (scenes.SHAPE_LIGHTS[0], scenes.SHAPE_LIGHTS[3])),
        scenes.by_shape_and_light,
        (DEFAULT, PLAIN),
    ),
)
