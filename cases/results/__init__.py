"""The results of a batch as tables and a page, and loading them again."""
