"""Islands advanced from event to event."""
