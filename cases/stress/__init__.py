"""`tetlux stress`: runs at extreme values, and a map of where the solver fails."""
