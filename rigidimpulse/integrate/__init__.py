"""Stage `integrate`: where a body is at any time of its course, in closed form wherever there is one."""
