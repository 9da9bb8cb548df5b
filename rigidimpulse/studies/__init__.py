"""Studies: runs of many scenes, and what they show."""
