"""Direct solution by sparse factors."""

import numpy as np

from tetlux.fem.linear.krylov import Method, Product


def direct(product: Product) -> Method:
    """Sparse Cholesky in all but name: LU of a symmetric matrix with the pivots on its diagonal (SuperLU)."""
    from scipy.sparse.linalg import splu  # noqa: PLC0415

    options = {"SymmetricMode": True}
    factors = splu(product.matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
    return lambda rest: (np.asarray(factors.solve(rest)), 0)
