"""Wedges: one scene many times with varied parameters, on several processes or machines, and a page that shows all takes."""
