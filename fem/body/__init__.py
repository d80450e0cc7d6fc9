"""`Body`: which medium is where, and what light meets on its way."""
