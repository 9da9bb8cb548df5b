"""Islands advanced by the sub-stepped solver."""
