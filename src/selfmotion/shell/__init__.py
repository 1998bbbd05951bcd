"""Files, pages, commands, and laws for what users write."""
