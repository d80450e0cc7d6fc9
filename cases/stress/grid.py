"""The panels of the stress map."""

from dataclasses import replace

from tetlux.cases.stress.panels import (
    CHARGES,
    DEFAULT,
    FREE_SPACE,
    NOT_REFINED,
    NOTHING,
    PLANNED,
    SIGN_VARIANTS,
    TRUNCATED,
    Axis,
    Panel,
)
from tetlux.cases.stress.scenes import of_modes, of_plans, of_points, scenarios
from tetlux.cases.stress.scenes.bodies import BODIES

ALBEDO = Axis("reduced albedo", (1e-3, 0.1, 0.5, 0.9, 0.99, 0.9999, 1.0), (1e-3, 0.9, 1.0))
ALBEDO_BELOW_ONE = Axis("reduced albedo", (1e-3, 0.1, 0.5, 0.9, 0.99, 0.9999), (1e-3, 0.5, 0.9999))
DECAY = Axis("σ_tr h", (0.01, 0.1, 1.0, 3.0, 10.0, 30.0, 100.0, 1000.0), (0.01, 1.0, 10.0, 1000.0))
INDEX = Axis("refractive index n", (0.5, 0.75, 1.0, 1.4, 2.0, 3.0, 4.0), (0.5, 1.0, 4.0))
G = Axis("g", (-0.9, -0.5, 0.0, 0.5, 0.8, 0.95, 0.99), (-0.9, 0.0, 0.99))
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
        ALBEDO_BELOW_ONE,
        scenarios.point_by_decay_and_albedo,
        (*SIGN_VARIANTS, FREE_SPACE, NOTHING),
    ),
    Panel(
        "albedo and mesh, diffuse light",
        "a ball in diffuse light, on a given mesh of edges h",
        DECAY,
        ALBEDO_BELOW_ONE,
        scenarios.diffuse_by_decay_and_albedo,
        SIGN_VARIANTS,
    ),
    Panel(
        "albedo and mesh, glow",
        "a ball that glows throughout, on a given mesh of edges h",
        DECAY,
        ALBEDO_BELOW_ONE,
        scenarios.glow_by_decay_and_albedo,
        SIGN_VARIANTS,
    ),
    Panel(
        "bad tetrahedra",
        "a point in a ball on a given mesh of edges h, slivers and needles among its tetrahedra",
        DECAY,
        QUALITY,
        scenarios.point_by_decay_and_quality,
        (*SIGN_VARIANTS, NOTHING),
    ),
    Panel(
        "contrast and mesh",
        "concentric balls in diffuse light, on a given mesh; σ_tr h of the shell",
        CONTRAST,
        DECAY,
        scenarios.diffuse_by_contrast_and_decay,
        SIGN_VARIANTS,
    ),
    Panel(
        "contrasts",
        "concentric balls of radius 10 and 6 mean free paths, the core glows",
        replace(CONTRAST, name="contrast of σ_s'"),
        replace(CONTRAST, name="contrast of σ_a"),
        scenarios.glow_by_contrasts,
        (DEFAULT, NOT_REFINED),
    ),
    Panel(
        "core",
        "a ball of radius 10 in diffuse light, with a core of the shell's scattering; its radius in mean free paths",
        replace(
            CONTRAST, name="σ_a of the core by σ_s'", values=(1e-4, 0.01, 1.0, 10.0, 100.0, 1e3), few=(0.01, 1.0, 100.0)
        ),
        Axis("core radius", (2.0, 4.0, 6.0, 8.0), (2.0, 6.0)),
        scenarios.diffuse_by_core_absorption_and_radius,
        (DEFAULT, NOT_REFINED),
    ),
    Panel(
        "wide beam",
        "a beam as wide as the ball, matched index",
        replace(RADIUS, values=(0.3, 1.0, 3.0, 10.0, 30.0), few=(0.3, 3.0)),
        ALBEDO,
        scenarios.beam_by_radius_and_albedo,
        (DEFAULT, NOT_REFINED),
    ),
    Panel(
        "albedo and index",
        "a point 1 mean free path deep in a ball of radius 10",
        INDEX,
        ALBEDO,
        scenarios.point_by_index_and_albedo,
        (*SIGN_VARIANTS, NOT_REFINED, NOTHING),
    ),
    Panel(
        "depth and curvature",
        "a point in a ball, reduced albedo 0.99",
        RADIUS,
        DEPTH,
        scenarios.point_by_radius_and_depth,
        (DEFAULT, NOT_REFINED, FREE_SPACE, NOTHING),
        lambda radius, depth: depth <= radius,
    ),
    Panel(
        "thickness and albedo",
        "a point 1 mean free path below the face of a slab, or half-way through it",
        THICKNESS,
        ALBEDO,
        scenarios.point_by_thickness_and_albedo,
        (DEFAULT, NOT_REFINED, NOTHING),
    ),
    Panel(
        "forward peak and index",
        "a beam through a ball of radius 5, compared 1 mean free path off",
        G,
        INDEX,
        scenarios.beam_by_g_and_index,
        (DEFAULT, NOT_REFINED),
    ),
    Panel(
        "lengths",
        "balls of radius 10 mean free paths, all lengths scaled",
        LENGTH,
        Axis("", scenarios.LENGTH_KINDS),
        scenarios.ball_by_length_and_light,
        (DEFAULT, NOTHING),
    ),
    Panel(
        "shapes",
        "bodies some mean free paths large",
        Axis("", tuple(BODIES)),
        Axis("", scenarios.SHAPE_LIGHTS, (scenarios.SHAPE_LIGHTS[0], scenarios.SHAPE_LIGHTS[3])),
        scenarios.body_by_shape_and_light,
        (DEFAULT, NOT_REFINED),
    ),
    Panel(
        "charges",
        "a point source, lengths in mean free paths; by charges alone, and by finite elements",
        Axis("", of_points.CHARGE_BODIES, of_points.FEW_CHARGE_BODIES),
        Axis("", tuple(of_points.CHARGE_LIGHTS), of_points.FEW_CHARGE_LIGHTS),
        of_points.charges_by_body_and_light,
        (CHARGES, DEFAULT),
    ),
    Panel(
        "readings",
        "four detectors on each body, the source 1 mean free path deep; the colour is that of the worst reading",
        Axis("", of_points.READING_BODIES, of_points.FEW_READING_BODIES),
        Axis("", of_points.PLACES, of_points.FEW_PLACES),
        of_points.readings_by_body_and_place,
        (CHARGES, DEFAULT),
    ),
    Panel(
        "frequency and mesh",
        "modulated light, ball, given mesh",
        Axis("|k| h", (0.1, 0.3, 1.0, 3.0, 10.0), (0.3, 3.0)),
        Axis("ω/(v σ_a)", (0.1, 1.0, 10.0), (10.0,)),
        of_modes.modulated_by_wave_number_and_ratio,
        (DEFAULT,),
    ),
    Panel(
        "frequency and place",
        "modulated light, ball of radius 10",
        Axis("ω/(v σ_t')", (0.001, 0.01, 0.1, 0.3), (0.1,)),
        Axis("", tuple(of_modes.PLACES), ("near", "behind")),
        of_modes.modulated_by_frequency_and_place,
        (DEFAULT,),
    ),
    Panel(
        "time",
        "a point in a ball, after a pulse",
        Axis("radius (mean free paths)", (5.0, 10.0, 30.0), (10.0,)),
        Axis("", tuple(of_modes.TIMES)),
        of_modes.pulse_by_radius_and_time,
        (DEFAULT,),
    ),
    Panel(
        "sensitivities",
        "of readings, ball of radius 10",
        Axis("reduced albedo", (0.5, 0.9, 0.99, 0.9999), (0.5, 0.9999)),
        Axis("", tuple(of_modes.PLACES), ("near", "behind")),
        of_modes.sensitivity_by_albedo_and_place,
        (DEFAULT,),
    ),
    Panel(
        "truncation",
        "a point source 1 mean free path deep in a body of which most is dark; compared within 12 of the source",
        Axis("", tuple(of_plans.TRUNCATED_BODIES), of_plans.FEW_TRUNCATED_BODIES),
        replace(ALBEDO, values=(0.5, 0.9, 0.99, 0.999), few=(0.5, 0.99)),
        of_plans.part_by_body_and_albedo,
        (TRUNCATED,),
    ),
    Panel(
        "plan",
        "scenes that several models can solve, lengths in mean free paths; the regret is in the report",
        Axis("", tuple(of_plans.PLANNED), of_plans.FEW_PLANNED),
        replace(ALBEDO, values=(0.5, 0.9, 0.99, 0.9999), few=(0.5, 0.9999)),
        of_plans.plan_by_scene_and_albedo,
        (PLANNED, CHARGES, DEFAULT),
    ),
)
