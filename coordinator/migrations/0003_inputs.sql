-- What the core was told, line by line, so that the journal can be told to a core again. Telemetry has
-- tables of its own; `message_at_ms` and `message_seq` say which row it was.
CREATE TABLE inputs (
    epoch BIGINT NOT NULL,
    number BIGINT NOT NULL,
    at_ms BIGINT NOT NULL,
    kind TEXT NOT NULL,
    robot TEXT,
    station TEXT,
    pack TEXT,
    message_at_ms BIGINT,
    message_seq BIGINT,
    body TEXT,
    PRIMARY KEY (epoch, number)
);

-- Each start of a coordinator: where its numbers began.
CREATE TABLE starts (
    epoch BIGINT PRIMARY KEY NOT NULL,
    event BIGINT NOT NULL,
    plan BIGINT NOT NULL
);

-- Texts about the store as a whole: the site that it belongs to.
CREATE TABLE facts (
    name TEXT PRIMARY KEY NOT NULL,
    value TEXT NOT NULL
);

-- Who leads, until when, by the server's clock. A file has a lock of the operating system instead.
CREATE TABLE lease (
    id BIGINT PRIMARY KEY NOT NULL,
    holder TEXT NOT NULL,
    until_ms BIGINT NOT NULL
);
INSERT INTO lease (id, holder, until_ms) VALUES (1, '', 0);
