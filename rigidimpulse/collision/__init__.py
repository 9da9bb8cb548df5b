"""Geometric questions about posed shapes: pairs, distance, contacts, time of impact."""
