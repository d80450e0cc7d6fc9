"""The weak form as matrices and loads."""
