"""What people write: plain data."""
