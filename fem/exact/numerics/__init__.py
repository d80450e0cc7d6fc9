"""What the closed forms are computed with: quadrature, Bessel and Legendre functions, the field between planes."""
