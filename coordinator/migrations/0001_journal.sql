-- The journal of one coordinator. Names and units are those of the wire messages; `body` is
-- the message itself as JSON. Written for SQLite and PostgreSQL alike.

CREATE TABLE meta (
    name TEXT PRIMARY KEY NOT NULL,
    value BIGINT NOT NULL
);
INSERT INTO meta (name, value) VALUES ('epoch', 0);

-- Telemetry. The primary key makes a message that arrives twice one row, and serves the
-- question "this robot, from then to then".

CREATE TABLE robot_gauges (
    robot TEXT NOT NULL,
    at_ms BIGINT NOT NULL,
    seq BIGINT NOT NULL,
    soc DOUBLE PRECISION NOT NULL,
    soc_sigma DOUBLE PRECISION NOT NULL,
    remaining_wh DOUBLE PRECISION NOT NULL,
    remaining_wh_sigma DOUBLE PRECISION NOT NULL,
    full_wh DOUBLE PRECISION NOT NULL,
    full_wh_sigma DOUBLE PRECISION NOT NULL,
    time_to_empty_s DOUBLE PRECISION,
    time_to_empty_s_sigma DOUBLE PRECISION,
    time_to_full_s DOUBLE PRECISION,
    time_to_full_s_sigma DOUBLE PRECISION,
    soh DOUBLE PRECISION NOT NULL,
    soh_sigma DOUBLE PRECISION NOT NULL,
    voltage_v DOUBLE PRECISION NOT NULL,
    current_a DOUBLE PRECISION NOT NULL,
    temperature_degc DOUBLE PRECISION NOT NULL,
    power_w DOUBLE PRECISION NOT NULL,
    cells_series BIGINT NOT NULL,
    source TEXT NOT NULL,
    PRIMARY KEY (robot, at_ms, seq)
);

CREATE TABLE pack_gauges (
    station TEXT NOT NULL,
    pack TEXT NOT NULL,
    at_ms BIGINT NOT NULL,
    seq BIGINT NOT NULL,
    soc DOUBLE PRECISION NOT NULL,
    soc_sigma DOUBLE PRECISION NOT NULL,
    remaining_wh DOUBLE PRECISION NOT NULL,
    remaining_wh_sigma DOUBLE PRECISION NOT NULL,
    full_wh DOUBLE PRECISION NOT NULL,
    full_wh_sigma DOUBLE PRECISION NOT NULL,
    time_to_empty_s DOUBLE PRECISION,
    time_to_empty_s_sigma DOUBLE PRECISION,
    time_to_full_s DOUBLE PRECISION,
    time_to_full_s_sigma DOUBLE PRECISION,
    soh DOUBLE PRECISION NOT NULL,
    soh_sigma DOUBLE PRECISION NOT NULL,
    voltage_v DOUBLE PRECISION NOT NULL,
    current_a DOUBLE PRECISION NOT NULL,
    temperature_degc DOUBLE PRECISION NOT NULL,
    power_w DOUBLE PRECISION NOT NULL,
    cells_series BIGINT NOT NULL,
    source TEXT NOT NULL,
    PRIMARY KEY (station, pack, at_ms, seq)
);

CREATE TABLE robot_states (
    robot TEXT NOT NULL,
    at_ms BIGINT NOT NULL,
    seq BIGINT NOT NULL,
    phase TEXT NOT NULL,
    station TEXT,
    bay TEXT,
    drain_w DOUBLE PRECISION NOT NULL,
    drain_w_sigma DOUBLE PRECISION NOT NULL,
    battery TEXT NOT NULL,
    body TEXT NOT NULL,
    PRIMARY KEY (robot, at_ms, seq)
);

CREATE TABLE station_states (
    station TEXT NOT NULL,
    at_ms BIGINT NOT NULL,
    seq BIGINT NOT NULL,
    active_pack TEXT,
    powered BOOLEAN NOT NULL,
    lift_busy BOOLEAN NOT NULL,
    pack_power_w DOUBLE PRECISION NOT NULL,
    body TEXT NOT NULL,
    PRIMARY KEY (station, at_ms, seq)
);

-- Decisions.

CREATE TABLE events (
    seq BIGINT PRIMARY KEY NOT NULL,
    at_ms BIGINT NOT NULL,
    kind TEXT NOT NULL,
    robot TEXT,
    station TEXT,
    pack TEXT,
    body TEXT NOT NULL
);

CREATE TABLE plans (
    plan BIGINT PRIMARY KEY NOT NULL,
    at_ms BIGINT NOT NULL,
    policy TEXT NOT NULL,
    body TEXT NOT NULL
);

-- `number` counts rows: two capacities may carry the same instant.
CREATE TABLE capacities (
    number BIGINT PRIMARY KEY NOT NULL,
    at_ms BIGINT NOT NULL,
    robots_expected BIGINT NOT NULL,
    robots_promised BIGINT NOT NULL,
    confidence DOUBLE PRECISION NOT NULL,
    body TEXT NOT NULL
);

-- Only the newest per robot: every plan brings one for each of them, and the plans keep
-- the reasons of what was scheduled.
CREATE TABLE explanations (
    robot TEXT PRIMARY KEY NOT NULL,
    at_ms BIGINT NOT NULL,
    body TEXT NOT NULL
);

CREATE TABLE commands (
    id TEXT PRIMARY KEY NOT NULL,
    epoch BIGINT NOT NULL,
    at_ms BIGINT NOT NULL,
    deadline_ms BIGINT NOT NULL,
    robot TEXT,
    station TEXT,
    body TEXT NOT NULL,
    reply_at_ms BIGINT,
    reply_body TEXT,
    CHECK ((robot IS NULL) <> (station IS NULL)),
    CHECK ((reply_at_ms IS NULL) = (reply_body IS NULL))
);
CREATE INDEX unanswered_commands ON commands (at_ms, id) WHERE reply_body IS NULL;
