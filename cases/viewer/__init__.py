"""``viewer.html``: a run as a page that can be turned and read, made of its data and of the script in `source`."""

PAGE = "viewer.html"
