"""What a light deposits in a body, as plain data that can be pickled."""
