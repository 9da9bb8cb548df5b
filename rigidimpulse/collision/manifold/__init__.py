"""The contacts of two shapes."""
