"""What is shown of a batch while it runs, and the logs of its runs: listeners to its events."""
