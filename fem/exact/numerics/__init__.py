"""Numerical methods of the closed forms: quadrature, Bessel and Legendre functions, the field between planes."""
