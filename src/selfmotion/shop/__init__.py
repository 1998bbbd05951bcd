"""Files of machines: paths in, programs out and back."""
