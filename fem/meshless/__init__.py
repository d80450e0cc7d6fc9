"""Solutions without a mesh: by the charges that `tetlux.fem.charges` fits, and by closed forms.

solution       `ChargeSolution`
solve          makes one from a body, its media and lights
reading_error  errors of what is read of one
closed_form    `ClosedFormSolution`
exact_field    the series that it evaluates
"""

from tetlux.fem.meshless.closed_form import ClosedFormSolution
from tetlux.fem.meshless.solution import ChargeSolution
from tetlux.fem.meshless.solve import solve_with_charges

__all__ = ["ChargeSolution", "ClosedFormSolution", "solve_with_charges"]
