"""Stage constrain: forces of contacts that last."""
