-- Full-equivalent cycles that a gauge has counted; null from gauges that do not count them.
ALTER TABLE robot_gauges ADD COLUMN cycles DOUBLE PRECISION;
ALTER TABLE pack_gauges ADD COLUMN cycles DOUBLE PRECISION;
