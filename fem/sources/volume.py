"""`VolumeSource`: light that the volume emits, brighter in some places than in others."""

from collections.abc import Sequence
from typing import Protocol

from tetlux.meshing.arrays import FloatArray, NumberArray


class SourceField(Protocol):
    """The light that several volume sources on one mesh are made by."""

    def local_residual(self, lights: Sequence[int], dual: NumberArray, *, keep: bool) -> NumberArray:
        """What errors of that light contribute to an integral of the emitted light.

        Parameters
        ----------
        lights : sequence of int
            The lights of the sources, `VolumeSource.light`.
        dual : (size,) ndarray
            The dual solution of the integral, in quadratic elements.
        keep : bool
            Whether it will come again, so that what is solved for it is kept.

        Returns
        -------
        (m,) ndarray
            Of each tetrahedron.
        """
        ...


class VolumeSource(Protocol):
    """A right-hand side ``∫ q v`` on one mesh, W, for linear elements and for quadratic ones."""

    @property
    def at_nodes(self) -> NumberArray:
        """Integrals with the hat functions of the nodes, (n,); they sum to the emitted power."""
        ...

    @property
    def at_dofs(self) -> NumberArray:
        """Integrals with the shape functions of quadratic elements, (size,)."""
        ...

    @property
    def density(self) -> FloatArray:
        """Modulus of the mean of q in each tetrahedron, (m,), W/unit³."""
        ...

    @property
    def field(self) -> SourceField:
        """What it is made by."""
        ...

    @property
    def light(self) -> int:
        """The number of its light there."""
        ...
