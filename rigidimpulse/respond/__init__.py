"""Stage respond: what an impact does to velocities."""
