"""When the world changes and how: event kinds, triggers, schedules, and the registry of kinds."""
