"""`Light`: the protocol of all lights."""

from typing import Protocol

from tetlux.fem.body.body import Body
from tetlux.fem.sources.deposit import Deposit


class Light(Protocol):
    """Any object with the method `deposit_in` is a light.

    Examples
    --------
    A glowing wire as nine points along it:

    >>> import numpy as np
    >>> from tetlux.fem import Deposit, Ledger, Medium, MeshHints, SourceTerms, solve
    >>> from tetlux.meshing import sphere
    >>> class Wire:
    ...     def deposit_in(self, body):
    ...         points = np.column_stack([np.zeros((9, 2)), np.linspace(-4.0, 4.0, 9)])
    ...         terms = SourceTerms(points=points, powers=np.full(9, 1.0 / 9.0))
    ...         finest = float(body.mean_free_paths(points).min())
    ...         return Deposit(Ledger(incident=1.0), terms, MeshHints(resolution=finest))
    >>> medium = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
    >>> solution = solve(sphere(10.0), medium, [Wire()], tolerance=0.05)
    >>> round(solution.power.incident, 9)
    1.0
    """

    def deposit_in(self, body: Body) -> Deposit:
        """Compute what this light leaves in a body.

        Parameters
        ----------
        body : Body
            The surface, and the medium at each place: `Body.mean_free_paths`, `Body.region_at`, `Body.paths`.

        Returns
        -------
        Deposit
            Its power has to balance: ``ledger.incident`` is the sum of ``specular``, ``absorbed``, ``ballistic`` and
            the power that `terms` scatter, W.

        Raises
        ------
        InputError
            If the light and the body do not go together.
        """
        ...
