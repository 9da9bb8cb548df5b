"""Where a body is at any time: trajectories in closed form."""
