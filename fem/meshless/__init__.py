"""Solutions without a mesh: ``solve(..., model="charges")``, by the charges that `tetlux.fem.charges` fits.

solution  `ChargeSolution`
solve     makes one from a body, its media and lights
reading_error  errors of what is read of one
"""

from tetlux.fem.meshless.solution import ChargeSolution
from tetlux.fem.meshless.solve import solve_with_charges

__all__ = ["ChargeSolution", "solve_with_charges"]
