"""The machine: work on all cores, scratch folders, the file system, installed libraries."""
