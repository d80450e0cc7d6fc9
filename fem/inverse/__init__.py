"""Coefficients, chromophores and places of lights from readings, by least squares with derivatives by adjoints.

`unknowns` says what is fitted of media, and which media follow from its values; `parameters` adds coordinates of
lights, and has what an optimizer varies; `request` checks what is given; `problem` has residuals of readings and their
derivatives on a fixed mesh; `fit` is least squares, with the mesh adapted again after long ways; `result` has values
and what readings do not tell.
"""
