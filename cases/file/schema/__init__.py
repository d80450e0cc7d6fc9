"""The case file's schema, a class for each section."""
