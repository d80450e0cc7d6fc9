"""Case files, batches, pictures and the command line."""
