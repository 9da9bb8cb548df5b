"""Rows of contacts and joints."""
