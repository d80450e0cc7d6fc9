"""Solutions without a mesh: ``solve(..., model="charges")``, for what `tetlux.fem.charges` fits.

solution  `ChargeSolution`
solve     from a body, its media and lights to one
"""

from tetlux.fem.meshless.solution import ChargeSolution
from tetlux.fem.meshless.solve import solve_with_charges

__all__ = ["ChargeSolution", "solve_with_charges"]
