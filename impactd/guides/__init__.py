"""The manual: its pages, how Sphinx makes a site of them, and the list of the site's files."""
