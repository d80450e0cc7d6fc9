"""The estimated error of a solution, and where to refine to meet a tolerance."""
