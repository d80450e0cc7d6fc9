"""`tetlux chart`: error and seconds of several methods on the same scenes."""
