"""How fast the solver converges, and to what: ``python -m tests.convergence`` prints the tables.

Every body has a known fluence and a mesh that is the same on every machine, its boundary nodes on the true
surface. What is known is written down here from D, A and the source, not taken from `tetlux`.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import permutations, product

import numpy as np
from scipy import special
from scipy.optimize import brentq
from skfem import MeshTet1
from skfem.quadrature import get_quadrature
from skfem.refdom import RefTet, RefTri

from tetlux.fem import Medium, PointSource, Power, Solution
from tetlux.fem.body.body import Body as LitBody
from tetlux.fem.exact import dipole, half_space, slab, sphere
from tetlux.fem.grading import grade_mesh, places_to_resolve
from tetlux.fem.known.split import Subtract
from tetlux.fem.linear.multigrid import multigrid
from tetlux.fem.linear.solver import Solver
from tetlux.fem.models.boundary import PartialCurrent
from tetlux.fem.operators.assembly import system_matrix
from tetlux.fem.solve import solve
from tetlux.meshing import Surface, TetMesh, refine
from tetlux.meshing import sphere as sphere_surface
from tetlux.meshing.arrays import FloatArray, IntArray

# A of the partial-current boundary by refractive index (Haskell 1994), to seven digits.
BOUNDARY_FACTOR = {1.0: 1.0, 1.3: 2.340532, 1.4: 2.948493}

Function = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True)
class Coefficients:
    """A medium, and what the equation makes of it, worked out beside `Medium` and not by it."""

    sigma_a: float
    sigma_s_prime: float
    eta: float

    @property
    def medium(self) -> Medium:
        return Medium(sigma_a=self.sigma_a, sigma_s_prime=self.sigma_s_prime, eta=self.eta)

    @property
    def diffusion(self) -> float:
        return 1.0 / (3.0 * (self.sigma_a + self.sigma_s_prime))

    @property
    def boundary_factor(self) -> float:
        return BOUNDARY_FACTOR[self.eta]

    @property
    def zb(self) -> float:
        return 2.0 * self.boundary_factor * self.diffusion


@dataclass(frozen=True)
class Row:
    """One mesh: a length, and relative L2 errors by the name of what is measured."""

    length: float
    unknowns: int
    errors: dict[str, float]

    @staticmethod
    def on(mesh: TetMesh, errors: dict[str, float]) -> "Row":
        """The row of a mesh, its length the cube root of the mean volume of its tetrahedra."""
        return Row((mesh.volume / len(mesh.tetrahedra)) ** (1 / 3), len(mesh.points), errors)


@dataclass(frozen=True, repr=False)
class Table:
    """Meshes of one body, from coarse to fine."""

    title: str
    rows: list[Row] = field(default_factory=list)

    def errors(self, name: str) -> FloatArray:
        return np.array([row.errors[name] for row in self.rows])

    def rates(self, name: str) -> FloatArray:
        """Orders of convergence from each mesh to the next."""
        lengths = np.array([row.length for row in self.rows])
        return np.asarray(np.diff(np.log(self.errors(name))) / np.diff(np.log(lengths)))

    def __repr__(self) -> str:
        names = list(self.rows[0].errors)
        rates = {name: ["", *(f"{rate:.2f}" for rate in self.rates(name))] for name in names}
        lines = [
            f"### {self.title}",
            "",
            "| h | unknowns |" + "".join(f" {name} error | rate |" for name in names),
            "|---|---|" + "---|---|" * len(names),
        ]
        for i, row in enumerate(self.rows):
            cells = "".join(f" {row.errors[name]:.3e} | {rates[name][i]} |" for name in names)
            lines.append(f"| {row.length:.4g} | {row.unknowns:,} |{cells}")
        return "\n".join(lines) + "\n"


# Integrals over tetrahedra and triangles


def rule(corners: int, degree: int = 4) -> tuple[FloatArray, FloatArray]:
    """Barycentric points (q, corners) and weights (q,) that sum to 1, on a triangle or a tetrahedron."""
    points, weights = get_quadrature(RefTri if corners == 3 else RefTet, degree)
    return np.vstack([1.0 - points.sum(axis=0), points]).T, np.asarray(weights / weights.sum())


def summed(nodes: IntArray, values: FloatArray, count: int) -> FloatArray:
    """Sums of the values that belong to each of `count` nodes, (count,)."""
    return np.asarray(np.bincount(nodes.ravel(), values.ravel(), minlength=count), dtype=np.float64)


def integrals_with_hats(points: FloatArray, simplices: IntArray, sizes: FloatArray, density: Function) -> FloatArray:
    """``∫ density v`` for the hat function v of every node, (n,)."""
    barycentric, weights = rule(simplices.shape[1])
    values = density(barycentric @ points[simplices])
    shares = sizes[:, None] * ((values * weights) @ barycentric)
    return summed(simplices, shares, len(points))


def relative_error(
    points: FloatArray, simplices: IntArray, sizes: FloatArray, nodal: FloatArray, truth: Function
) -> float:
    """Relative L2 difference of the linear function with these nodal values from the truth."""
    barycentric, weights = rule(simplices.shape[1])
    exact = truth(barycentric @ points[simplices])
    gap = nodal[simplices] @ barycentric.T - exact
    return math.sqrt(float(sizes @ (gap**2 @ weights)) / float(sizes @ (exact**2 @ weights)))


# Bodies that are smooth, with a smooth fluence


@dataclass(frozen=True, eq=False)
class Body:
    """A body with a fluence that is known, and the sources that make it.

    Attributes
    ----------
    source : callable
        ``Q0 = sigma_a phi - D ∇²phi`` at points (..., 3).
    onto : callable
        Nearest points of the true surface.
    inflow : callable, optional
        ``phi/(2A) + D dphi/dn`` where it is not zero.
    """

    title: str
    coefficients: Coefficients
    fluence: Function
    source: Function
    onto: Function
    mesh: Callable[[int], TetMesh]
    levels: tuple[int, ...]
    inflow: Function | None = None

    def solved(self, level: int) -> Solution:
        """The discrete solution, the loads integrated here."""
        mesh, medium = self.mesh(level), self.coefficients.medium
        load = integrals_with_hats(mesh.points, mesh.tetrahedra, mesh.volumes, self.source)
        if self.inflow is not None:
            load += integrals_with_hats(mesh.points, mesh.boundary_faces, mesh.boundary_areas, self.inflow)
        fluence = Solver(system_matrix(mesh, medium), [multigrid]).solve(load).x
        return Solution(mesh, mesh.surface, PartialCurrent(medium), fluence, Power(1.0, 0.0, 0.0, 1.0, 0.0))

    def measured(self, level: int) -> Row:
        """Errors of fluence in the volume and of exitance on the surface, each point held to the true one."""
        solution = self.solved(level)
        mesh = solution.mesh
        twice_a = 2.0 * self.coefficients.boundary_factor
        inside = relative_error(mesh.points, mesh.tetrahedra, mesh.volumes, solution.fluence, self.fluence)
        outside = relative_error(
            mesh.boundary_points,
            mesh.boundary_triangles,
            mesh.boundary_areas,
            solution.exitance,
            lambda x: self.fluence(self.onto(x)) / twice_a,
        )
        return Row.on(mesh, {"fluence": inside, "exitance": outside})

    def table(self) -> Table:
        return Table(self.title, [self.measured(level) for level in self.levels])


def plate() -> Body:
    """A column out of an infinite slab in a wide beam, ``Q0 = sigma_s' e^{-sigma_t' z}``; its sides are mirrors.

    Of 1 W/unit², 0.603381 come back and 0.244341 pass: thickness 5, reduced albedo 0.99, eta 1.3.
    """
    c = Coefficients(0.01, 0.99, 1.3)
    thickness, width, decay = 5.0, 1.0, c.sigma_a + c.sigma_s_prime
    k = math.sqrt(c.sigma_a / c.diffusion)
    particular = c.sigma_s_prime / (c.sigma_a - c.diffusion * decay**2)
    far = math.exp(-decay * thickness)
    # phi - zb phi' = 0 at z = 0 and phi + zb phi' = 0 at z = thickness
    e = math.exp(-k * thickness)
    system = [[1.0 + c.zb * k, e * (1.0 - c.zb * k)], [e * (1.0 - c.zb * k), 1.0 + c.zb * k]]
    right = [-particular * (1.0 + c.zb * decay), -particular * far * (1.0 - c.zb * decay)]
    down, up = np.linalg.solve(system, right)

    def fluence(x: FloatArray) -> FloatArray:
        z = -x[..., 2]
        return np.asarray(down * np.exp(-k * z) + up * np.exp(k * (z - thickness)) + particular * np.exp(-decay * z))

    def on_a_side(x: FloatArray) -> FloatArray:
        return np.asarray(np.abs(x[..., :2]).max(axis=-1) > 0.5 * width - 1e-9, dtype=float)

    return Body(
        "slab in a wide beam",
        c,
        fluence,
        lambda x: np.asarray(c.sigma_s_prime * np.exp(decay * x[..., 2])),
        lambda x: x,
        lambda n: brick(*(np.linspace(-0.5 * width, 0.5 * width, n + 1),) * 2, np.linspace(-thickness, 0.0, 5 * n + 1)),
        (2, 4, 8),
        inflow=lambda x: on_a_side(x) * fluence(x) / (2.0 * c.boundary_factor),
    )


def ball() -> Body:
    """Three eigenfunctions ``j_l(κ r) P_l(cos gamma)`` of a ball, each with the κ that meets the boundary."""
    c = Coefficients(0.05, 1.0, 1.4)
    radius = 4.0

    def condition(q: float, order: int) -> float:
        slope = q * special.spherical_jn(order, q * radius, derivative=True)
        return float(special.spherical_jn(order, q * radius) + c.zb * slope)

    kappa = [_first_root(partial(condition, order=order), 3.0 / radius * (order + 1)) for order in range(3)]

    def fluence_of(weights: Sequence[float]) -> Function:
        def total(x: FloatArray) -> FloatArray:
            r = np.linalg.norm(x, axis=-1)
            cosine = x[..., 2] / np.where(r > 0, r, 1.0)
            value = np.zeros_like(r)
            for order, weight in enumerate(weights):
                value += weight * special.spherical_jn(order, kappa[order] * r) * special.eval_legendre(order, cosine)
            return np.asarray(value)

        return total

    amplitude = (1.0, 1.0, 0.5)
    return Body(
        "sphere",
        c,
        fluence_of(amplitude),
        fluence_of([a * (c.diffusion * q**2 + c.sigma_a) for a, q in zip(amplitude, kappa, strict=True)]),
        lambda x: x * (radius / np.linalg.norm(x, axis=-1, keepdims=True)),
        lambda n: ball_mesh(radius, n),
        (5, 9, 15),
    )


def rod() -> Body:
    """Eigenfunctions ``J_m(κ rho) cos(m theta) cos(q z)`` of a cylinder with flat ends."""
    c = Coefficients(0.05, 1.0, 1.3)
    radius, half = 3.0, 3.0

    def condition(s: float, order: int) -> float:
        return float(special.jv(order, s * radius) + c.zb * s * special.jvp(order, s * radius))

    q = _first_root(lambda q: math.cos(q * half) - c.zb * q * math.sin(q * half), 0.5 * math.pi / half)
    kappa = [_first_root(partial(condition, order=order), 2.0 / radius * (order + 1)) for order in range(2)]

    def fluence_of(weights: Sequence[float]) -> Function:
        def total(x: FloatArray) -> FloatArray:
            rho, theta = np.hypot(x[..., 0], x[..., 1]), np.arctan2(x[..., 1], x[..., 0])
            value = np.zeros_like(rho)
            for order, weight in enumerate(weights):
                value += weight * special.jv(order, kappa[order] * rho) * np.cos(order * theta)
            return np.asarray(value * np.cos(q * x[..., 2]))

        return total

    def onto(x: FloatArray) -> FloatArray:
        rho = np.hypot(x[..., 0], x[..., 1])
        on_an_end = np.abs(x[..., 2]) > half - 1e-9
        factor = np.where(on_an_end, 1.0, radius / np.where(rho > 0, rho, 1.0))
        return np.asarray(x * np.stack([factor, factor, np.ones_like(factor)], axis=-1))

    amplitude = (1.0, 1.0)
    return Body(
        "cylinder",
        c,
        fluence_of(amplitude),
        fluence_of([a * (c.diffusion * (s**2 + q**2) + c.sigma_a) for a, s in zip(amplitude, kappa, strict=True)]),
        onto,
        lambda n: cylinder_mesh(radius, 2.0 * half, n),
        (6, 10, 16),
    )


def ring() -> Body:
    """A torus, with ``phi = F(s)(1 + cos(u)/2) + G(s) z/(2 r)``: s from the middle of the tube, u along it.

    ``F = 1 - s²/(r² + 2 r zb)`` and ``s G``, ``G = 1 - g s²``, meet ``f + zb f' = 0`` on the tube's surface s = r.
    """
    c = Coefficients(0.05, 1.0, 1.4)
    major, minor = 4.0, 1.5
    f = 1.0 / (minor**2 + 2.0 * minor * c.zb)
    g = (minor + c.zb) / (minor**3 + 3.0 * minor**2 * c.zb)

    def parts(x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        rho, z = np.hypot(x[..., 0], x[..., 1]), x[..., 2]
        return rho, z, (rho - major) ** 2 + z**2, x[..., 0] / rho

    def fluence(x: FloatArray) -> FloatArray:
        _, z, s2, cosine = parts(x)
        return np.asarray((1.0 - f * s2) * (1.0 + 0.5 * cosine) + 0.5 * z / minor * (1.0 - g * s2))

    def laplacian(x: FloatArray) -> FloatArray:
        rho, z, s2, cosine = parts(x)
        of_s2 = 4.0 + 2.0 * (rho - major) / rho
        first = -f * of_s2 * (1.0 + 0.5 * cosine) - (1.0 - f * s2) * 0.5 * cosine / rho**2
        return np.asarray(first - 0.5 * g * z / minor * (of_s2 + 4.0))

    def onto(x: FloatArray) -> FloatArray:
        rho, _, s2, _ = parts(x)
        middle = x * np.array([1.0, 1.0, 0.0]) * (major / rho)[..., None]
        return np.asarray(middle + (x - middle) * (minor / np.sqrt(s2))[..., None])

    return Body(
        "torus",
        c,
        fluence,
        lambda x: c.sigma_a * fluence(x) - c.diffusion * laplacian(x),
        onto,
        lambda n: torus_mesh(major, minor, n),
        (3, 6, 10),
    )


BODIES: dict[str, Callable[[], Body]] = {"slab": plate, "sphere": ball, "cylinder": rod, "torus": ring}


def _first_root(function: Callable[[float], float], high: float) -> float:
    """The first root above 0, by bisection after a walk in small steps."""
    steps = np.linspace(1e-6, 2.0 * high, 400)
    values = [function(float(s)) for s in steps]
    change = next(i for i in range(1, len(steps)) if values[i] * values[0] < 0)
    return float(brentq(function, steps[change - 1], steps[change], xtol=1e-14))


# Meshes


def brick(*axes: FloatArray) -> TetMesh:
    """Boxes between the coordinates along x, y and z, each cut into six tetrahedra without obtuse angles."""
    mesh = MeshTet1.init_tensor(*axes).oriented()
    return TetMesh(np.ascontiguousarray(mesh.p.T), np.ascontiguousarray(mesh.t.T).astype(np.int64))


def ball_mesh(radius: float, n: int) -> TetMesh:
    """A ball of n layers: twenty tetrahedra round the centre, each cut into n³ and spread out along the radii.

    Each is cut like the cubes of a lattice (Freudenthal 1942), its corners in the order of their numbers, so
    that neighbours agree, and no shapes but three arise however large n is.
    """
    import trimesh  # noqa: PLC0415

    shell = trimesh.creation.icosahedron()
    corners = np.vstack([np.zeros((1, 3)), shell.vertices])
    # In units of 1/n of the edges: n >= x >= y >= z >= 0.
    lattice = np.array([(x, y, z) for x in range(n + 1) for y in range(x + 1) for z in range(y + 1)])
    number = {tuple(place): i for i, place in enumerate(lattice.tolist())}
    cells = []
    for start in lattice:
        for axes in permutations(range(3)):
            path = [start, *(start + np.cumsum(np.eye(3, dtype=np.int64)[list(axes)], axis=0))]
            nodes = [number.get(tuple(place.tolist())) for place in path]
            if None not in nodes:
                cells.append(nodes)
    x, y, z = lattice.T / n
    shares = np.column_stack([1.0 - x, x - y, y - z, z])
    pieces = [shares @ corners[[0, *sorted(face + 1)]] for face in shell.faces]
    points, same = _merged(np.vstack(pieces))
    whole = np.vstack([np.array(cells) + i * len(lattice) for i in range(len(pieces))])
    # 1 on the icosahedron, and there alone.
    gauge = (points @ shell.face_normals.T).max(axis=1) / (shell.face_normals[0] @ shell.vertices[shell.faces[0, 0]])
    return _oriented(_at_radius(points, radius * gauge), same[whole])


def _merged(points: FloatArray) -> tuple[FloatArray, IntArray]:
    """Points without repetition, and the number of each of the given ones among them."""
    _, first, same = np.unique(np.round(points, 9), axis=0, return_index=True, return_inverse=True)
    return points[first], np.asarray(same.ravel(), dtype=np.int64)


def _at_radius(points: FloatArray, radius: FloatArray) -> FloatArray:
    """Points moved along their radii."""
    distance = np.linalg.norm(points, axis=1)
    factor = np.divide(radius, distance, out=np.zeros_like(distance), where=distance > 0)
    return np.asarray(points * factor[:, None])


def _disc(n: int) -> tuple[FloatArray, IntArray]:
    """A unit disc of n rings: a lattice of triangles in a hexagon, spread out along the radii."""
    span = list(product(range(-n, n + 1), repeat=2))
    number = {pair: i for i, pair in enumerate(pair for pair in span if abs(sum(pair)) <= n)}
    lattice = np.array(list(number))
    gauge = np.abs(np.column_stack([lattice, lattice.sum(axis=1)])).max(axis=1) / n
    points = _at_radius(lattice @ np.array([[1.0, 0.0], [0.5, math.sqrt(0.75)]]), gauge)
    triangles = [
        [number[corner] for corner in triangle]
        for i, j in span
        for triangle in (((i, j), (i + 1, j), (i, j + 1)), ((i + 1, j), (i + 1, j + 1), (i, j + 1)))
        if all(corner in number for corner in triangle)
    ]
    return points, np.array(triangles)


def _prisms(triangles: IntArray, count: int, layers: int, closed: bool) -> IntArray:
    """Tetrahedra of `layers` layers of prisms over the triangles of a plane of `count` nodes.

    Every side is cut from its lower-numbered node below to the other above, so that neighbours agree.
    """
    low = np.sort(triangles, axis=1)
    cells = []
    for layer in range(layers):
        a, b, c = (low[:, i] + layer * count for i in range(3))
        above = ((layer + 1) % layers if closed else layer + 1) * count
        top_a, top_b, top_c = (low[:, i] + above for i in range(3))
        cells += [np.column_stack(t) for t in ((a, b, c, top_c), (a, b, top_b, top_c), (a, top_a, top_b, top_c))]
    return np.vstack(cells)


def _oriented(points: FloatArray, cells: IntArray) -> TetMesh:
    a, b, c, d = (points[cells[:, i]] for i in range(4))
    inverted = np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a) < 0
    cells[inverted] = cells[inverted][:, [1, 0, 2, 3]]
    return TetMesh(points, cells)


def cylinder_mesh(radius: float, height: float, n: int) -> TetMesh:
    """A cylinder about the z axis of n rings and n layers."""
    disc, triangles = _disc(n)
    levels = np.linspace(-0.5 * height, 0.5 * height, n + 1)
    points = np.vstack([np.column_stack([radius * disc, np.full(len(disc), z)]) for z in levels])
    return _oriented(points, _prisms(triangles, len(disc), n, closed=False))


def torus_mesh(major: float, minor: float, n: int) -> TetMesh:
    """A torus about the z axis, its tube of n rings, 6 n layers along."""
    disc, triangles = _disc(n)
    layers = 6 * n
    points = []
    for u in 2.0 * math.pi * np.arange(layers) / layers:
        rho = major + minor * disc[:, 0]
        points.append(np.column_stack([rho * math.cos(u), rho * math.sin(u), minor * disc[:, 1]]))
    return _oriented(np.vstack(points), _prisms(triangles, len(disc), layers, closed=True))


class TrueSphere(Surface):
    """A triangulated sphere that stands for the sphere itself."""

    def project(self, queries: FloatArray) -> tuple[FloatArray, FloatArray]:
        normals = queries / np.linalg.norm(queries, axis=1, keepdims=True)
        return normals * np.linalg.norm(self.points[0]), normals


# Point sources, on meshes graded towards them


def point_in_a_ball(finenesses: Sequence[float], subtract: Subtract) -> Table:
    """A point one mean free path below the pole of a ball of radius 10, against the ball's series.

    Edges are `finenesses` times the distance from the source.
    """
    medium = Coefficients(0.01, 1.0, 1.4).medium
    radius, height = 10.0, 10.0 - 1.0 / 1.01
    coarse = sphere_surface(radius)
    surface = TrueSphere(coarse.points, coarse.faces)
    light = PointSource((0.0, 0.0, height))
    lit = places_to_resolve([light.deposit_in(LitBody(coarse, (medium,)))])

    def truth(x: FloatArray) -> FloatArray:
        gamma = np.arctan2(np.hypot(x[..., 0], x[..., 1]), x[..., 2])
        return sphere.point_exitance(medium, radius=radius, source_radius=height, gamma=gamma)

    rows = []
    for fineness in finenesses:
        mesh = grade_mesh(ball_mesh(radius, 4), surface, *lit, 1_000_000, longest=fineness)
        solution = solve(surface, medium, [light], mesh=mesh, subtract=subtract)
        error = relative_error(
            mesh.boundary_points, mesh.boundary_triangles, mesh.boundary_areas, solution.exitance, truth
        )
        rows.append(Row.on(mesh, {"exitance": error, "exited power": abs(solution.power.exited / 0.79094984 - 1.0)}))
    return Table(f"point source in a sphere, graded mesh, {subtract} subtracted", rows)


# A point one mean free path below the face z = 0 of a plate so wide and thick that it is a half-space to
# within 0.1 % of the exitance.
DEEP = Coefficients(0.01, 1.0, 1.4)
DEPTH = 1.0 / 1.01
SOURCE = np.array([0.0, 0.0, -DEPTH])
THICKNESS = 12.0
FACE = 0.0
# Where fluence and exitance are compared, and the widths of the bells that weigh the flux.
DISC = 8.0
BELLS = (1.0, 2.0, 4.0)


def dipole_and_robin(finenesses: Sequence[float] = (1.0, 0.5, 0.28)) -> Table:
    """The same point source with both boundaries, against both closed forms, and against the wrong one.

    With phi = 0 on the planes z = zb and z = -THICKNESS - zb it is the dipole that the solver converges to;
    with the partial-current boundary it is the exact half-space, which the dipole is not.
    """
    rows = []
    for fineness in finenesses:
        between = _between_extrapolated_planes(fineness)
        rows.append(Row.on(between[0], between[1] | _with_robin(fineness)))
    return Table("point source in a slab: phi = 0 on the extrapolated planes, and Robin", rows)


def _between_extrapolated_planes(fineness: float) -> tuple[TetMesh, dict[str, float]]:
    medium, zb = DEEP.medium, DEEP.zb
    mesh = _graded_to_the_point(np.array([-THICKNESS - zb, -8.0, -4.0, -2.0, FACE, zb]), fineness)
    z = mesh.points[:, 2]
    inner = np.flatnonzero((z > -THICKNESS - zb + 1e-9) & (z < zb - 1e-9))
    # Rows and columns of the known zeros go: what is left is symmetric.
    matrix = system_matrix(mesh, medium)[inner][:, inner]
    fluence = np.zeros(len(z))
    fluence[inner] = Solver(matrix, [multigrid]).solve(_point_load(mesh)[inner]).x

    # Through the real face, weighed with v, flows what the layer above it takes: ∫ D grad phi . grad v + sigma_a phi v.
    above = mesh.tetrahedra[mesh.points[mesh.tetrahedra, 2].mean(axis=1) > FACE]
    used, cells = np.unique(above, return_inverse=True)
    layer = TetMesh(mesh.points[used], cells.reshape(-1, 4))
    face, weights = _nodes_of_face(layer)
    flow = (system_matrix(layer, medium) @ fluence[used])[face] - weights * fluence[used][face] / (
        2.0 * DEEP.boundary_factor
    )
    points = layer.points[face]
    rho = np.hypot(points[:, 0], points[:, 1])
    passed = [float(flow @ np.exp(-0.5 * (rho / width) ** 2)) for width in BELLS]
    gaps = np.array(passed) / [_through_bell(lambda r: dipole.flux(medium, depth=DEPTH, rho=r), b) for b in BELLS] - 1.0
    truth = dipole.fluence(medium, depth=DEPTH, points=points)
    slab_truth = slab.extrapolated_fluence(medium, thickness=THICKNESS, depth=DEPTH, points=points * [1.0, 1.0, 0.0])
    near = weights * (rho < DISC)
    return mesh, {
        "phi = 0: fluence, slab": _weighted(near, fluence[used][face], slab_truth),
        "phi = 0: fluence, dipole": _weighted(near, fluence[used][face], truth),
        "phi = 0: flux, dipole": float(np.abs(gaps).max()),
    }


def _with_robin(fineness: float) -> dict[str, float]:
    mesh = _graded_to_the_point(np.array([-THICKNESS, -8.0, -4.0, -2.0, FACE]), fineness)
    medium = DEEP.medium
    fluence = Solver(system_matrix(mesh, medium), [multigrid]).solve(_point_load(mesh)).x
    face, weights = _nodes_of_face(mesh)
    rho = np.hypot(mesh.points[face, 0], mesh.points[face, 1])
    exitance = fluence[face] / (2.0 * DEEP.boundary_factor)
    near = weights * (rho < DISC)
    return {
        "Robin: exitance, half-space": _weighted(
            near, exitance, half_space.point_exitance(medium, depth=DEPTH, rho=rho)
        ),
        "Robin: exitance, dipole": _weighted(near, exitance, dipole.flux(medium, depth=DEPTH, rho=rho)),
    }


def _graded_to_the_point(z: FloatArray, fineness: float) -> TetMesh:
    """Bisected until no edge is longer than `fineness` times the distance from the source."""
    half = 2.0 ** np.arange(1, 6)
    across = np.concatenate([-half[::-1], [0.0], half])
    mesh = brick(across, across, z)
    while True:
        distance = np.linalg.norm(mesh.points[mesh.tetrahedra].mean(axis=1) - SOURCE, axis=1)
        long = mesh.longest_edges > fineness * np.maximum(distance, DEPTH)
        if not long.any():
            return mesh
        mesh = refine(mesh, long)


def _point_load(mesh: TetMesh) -> FloatArray:
    """1 W at the depth of the source."""
    cells, weights = mesh.locate(SOURCE)
    return summed(mesh.tetrahedra[cells], weights, len(mesh.points))


def _nodes_of_face(mesh: TetMesh) -> tuple[IntArray, FloatArray]:
    """Nodes on z = FACE and a third of the area of the triangles around each."""
    on_face = (np.abs(mesh.points[mesh.boundary_faces, 2] - FACE) < 1e-9).all(axis=1)
    shares = np.repeat(mesh.boundary_areas[on_face] / 3.0, 3)
    areas = summed(mesh.boundary_faces[on_face], shares, len(mesh.points))
    nodes = np.flatnonzero(areas).astype(np.int64)
    return nodes, areas[nodes]


def _through_bell(flux: Function, width: float) -> float:
    """``∫ flux(rho) e^{-rho²/(2 width²)} 2 pi rho drho``."""
    nodes, weights = np.polynomial.legendre.leggauss(100)
    rho = 5.0 * width * (nodes + 1.0)
    return float(5.0 * width * weights @ (flux(rho) * np.exp(-0.5 * (rho / width) ** 2) * 2.0 * math.pi * rho))


def _weighted(weights: FloatArray, values: FloatArray, truth: FloatArray) -> float:
    return math.sqrt((weights @ (values - truth) ** 2) / (weights @ truth**2))


def main() -> None:
    """Print all tables."""
    for body in BODIES.values():
        print(body().table())
    print(point_in_a_ball((1.0, 0.5, 0.25), "nothing"))
    print(point_in_a_ball((1.0, 0.5, 0.25), "half-space"))
    print(dipole_and_robin())


if __name__ == "__main__":
    main()
