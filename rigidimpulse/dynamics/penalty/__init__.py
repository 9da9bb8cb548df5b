"""The penalty method: springs push bodies out of each other."""
