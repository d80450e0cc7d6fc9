"""What a solution is asked for: exitance, fluence, power, readings."""
