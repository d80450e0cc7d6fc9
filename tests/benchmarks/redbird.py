"""redbirdpy, tetlux and closed forms on shared scenes: ``python -m tests.benchmarks.redbird``, with redbirdpy.

A point source of 1 W (sigma_a .01, sigma_s' 1, n 1.4): in an infinite medium; a mean free path below the face of a
half-space; and one below the surface of a ball of radius 10 mm, modulated at 100 MHz, where redbirdpy and tetlux have
one mesh of equal edges and tetlux also its own. Prints the rows of the table in docs/accuracy.md. Without redbirdpy its
columns are empty.
"""

import importlib.util
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from tetlux.fem import Medium, PointDetector, PointSource, System, solve
from tetlux.fem.exact import dipole, half_space
from tetlux.fem.exact.modulated.sphere import point_exitance
from tetlux.fem.models.modulation import seconds_per_length, shift_of_frequency
from tetlux.meshing import TetMesh, slab, sphere, tetrahedralize
from tetlux.meshing.arrays import FloatArray, NumberArray

TISSUE = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
DISTANCES, OFFSETS, TIMES = np.array([1.0, 3.0, 10.0]), np.array([5.0, 10.0, 20.0]), np.array([5e-11, 5e-10])
RADIUS, FREQUENCY, EDGE = 10.0, 100e6, 0.8
ANGLES = np.array([30.0, 90.0, 180.0])


def main() -> None:
    """Print the table."""
    mesh = tetrahedralize(sphere(RADIUS), edge_length=EDGE)
    job = {
        "sigma_a": TISSUE.sigma_a,
        "sigma_s_prime": TISSUE.reduced_scattering,
        "eta": TISSUE.eta,
        "distances": DISTANCES,
        "offsets": OFFSETS,
        "times": TIMES,
        "nodes": mesh.points,
        "tetrahedra": mesh.tetrahedra,
        "source": np.array([0.0, 0.0, RADIUS - TISSUE.mean_free_path]),
        "reflection": (TISSUE.boundary_factor - 1.0) / (TISSUE.boundary_factor + 1.0),
        "frequency": FREQUENCY,
    }
    peer = by_redbird(job) if importlib.util.find_spec("redbirdpy") else {}
    print(f"reflection: redbirdpy {peer.get('reflection', np.nan):.6f}, tetlux {job['reflection']:.6f}")
    print("| scene | place | closed form | redbirdpy | tetlux |\n|---|---|---|---|---|")
    infinite_medium(peer)
    on_half_space(peer)
    in_ball(peer, mesh)


def infinite_medium(peer: dict[str, NumberArray]) -> None:
    """Fluence; tetlux in a ball of 50 mm."""
    k, form = TISSUE.sigma_tr, 4.0 * np.pi * TISSUE.diffusion * DISTANCES
    truth = np.exp(-k * DISTANCES) / form
    points = np.column_stack([DISTANCES, 0 * DISTANCES, 0 * DISTANCES])
    lit = solve(sphere(50.0), TISSUE, [PointSource((0.0, 0.0, 0.0))], tolerance=0.01, volume_tolerance=0.01)
    rows(
        "infinite medium, fluence",
        [f"{r:g} mm" for r in DISTANCES],
        truth,
        peer.get("infinite"),
        lit.fluence_at(points),
    )
    v = 1.0 / seconds_per_length(TISSUE, "mm")
    spread = 4.0 * TISSUE.diffusion * v * TIMES[0]
    pulse = v * (np.pi * spread) ** -1.5 * np.exp(-(DISTANCES**2) / spread - TISSUE.sigma_a * v * TIMES[0])
    rows("the same .05 ns after a pulse", [f"{r:g} mm" for r in DISTANCES], pulse, peer.get("infinite_td"), None)


def on_half_space(peer: dict[str, NumberArray]) -> None:
    """Fluence at the face, by the exact boundary condition and by mirror images; tetlux on a block."""
    depth, names = TISSUE.mean_free_path, [f"{rho:g} mm" for rho in OFFSETS]
    points = np.column_stack([OFFSETS, 0 * OFFSETS, 0 * OFFSETS])
    block, there = slab(120.0, 60.0), [PointDetector((float(rho), 0.0, 0.0)) for rho in OFFSETS]
    light = [PointSource((0.0, 0.0, -depth))]
    lit = solve(block, TISSUE, light, tolerance=None, detectors=there, detector_tolerance=0.005)
    found = 2.0 * TISSUE.boundary_factor * np.array([reading.exitance for reading in lit.readings])
    rows("half-space, fluence", names, half_space.point_fluence(TISSUE, depth=depth, points=points), None, found)
    images = dipole.fluence(TISSUE, depth=depth, points=points)
    rows("the same by mirror images", names, images, peer.get("half_space"), None)


def in_ball(peer: dict[str, NumberArray], mesh: TetMesh) -> None:
    """Amplitude and lag at 100 MHz, of linear elements on one mesh by both, and of what tetlux does by itself."""
    depth, factor = TISSUE.mean_free_path, 2.0 * TISSUE.boundary_factor
    shift, light = shift_of_frequency(FREQUENCY, TISSUE, "mm"), [PointSource((0.0, 0.0, RADIUS - depth))]
    gamma = np.radians(ANGLES)
    truth = point_exitance(TISSUE, radius=RADIUS, source_radius=RADIUS - depth, gamma=gamma, shift=shift)
    places = RADIUS * np.column_stack([np.sin(gamma), 0 * gamma, np.cos(gamma)])
    there = [PointDetector((x, y, z)) for x, y, z in places.tolist()]
    plain = System(mesh, TISSUE, shift=shift, mass="consistent").solve(light, subtract="nothing")
    own = solve(
        sphere(RADIUS), TISSUE, light, tolerance=None, detectors=there, detector_tolerance=0.005, frequency=FREQUENCY
    )
    read = np.array([reading.exitance for reading in own.readings])
    of_peer = on_surface(mesh, peer["fluence"], places) / factor if peer else None
    of_plain = on_surface(mesh, plain.fluence, places) / factor
    for what, show in (("amplitude", np.abs), ("lag, degrees", lambda each: -np.degrees(np.angle(each)))):
        names = [f"{angle:g}°" for angle in ANGLES]
        rows(
            f"ball at 100 MHz, {what}, one mesh",
            names,
            show(truth),
            None if of_peer is None else show(of_peer),
            show(of_plain),
        )
        rows(f"the same, {len(own.mesh.points):,} nodes of its own", names, show(truth), None, show(read))


def on_surface(mesh: TetMesh, fluence: NumberArray, places: FloatArray) -> NumberArray:
    """Fluence at places, at the nearest points of the mesh's boundary."""
    _, faces, weights = mesh.closest_boundary(places)
    return np.asarray((fluence[mesh.boundary_faces[faces]] * weights).sum(axis=1))


def rows(scene: str, places: list[str], truth: FloatArray, peer: NumberArray | None, own: NumberArray | None) -> None:
    """Print a row for each place, with differences from the closed form."""
    for number, place in enumerate(places):
        cells = [
            "" if found is None else f"{found[number]:.5g} ({found[number] / truth[number] - 1.0:+.2%})"
            for found in (peer, own)
        ]
        print(f"| {scene} | {place} | {truth[number]:.6g} | {cells[0]} | {cells[1]} |")


def by_redbird(job: dict[str, Any]) -> dict[str, NumberArray]:
    """What redbirdpy finds, in a process of its own."""
    with TemporaryDirectory() as folder:
        paths = [str(Path(folder) / name) for name in ("job.npz", "result.npz")]
        np.savez(paths[0], **job)
        subprocess.run([sys.executable, "-P", str(Path(__file__).with_name("_redbird.py")), *paths], check=True)
        with np.load(paths[1]) as data:
            return {key: data[key] for key in data.files}


if __name__ == "__main__":
    main()
