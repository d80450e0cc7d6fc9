"""`Surface`, the closed triangle mesh that bounds a body, and the smooth surface that it approximates."""
