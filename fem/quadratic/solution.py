"""`QuadraticSolution`: fluence in quadratic elements, and what is read of it, with error bars."""
