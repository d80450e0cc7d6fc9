"""The body that light falls on: its surface, the media of its regions, and optical depths along paths through it."""
