"""From a case file to `Case`s: read, validate, expand the sweep, load surfaces and media."""
