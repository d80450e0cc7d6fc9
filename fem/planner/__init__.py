"""Choose the simplest model that gives what is asked for: ``tetlux.fem.plan``, and ``solve(..., model="auto")``.

request    what is asked for, as plain data
candidate  what all candidates share
closed_form, charges, truncated, full  what each model would cost, and whether it can give what is asked for
effort     how many tetrahedra lights need, and what they cost
costs      what past runs on this machine took
choose     the plan
solve      solves by the plan
options    the arguments of `tetlux.fem.solve`, and which of them are for finite elements alone
"""

from tetlux.fem.planner.choose import plan

__all__ = ["plan"]
