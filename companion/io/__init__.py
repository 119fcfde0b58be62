"""Adapters to the world: thin asyncio shells, each read at a glance. Nothing in here decides anything."""
