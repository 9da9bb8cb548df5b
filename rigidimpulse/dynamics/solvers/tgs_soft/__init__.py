"""The sub-stepped soft solver (TGS soft)."""
