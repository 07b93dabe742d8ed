"""The tables in the journal's file."""

SCHEMA = """
CREATE TABLE IF NOT EXISTS events
    (id INTEGER PRIMARY KEY, kind TEXT NOT NULL, stored REAL NOT NULL, body TEXT NOT NULL);
CREATE INDEX IF NOT EXISTS events_by_kind ON events (kind, id);
CREATE TABLE IF NOT EXISTS numbers (name TEXT PRIMARY KEY, value INTEGER NOT NULL);
CREATE TABLE IF NOT EXISTS deliveries
    (id INTEGER PRIMARY KEY AUTOINCREMENT, action TEXT NOT NULL, webhook_id TEXT NOT NULL, body TEXT NOT NULL,
     attempts INTEGER NOT NULL DEFAULT 0, due REAL NOT NULL);
CREATE TABLE IF NOT EXISTS latches (rule TEXT PRIMARY KEY, body TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS lowered (fraction REAL NOT NULL);
CREATE TABLE IF NOT EXISTS disabled (action TEXT PRIMARY KEY, url TEXT NOT NULL, reason TEXT NOT NULL);
"""
"""Creates those that are not there yet."""
