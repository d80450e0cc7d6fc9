"""A run held against closed forms: what `compare:` in a case file asks for."""
