"""What the published method is compared with: its study, and other works' methods."""
