"""Telemetry: what leaves Companion for people. Reads messages, owns nothing, decides nothing."""
