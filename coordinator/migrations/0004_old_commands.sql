-- Commands are deleted when they are old, and events by their number.
CREATE INDEX commands_by_time ON commands (at_ms, id);
