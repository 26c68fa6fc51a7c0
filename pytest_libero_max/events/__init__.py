"""Changes of a world and their moments: event kinds, triggers, schedules, and the registry of kinds."""
