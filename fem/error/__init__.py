"""The estimated error of the exitance."""
