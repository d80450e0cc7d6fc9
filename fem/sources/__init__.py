"""What a light leaves in a body, as plain data."""
