"""The event kinds of this package: one module an event, named like the event."""
