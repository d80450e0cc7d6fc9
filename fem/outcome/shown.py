"""`Shown`: how a solution is handed to PyVista, drawn, and shown in notebooks."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from tetlux.fem.models.modulation import lag, modulus
from tetlux.fem.outcome.surface_exitance import surface_exitance
from tetlux.meshing.arrays import FloatArray, Vector
from tetlux.meshing.describe import count, percent
from tetlux.meshing.errors import InputError
from tetlux.meshing.html import html_table

if TYPE_CHECKING:
    import pyvista

# Logarithmic colours span at most this factor, as those of pictures do.
WIDEST = 1e-6
# Fields that are shown on a linear scale unless it is said otherwise.
LINEAR = ("valid", "phase")


class Shown:
    """What `tetlux.fem.Solution` and those without a mesh share: their display."""

    def to_pyvista(self) -> "pyvista.MultiBlock":
        """Hand the surface and the volume, with all arrays, to PyVista.

        Returns
        -------
        pyvista.MultiBlock
            ``surface``, a `pyvista.PolyData` with ``exitance`` (W/unit²), ``valid``, and of modulated light ``phase``
            (degrees) at its vertices; with a mesh also ``volume``, a `pyvista.UnstructuredGrid` with ``fluence``
            (W/unit²), of modulated light ``phase``, and ``region``.

        Examples
        --------
        >>> from tetlux.fem import Medium, PointSource, solve
        >>> from tetlux.meshing import sphere
        >>> tissue = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
        >>> blocks = solve(sphere(10.0), tissue, [PointSource((0, 0, 5))], tolerance=0.1).to_pyvista()
        >>> blocks["surface"].array_names, blocks["volume"].array_names
        (['exitance', 'valid'], ['fluence', 'region'])
        """
        import pyvista  # noqa: PLC0415 - slow to import

        blocks = pyvista.MultiBlock()
        blocks["surface"] = _surface_of(self)
        if _has_mesh(self):
            blocks["volume"] = _volume_of(self)
        return blocks

    def plot(
        self,
        field: str | None = None,
        *,
        cut: Literal["x", "y", "z"] | Vector | None = None,
        log: bool | None = None,
        cmap: str = "inferno",
        screenshot: str | None = None,
        show: bool = True,
    ) -> "pyvista.Plotter":
        """Draw the body with PyVista, in a window, a notebook or a file.

        Parameters
        ----------
        field : str, optional
            ``exitance``, ``valid``, ``phase`` or ``fluence``; by default the exitance, with a cut the fluence.
        cut : {"x", "y", "z"} or (3,) floats, optional
            Normal of a plane through the middle, which cuts the volume open.
        log : bool, optional
            Whether colours follow the logarithm, down to six decades below the largest value; by default they do for
            exitance and fluence.
        cmap : str
            A colour map of matplotlib.
        screenshot : str, optional
            A PNG file to write in place of opening a window.
        show : bool
            Whether it is shown now; otherwise more can be added to the plotter first.

        Returns
        -------
        pyvista.Plotter

        Raises
        ------
        InputError
            If the solution has no such field, or no mesh to be cut.

        Examples
        --------
        >>> from tetlux.fem import Medium, PointSource, solve
        >>> from tetlux.meshing import sphere
        >>> tissue = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
        >>> solution = solve(sphere(10.0), tissue, [PointSource((0, 0, 5))], tolerance=0.1)
        >>> plotter = solution.plot(cut="y", show=False)
        >>> plotter.scalar_bar.GetTitle()
        'fluence, W/mm²'
        """
        import pyvista  # noqa: PLC0415

        name = field or ("exitance" if cut is None else "fluence")
        colours: Any = cmap  # PyVista's types list all names
        drawn = _block_with(self.to_pyvista(), name, cut is not None)
        values = np.asarray(drawn[name])
        logarithmic = name not in LINEAR if log is None else log
        if cut is not None:
            drawn = drawn.clip(normal=cut)
        plotter = pyvista.Plotter(off_screen=bool(screenshot) or None)
        plotter.add_mesh(
            drawn,
            scalars=name,
            cmap=colours,
            log_scale=logarithmic,
            clim=_ends(values, logarithmic),
            # Where it is cut, colours are those of the bar.
            lighting=cut is None,
            scalar_bar_args={
                "title": f"{name}{_unit_of(name, _surface(self).unit)}",
                "fmt": "%.2g",
                "vertical": True,
                "position_x": 0.86,
                "title_font_size": 16,
                "label_font_size": 14,
            },
        )
        # Or the title covers the uppermost label.
        plotter.scalar_bar.SetVerticalTitleSeparation(8)
        axes: Any = plotter.add_axes  # its types are those of an unbound method
        axes()
        if show or screenshot:
            plotter.show(screenshot=screenshot or False)
        return plotter

    def _repr_html_(self) -> str:
        return html_table(type(self).__name__, _rows(self))


# A solution of any model, whose attributes differ too much for a protocol.
_Any = Any


@dataclass(frozen=True, eq=False)
class _Modulus:
    """The modulus of the exitance of a solution, as a `ResolvedField`."""

    solution: _Any

    def __getattr__(self, name: str) -> Any:
        return getattr(self.solution, name)

    def exitance_on(self, queries: FloatArray) -> FloatArray:
        return modulus(self.solution.exitance_on(queries))


def _surface(solution: _Any) -> _Any:
    return solution.surface


def _has_mesh(solution: _Any) -> bool:
    return solution.mesh is not None


def _surface_of(solution: _Any) -> _Any:
    """The surface with its arrays, as PyVista has it."""
    import pyvista  # noqa: PLC0415

    surface, _ = surface_exitance(_Modulus(solution))
    exitance = solution.exitance_on(surface.points)
    block = pyvista.PolyData.from_regular_faces(surface.points, np.asarray(surface.faces, dtype=int))
    block.point_data["exitance"] = modulus(exitance)
    if (validity := getattr(solution, "validity", None)) is not None:
        block.point_data["valid"] = validity.at(surface.points)
    if np.iscomplexobj(exitance):
        block.point_data["phase"] = lag(exitance)
    block.set_active_scalars("exitance")
    return block


def _volume_of(solution: _Any) -> _Any:
    """The tetrahedra with their arrays, as PyVista has them."""
    import pyvista  # noqa: PLC0415

    mesh = solution.mesh
    block = pyvista.UnstructuredGrid({pyvista.CellType.TETRA: mesh.tetrahedra}, mesh.points)
    block.point_data["fluence"] = modulus(solution.fluence)
    if np.iscomplexobj(solution.fluence):
        block.point_data["phase"] = lag(solution.fluence)
    block.cell_data["region"] = np.array(mesh.regions)
    block.set_active_scalars("fluence")
    return block


def _block_with(blocks: _Any, name: str, cut: bool) -> _Any:
    """The block that has a field: of those on both, the volume if it is cut."""
    if cut and "volume" not in blocks.keys():  # noqa: SIM118 - of PyVista
        raise InputError(
            'a solution without a mesh cannot be cut; leave cut out, or solve with model="full".', field="cut"
        )
    order = ("volume",) if cut else ("surface", "volume")
    known = [(key, each) for key in order if key in blocks.keys() for each in blocks[key].point_data.keys()]  # noqa: SIM118
    for key, each in known:
        if each == name:
            return blocks[key]
    names = ", ".join(dict.fromkeys(each for _, each in known))
    raise InputError(
        f'there is no field "{name}" {"inside" if cut else "here"}; the fields are {names}.', field="field"
    )


def _ends(values: Any, logarithmic: bool) -> tuple[float, float]:
    """The values at the ends of the colours."""
    known = values[np.isfinite(values) & (values > 0 if logarithmic else True)]
    if len(known) == 0:
        return (0.1, 1.0)
    low, high = float(known.min()), float(known.max())
    return (max(low, WIDEST * high) if logarithmic else low, high)


def _unit_of(name: str, unit: str) -> str:
    return {"exitance": f", W/{unit}²", "fluence": f", W/{unit}²", "phase": ", degrees"}.get(name, "")


def _plus_minus(relative_error: float | None) -> str:
    return "" if relative_error is None else f"± {percent(relative_error)}"


def _rows(solution: _Any) -> Iterator[tuple[str, str]]:
    """What a notebook shows: the model, what leaves, where the power went, and how far it may be off."""
    yield "model", str(solution.model)
    if solution.mesh is not None:
        yield "mesh", f"{count(len(solution.mesh.points), 'node')}, {len(solution.mesh.tetrahedra):,} tetrahedra"
    exitance, unit = modulus(np.asarray(solution.exitance)), solution.surface.unit
    yield "exitance", f"{exitance.min():.3g} to {exitance.max():.3g} W/{unit}²"
    power = solution.power
    for name in ("incident", "specular", "absorbed", "exited", "ballistic"):
        value = abs(getattr(power, name))
        yield f"{name} power", f"{value:.4g} W ({percent(value / abs(power.incident))})" if power.incident else "0 W"
    if math.isfinite(solution.error_estimate):
        yield "estimated error of the exitance", percent(solution.error_estimate)
    for number, reading in enumerate(solution.readings, 1):
        yield f"reading {number}", f"{abs(reading.exitance):.4g} W/{unit}² {_plus_minus(reading.relative_error)}"
    for warning in solution.warnings:
        yield "note", str(warning)
