"""What is known in closed form and subtracted."""
