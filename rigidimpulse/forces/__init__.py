"""Stage forces: what accelerates bodies, constant over a sub-step."""
