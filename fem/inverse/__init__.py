"""Coefficients from readings, by least squares with derivatives by adjoint solutions.

`unknowns` says what is fitted, and which media follow from its values; `request` checks what is given; `problem` has
residuals of readings and their derivatives on a fixed mesh; `fit` is least squares, with the mesh adapted again after
long ways; `result` has values and what readings do not tell.
"""
