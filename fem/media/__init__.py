"""Media: coefficients, phase functions, Fresnel reflection, materials."""
