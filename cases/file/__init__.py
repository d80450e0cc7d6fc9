"""From a case file to `Case`s: read, validated, swept, its surfaces and media loaded."""
