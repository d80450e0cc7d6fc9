"""The program of NGSolve's own process: netgen meshes the exact shape, NGSolve solves the same equation on it.

NGSolve (LGPL) is an optional peer on the chart (``pip install "tetlux[peers]"``); nothing else imports it.
"""

import os
import sys
import time
from typing import Any

import numpy as np

from tetlux.meshing.surface.surface import Surface

# Newton steps to find a point on a curved facet; few are enough, since facets are nearly flat.
NEWTON_STEPS = 3
# Relative residual of the linear solver.
RESIDUAL = 1e-9
# How often the longest edge is halved where netgen fails.
HALVINGS = 4
# Name of the body's boundary.
OUTSIDE = "outside"


def main(job_path: str, result_path: str) -> None:
    """Solve the job in ``job_path`` (npz), and write exitance, seconds and sizes to ``result_path`` (npz)."""
    import ngsolve  # noqa: PLC0415

    with np.load(job_path) as data:
        job: dict[str, Any] = {key: data[key] for key in data.files}
    ngsolve.SetNumThreads(os.cpu_count() or 1)
    job["longest"] = _longest_that_meshes(job)
    seconds: list[float] = []
    while not seconds or (len(seconds) < job["repeats"] and sum(seconds) < job["repeat_seconds"]):
        started = time.perf_counter()
        mesh, fluence = _solve(job)
        seconds.append(time.perf_counter() - started)
    np.savez(
        result_path,
        exitance=float(job["robin"]) * _evaluate_on_surface(mesh, fluence, job["samples"]),
        seconds=min(seconds),
        unknowns=fluence.space.ndof,
        tetrahedra=mesh.ne,
    )


def _longest_that_meshes(job: dict[str, Any]) -> float:
    """The longest edge, halved until netgen meshes thin layers; what that takes is not timed, as a user knows it."""
    longest = float(job["longest"])
    for halving in range(HALVINGS if len(job["kinds"]) > 1 else 0):
        try:
            _mesh(job | {"longest": longest * 0.5**halving})
        except Exception:  # netgen has an error of its own, which it does not export
            continue
        return longest * 0.5**halving
    return longest


def _solve(job: dict[str, Any]) -> tuple[Any, Any]:
    """Make a mesh and compute the fluence on it."""
    import ngsolve as ng  # noqa: PLC0415

    order = int(job["order"])
    mesh = _mesh(job)
    with ng.TaskManager():
        space = ng.H1(mesh, order=order)
        u, v = space.TnT()
        diffusion, sigma_a = (
            mesh.MaterialCF({str(region): value for region, value in enumerate(job[name].tolist())})
            for name in ("diffusion", "sigma_a")
        )
        system = ng.BilinearForm(space, symmetric=True)
        system += diffusion * ng.grad(u) * ng.grad(v) * ng.dx + sigma_a * u * v * ng.dx
        system += float(job["robin"]) * u * v * ng.ds(OUTSIDE)
        # On one level "multigrid" is a direct solver, the quicker one for few unknowns; for high orders bddc is.
        preconditioner = ng.Preconditioner(system, "multigrid" if order == 1 else "bddc")
        load = ng.LinearForm(space)
        for (x, y, z), power in zip(job["points"].tolist(), job["powers"].tolist(), strict=True):
            load += (power * v)(x, y, z)
        system.Assemble()
        load.Assemble()
        fluence = ng.GridFunction(space)
        solver = ng.CGSolver(system.mat, preconditioner.mat, tol=RESIDUAL, maxiter=2000)
        fluence.vec.data = solver * load.vec
    return mesh, fluence


def _mesh(job: dict[str, Any]) -> Any:
    """Mesh the exact shape with ``resolution`` as netgen's grading; elements of order 2 and more are curved."""
    import ngsolve as ng  # noqa: PLC0415
    from netgen.meshing import MeshingParameters  # noqa: PLC0415

    order, grading = int(job["order"]), float(job["resolution"])
    settings = MeshingParameters(maxh=float(job["longest"]), grading=grading)
    for (x, y, z), length in zip(job["points"].tolist(), job["lengths_to_resolve"].tolist(), strict=True):
        settings.RestrictH(x=x, y=y, z=z, h=grading / 3.0 * length)
    mesh = ng.Mesh(_geometry(job).GenerateMesh(mp=settings))
    if order > 1:
        mesh.Curve(order)
    return mesh


def _geometry(job: dict[str, Any]) -> Any:
    """The exact shapes, each without those inside it; the body's boundary is named `OUTSIDE`, regions by number.

    A torus is made by OpenCASCADE, since netgen often fails to mesh its own torus.
    """
    from netgen import csg, occ  # noqa: PLC0415

    kinds, sizes, centers, parents = (job[name].tolist() for name in ("kinds", "sizes", "centers", "parents"))
    if kinds[0] == "torus":
        (major, minor), center = sizes[0], centers[0]
        ring = occ.Circle(occ.Pnt(center[0] + major, *center[1:]), occ.Dir(0.0, 1.0, 0.0), minor)
        body = occ.Face(occ.Wire([ring])).Revolve(occ.Axis(occ.Pnt(*center), occ.Z), 360.0)
        body.faces.name = OUTSIDE
        body.solids.name = "0"
        return occ.OCCGeometry(body)
    solids = [_solid(*shape) for shape in zip(kinds, sizes, centers, strict=True)]
    solids[0].bc(OUTSIDE)
    geometry = csg.CSGeometry()
    for region, solid in enumerate(solids):
        part = solid
        for child, parent in enumerate(parents, 1):
            part = part - solids[child] if parent == region else part
        geometry.Add(part.mat(str(region)))
    return geometry


def _solid(kind: str, sizes: list[float], center: list[float]) -> Any:
    """A solid of netgen."""
    from netgen import csg  # noqa: PLC0415

    x, y, z = center
    if kind == "sphere":
        return csg.Sphere(csg.Pnt(x, y, z), sizes[0])
    if kind == "cylinder":
        radius, half = sizes[0], 0.5 * sizes[1]
        low, high = csg.Pnt(x, y, z - half), csg.Pnt(x, y, z + half)
        ends = csg.Plane(low, csg.Vec(0.0, 0.0, -1.0)) * csg.Plane(high, csg.Vec(0.0, 0.0, 1.0))
        return csg.Cylinder(low, high, radius) * ends
    width, depth = sizes
    return csg.OrthoBrick(csg.Pnt(-0.5 * width, -0.5 * width, -depth), csg.Pnt(0.5 * width, 0.5 * width, 0.0))


def _evaluate_on_surface(mesh: Any, fluence: Any, samples: Any) -> Any:
    """Fluence at the points of the curved facets nearest to samples (n, 3), (n,)."""
    import ngsolve as ng  # noqa: PLC0415

    corners = np.asarray(mesh.ngmesh.Coordinates())
    outside = [element for element in mesh.Elements(ng.BND) if element.mat == OUTSIDE]
    facets = np.array([[vertex.nr for vertex in element.vertices] for element in outside])
    near, facet = Surface(corners, facets, "mm", "netgen").closest(samples)
    last = corners[facets[facet, 2]]
    # NGSolve's coordinates in a triangle are the barycentric coordinates of its first two corners.
    slope = np.linalg.pinv(np.stack([corners[facets[facet, 0]] - last, corners[facets[facet, 1]] - last], axis=2))
    place = np.einsum("nij,nj->ni", slope, near - last)
    inside = np.mean([corners[vertex.nr] for vertex in mesh[ng.ElementId(ng.VOL, 0)].vertices], axis=0)
    where = np.repeat(mesh(*inside[:, None]), len(samples))
    where["VorB"], where["nr"] = 1, np.array([element.nr for element in outside])[facet]
    position = ng.CF((ng.x, ng.y, ng.z))
    for _ in range(NEWTON_STEPS):
        where["x"], where["y"] = place.T
        place += np.einsum("nij,nj->ni", slope, samples - position(where))
    where["x"], where["y"] = place.T
    return fluence(where).ravel()


if __name__ == "__main__":
    main(*sys.argv[1:])
