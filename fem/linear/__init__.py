"""Linear solvers that return the true residual."""
