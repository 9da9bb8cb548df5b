"""What an impact does to velocities."""
