"""What accuracy costs, at a glance: a sentence, the runs that move, and a chart, within seconds and better while one looks."""
