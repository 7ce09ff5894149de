-- When a message came, by the coordinator's clock, where its sender's clock is more than a minute away from that: then it is thinned
-- and deleted by this, and by `at_ms` where this is null. A robot without a clock of its own begins in 1970.
ALTER TABLE robot_gauges ADD COLUMN came_ms BIGINT;
ALTER TABLE pack_gauges ADD COLUMN came_ms BIGINT;
ALTER TABLE robot_states ADD COLUMN came_ms BIGINT;
ALTER TABLE station_states ADD COLUMN came_ms BIGINT;
CREATE INDEX robot_gauges_by_arrival ON robot_gauges (robot, came_ms) WHERE came_ms IS NOT NULL;
CREATE INDEX pack_gauges_by_arrival ON pack_gauges (station, pack, came_ms) WHERE came_ms IS NOT NULL;
CREATE INDEX robot_states_by_arrival ON robot_states (robot, came_ms) WHERE came_ms IS NOT NULL;
CREATE INDEX station_states_by_arrival ON station_states (station, came_ms) WHERE came_ms IS NOT NULL;

-- What is no telemetry is deleted by when it was, whatever else was told before or after it.
CREATE INDEX inputs_by_time ON inputs (at_ms);
CREATE INDEX plans_by_time ON plans (at_ms);
CREATE INDEX capacities_by_time ON capacities (at_ms);
CREATE INDEX events_by_time ON events (at_ms);
