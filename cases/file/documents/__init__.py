"""Case files as YAML documents that know the line of every key, and their shared defaults."""
