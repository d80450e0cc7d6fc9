"""`tetlux stress`: the solver driven to its edges, and a map of what breaks there."""
